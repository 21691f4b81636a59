"""The existence of an isotropic Jacobian with equal columns, tested by its moments.

Moments of W = ZᵀZ (`equations`), averaged over joint orders, phase and conjugation, obey the
equations that `derive` solves, and matrices of them are positive semidefinite. The entry of row
u and column v is the moment of conj(u)·v, 0 unless both have the same *charge*, the number of W
minus that of conj(W). In the bases of `tableaux` the matrix falls into small blocks, affine in
the free moments y. The margin is the largest s ≤ 1 with B_b(y) ⪰ sI; if multipliers prove that
it is negative there is no solution, numerically (docs/nonexistence.md, section 5). `feasible`
proves nothing.
"""

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations_with_replacement, permutations
from typing import Any, Literal, TypeAlias

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from formulations.conic import SOLVER, run
from formulations.existence.derive import LinearMoments, solve_moment_equations
from formulations.existence.equations import Frame, Monomial
from formulations.existence.tableaux import Shape, adapted_bases, standard_tableaux
from nlp.arrays import (
    FloatArray,
    finite_or_none,
    nearest_semidefinite,
    one_blas_thread,
    whole_number,
)

IntArray: TypeAlias = NDArray[np.int64]
# Singular values and entries of blocks below these are rounding.
_RANK_TOLERANCE, _ZERO = 1e-8, 1e-12
# A moment matrix has up to 24 million entries: it is not stored, but used in pieces.
_ENTRIES_AT_ONCE = 2_000_000
# Relative rounding of the blocks, which are products of bases with errors of about 1e-12.
_ROUNDING = 1e-10


@dataclass(frozen=True, eq=False)
class EdgeMultisets:
    """The N multisets of at most `order` edges on some joints, two of which make a monomial.

    The *key* of a multiset has the multiplicities of its edges as digits, so that keys add up.
    """

    joints: int
    order: int
    #: Whether (i, i) is an edge.
    loops: bool = False

    @cached_property
    def edges(self) -> tuple[IntArray, IntArray]:
        """The edges (i, j), i ≤ j: an array of all i and one of all j."""
        return np.triu_indices(self.joints, 0 if self.loops else 1)

    @cached_property
    def edge_keys(self) -> IntArray:
        """The key of every edge (i, j), (joints, joints), symmetric."""
        keys = np.zeros((self.joints, self.joints), dtype=np.int64)
        keys[self.edges] = (self.order + 1) ** np.arange(len(self.edges[0]))
        return keys | keys.T

    @cached_property
    def keys(self) -> IntArray:
        """The keys of all multisets, ascending: shape (N,)."""
        digits, sizes = self.edge_keys[self.edges].tolist(), range(self.order + 1)
        choices = (combinations_with_replacement(digits, size) for size in sizes)
        return np.sort([sum(choice) for some in choices for choice in some])

    @cached_property
    def multiplicities(self) -> IntArray:
        """How often each multiset has each edge: shape (N, edges)."""
        return self.keys[:, None] // self.edge_keys[self.edges] % (self.order + 1)

    def number(self, keys: IntArray | int) -> IntArray:
        """Return the numbers of the multisets that have these keys."""
        return np.searchsorted(self.keys, keys)

    def rows(self, charge: int) -> tuple[IntArray, IntArray]:
        """Return the monomials of degree up to `order` with `charge` more W than conj(W)."""
        sizes = self.multiplicities.sum(axis=1)
        w, wbar = np.nonzero(
            (sizes[:, None] == sizes + charge) & (sizes[:, None] + sizes <= self.order)
        )
        return w, wbar

    def exchanges(
        self, rows: tuple[IntArray, IntArray]
    ) -> tuple[dict[int, csr_array], tuple[range]]:
        """Return how exchanges of neighbouring joints permute the rows, and all joints."""
        (i, j), (w, wbar), count = self.edges, rows, len(self.keys)
        size, found = len(w), {}
        for joint in range(self.joints - 1):
            names = np.arange(self.joints)
            names[[joint, joint + 1]] = joint + 1, joint
            image = self.number(self.multiplicities @ self.edge_keys[names[i], names[j]])
            goals = np.searchsorted(w * count + wbar, image[w] * count + image[wbar])
            entries = np.ones(size), (goals, np.arange(size))
            found[joint] = csr_array(entries, shape=(size, size))
        return found, (range(self.joints),)

    def class_table(self, classes: Sequence[Monomial]) -> IntArray:
        """Return the class of every monomial with as many W as conj(W), else −1: (N, N)."""
        table = np.full((len(self.keys), len(self.keys)), -1)
        names = np.array(list(permutations(range(self.joints)))).T
        for place, graph in enumerate(classes):
            both = (
                sum(self.edge_keys[names[i], names[j]] for i, j in pairs)
                for pairs in (graph.w, graph.wbar)
            )
            w, wbar = map(self.number, both)
            table[w, wbar] = table[wbar, w] = place
        return table


@dataclass(frozen=True, eq=False)
class MomentBlock:
    """One block of the moment matrix, B_0 + Σ_k y_k B_k for free moments y_k."""

    #: The charge of its rows, and the partition that names their representation.
    charge: int
    shape: Shape
    #: Number of rows before zeros were taken out.
    copies: int
    #: B_0, B_1, …: shape (1 + free moments, size, size).
    matrices: FloatArray
    #: Largest singular value taken for zero over the smallest taken for nonzero.
    doubt: float

    @property
    def size(self) -> int:
        """Number of rows."""
        return int(self.matrices.shape[1])

    def at(self, free: Sequence[Any] | FloatArray) -> Any:
        """Return the block at given free moments, numbers or variables of cvxpy."""
        terms = (y * matrix for y, matrix in zip(free, self.matrices[1:], strict=True))
        return sum(terms, self.matrices[0])


def moment_blocks(moments: LinearMoments) -> list[MomentBlock]:
    """Return the blocks of charge 0 and up that do not vanish."""
    order, blocks = moments.order, []
    multisets = EdgeMultisets(moments.frame.joints, order, moments.frame.diagonal)
    unions = multisets.number(multisets.keys[:, None] + multisets.keys)  # right up to the order
    table = multisets.class_table(moments.classes)
    for charge in range(order + 1):
        rows = w, wbar = multisets.rows(charge)
        bases = adapted_bases(*multisets.exchanges(rows))
        basis = np.hstack(list(bases.values()))
        matrices = np.zeros((moments.coefficients.shape[1], basis.shape[1], basis.shape[1]))
        for part in np.array_split(np.arange(len(w)), 1 + len(w) ** 2 // _ENTRIES_AT_ONCE):
            # In conj(u)·v the factors W of v meet the factors conj(W) of u.
            entries = table[unions[wbar[part, None], w], unions[w[part, None], wbar]]
            for matrix, values in zip(matrices, moments.coefficients.T, strict=True):
                matrix += basis[part].T @ (values[entries] @ basis)
        for (shape,), own in bases.items():
            copies = own.shape[1]
            blocks.append(_reduced(charge, shape, matrices[:, :copies, :copies]))
            matrices = matrices[:, copies:, copies:]
    return [block for block in blocks if block.size]


def _reduced(charge: int, shape: Shape, matrices: FloatArray) -> MomentBlock:
    """Return a block without the directions in which all its matrices vanish."""
    copies = matrices.shape[1]
    _, singular, axes = np.linalg.svd(matrices.reshape(-1, copies), full_matrices=False)
    size = int((singular > _RANK_TOLERANCE).sum())
    doubt = singular[size:].max(initial=0.0) / singular[:size].min(initial=np.inf)
    matrices = axes[:size] @ (0.5 * (matrices + matrices.transpose(0, 2, 1))) @ axes[:size].T
    matrices[np.abs(matrices) < _ZERO] = 0.0
    return MomentBlock(charge, shape, copies, matrices, float(doubt))


@dataclass(frozen=True, eq=False)
class Margin:
    """What free moments y attain and multipliers prove of some blocks, and their origin."""

    free: FloatArray | None
    multipliers: Sequence[FloatArray]
    #: Smallest eigenvalue over all blocks at y; minus infinity without one.
    attained: float
    #: Upper limit of the margin for moments of solutions: if negative, there are none.
    proved: float = 1.0
    #: Largest coefficient of a free moment that did not cancel.
    residual: float = math.inf
    #: Of the multipliers as they were given.
    smallest_eigenvalue: float = -math.inf
    #: The optimum that a solver found, or None, and what it reported.
    value: float | None = None
    status: str = "not solved"


def solve_margin(blocks: Sequence[MomentBlock], limits: FloatArray) -> Margin:
    """Find the margin of some blocks, where |y_k| is at most `limits`, and check it."""
    norms = np.max([np.linalg.norm(one.matrices[1:], axis=(1, 2)) for one in blocks], axis=0)
    # Solvers want unknowns that matter equally; some may not occur at all.
    moments = [cp.Variable() / (norm or 1.0) for norm in norms]
    margin = cp.Variable()
    conditions = [block.at(moments) - margin * np.eye(block.size) >> 0 for block in blocks]
    program = cp.Problem(cp.Maximize(margin), [*conditions, margin <= 1])
    status = run(program)
    value = finite_or_none(program.value)
    free = None if value is None else np.array([float(y.value) for y in moments])
    duals = [np.asarray(condition.dual_value, dtype=float) for condition in conditions]
    multipliers = [np.atleast_2d(dual) for dual in duals]  # NaN where the solver gave none
    return replace(check_margin(blocks, limits, free, multipliers), value=value, status=status)


def check_margin(
    blocks: Sequence[MomentBlock],
    limits: FloatArray,
    free: FloatArray | None,
    multipliers: Sequence[FloatArray],
) -> Margin:
    """Return what free moments attain and multipliers prove, wherever they come from."""
    at = [] if free is None else [block.at(free) for block in blocks]
    attained = min((float(np.linalg.eigvalsh(b)[0]) for b in at), default=-math.inf)
    if not all(np.isfinite(x).all() for x in multipliers):
        return Margin(free, multipliers, attained)
    positive = [nearest_semidefinite(x) for x in multipliers]
    total = float(sum(np.trace(x) for x in positive))
    pairs = zip(blocks, positive, strict=True)
    products = np.sum([np.tensordot(block.matrices, x) for block, x in pairs], axis=0)
    products /= max(total, 1.0)
    leftover = np.abs(products[1:])
    residual = float(leftover.max(initial=0.0))
    smallest = min(float(np.linalg.eigvalsh(0.5 * (x + x.T))[0]) for x in multipliers)
    # What rounding in the blocks can add to Σ⟨X_b, B_b(y)⟩ with Σ tr X_b ≤ 1.
    largest = np.concatenate([[1.0], limits])
    norms = [np.linalg.norm(block.matrices, axis=(1, 2)) @ largest for block in blocks]
    proved = 1 - min(total, 1.0) + products[0] + leftover @ limits + _ROUNDING * max(norms)
    return Margin(free, multipliers, attained, float(proved), residual, smallest)


@dataclass(frozen=True, eq=False)
class ExistenceRelaxation:
    """Outcome of the moment relaxation of one order, and the wall time of each stage."""

    #: The solution of the equations, and the blocks, none if these are inconsistent.
    moments: LinearMoments
    blocks: tuple[MomentBlock, ...]
    #: Of all blocks, or None, and of each block by itself.
    margin: Margin | None
    alone: tuple[Margin, ...]
    seconds: Mapping[str, float]

    @property
    def verdict(self) -> Literal["inconsistent", "infeasible", "feasible", "undecided"]:
        """The conclusion, exact where the linear equations contradict each other."""
        if self.margin is None:
            return "inconsistent"
        if self.margin.proved < 0:
            return "infeasible"
        return "feasible" if self.margin.attained >= 0 else "undecided"

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for tables and JSON; None stands for an infinite one."""
        moments, margin = self.moments, self.margin
        checked = ("attained", "proved", "residual", "smallest_eigenvalue")
        exact = ("order", "equations", "rank", "consistent")
        blocks = [
            {
                "charge": block.charge,
                "representation": block.shape,
                "dimension": len(standard_tableaux(block.shape)),
                "copies": block.copies,
                "size": block.size,
                "margin_alone": alone.value,
                "infeasible_alone": alone.proved < 0,
            }
            for block, alone in zip(self.blocks, self.alone, strict=True)
        ]
        return {
            "kind": "exact" if margin is None else "numerical",
            "verdict": self.verdict,
            **vars(moments.frame),  # joints, task_dimension, diagonal
            "classes": len(moments.classes),
            **{name: getattr(moments, name) for name in exact},
            "free_moments": [{"w": graph.w, "wbar": graph.wbar} for graph in moments.free],
            "largest_block": max((block.size for block in self.blocks), default=0),
            "margin": margin and margin.value,
            "certificate": margin and {n: finite_or_none(getattr(margin, n)) for n in checked},
            "blocks": blocks,
            "rank_doubt": max((block.doubt for block in self.blocks), default=0.0),
            "solver": SOLVER,
            "status": margin and margin.status,
            "seconds": dict(self.seconds),
        }


def existence_relaxation(
    order: int,
    joints: int = 7,
    *,
    diagonal: bool = False,
) -> ExistenceRelaxation:
    """Test whether isotropic Jacobians with equal columns can exist, by moments.

    `order` is 1, 2 or 3, there are n = `joints` columns, 2 to 7, and m rows, n − 1 or n,
    whichever is even; with `diagonal` their halves are arbitrary: W_ii are unknowns.
    """
    whole_number("order", order, 1, 3)
    even = whole_number("joints", joints, 2, 7) // 2 * 2
    began = time.perf_counter()
    moments = solve_moment_equations(Frame(joints, even, diagonal), order)
    solved = time.perf_counter()
    with one_blas_thread():
        blocks = tuple(moment_blocks(moments)) if moments.consistent else ()
    made = time.perf_counter()
    limits, chosen = moments.limits(), [blocks, *((block,) for block in blocks)]
    margins = [solve_margin(own, limits) for own in chosen if own]
    times = solved - began, made - solved, time.perf_counter() - made
    seconds = dict(zip(("equations", "blocks", "solver"), times, strict=True))
    margin = margins[0] if margins else None
    return ExistenceRelaxation(moments, blocks, margin, tuple(margins[1:]), seconds)
