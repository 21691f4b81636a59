"""The moments of an averaged solution: what the equations determine, and the blocks they form.

Every equation times every monomial, averaged, is a linear equation between the moments of
classes of graphs. Solved over the rationals, so that a rank is exact, they give each moment as
a combination of 1 and a few free moments.

The moment matrix has the moment of conj(u)·v in row u and column v. It vanishes, by averaging
over a common phase of W, unless u and v have the same *charge*, the number of W minus that of
conj(W). In the bases of `tableaux` it falls into small blocks, affine in the free moments. They
vanish on multiples of the equations; on the rest the moments of a solution are semidefinite.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import combinations_with_replacement, permutations
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from formulations.existence.derive import rewriting
from formulations.existence.equations import ONE, Frame, Monomial, classes
from formulations.existence.tableaux import Shape, adapted_bases
from nlp.arrays import FloatArray

IntArray: TypeAlias = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class EdgeMultisets:
    """The N multisets of at most `order` edges on some joints, numbered by ascending keys.

    A monomial is a pair (w, wbar) of them. The *key* of a multiset has the multiplicities of
    its edges as digits, so that the key of a union is the sum of the keys.
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
        """The key of every edge (i, j): shape (joints, joints), symmetric."""
        keys = np.zeros((self.joints, self.joints), dtype=np.int64)
        keys[self.edges] = (self.order + 1) ** np.arange(len(self.edges[0]))
        return keys | keys.T

    @cached_property
    def keys(self) -> IntArray:
        """The keys of all multisets, ascending: shape (N,)."""
        digits = self.edge_keys[self.edges]
        choices = (
            np.array(list(combinations_with_replacement(digits, size)), dtype=np.int64)
            for size in range(self.order + 1)
        )
        return np.sort(np.concatenate([choice.sum(axis=1) for choice in choices]))

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
        more, degree = sizes[:, None] - sizes, sizes[:, None] + sizes
        w, wbar = np.nonzero((more == charge) & (degree <= self.order))
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
        """Return the class of every monomial with as many W as conj(W), else −1: (N, N).

        `classes` has one monomial of each class; it is relabelled in every way.
        """
        table = np.full((len(self.keys), len(self.keys)), -1)
        names = np.array(list(permutations(range(self.joints))))
        for place, graph in enumerate(classes):
            w, wbar = (
                self.number(sum(self.edge_keys[names[:, i], names[:, j]] for i, j in pairs))
                for pairs in (graph.w, graph.wbar)
            )
            table[w, wbar] = table[wbar, w] = place
        return table


# Singular values and entries of blocks below these are rounding.
_RANK_TOLERANCE, _ZERO = 1e-8, 1e-12
# A moment matrix has up to 24 million entries: it is not stored, but used in pieces.
_ENTRIES_AT_ONCE = 2_000_000


@dataclass(frozen=True, eq=False)
class LinearMoments:
    """Exact solution of the moment equations of one order."""

    #: The Jacobians in question, and the largest number of edges of each colour.
    frame: Frame
    order: int
    #: One monomial per class; the first is 1.
    classes: tuple[Monomial, ...]
    #: Number of distinct averaged equations, and their rank in the moments other than E[1].
    equations: int
    rank: int
    #: Whether any moments satisfy the equations, and the classes whose moments are then free.
    consistent: bool
    free: tuple[Monomial, ...]
    #: The moment of each class, a row, as a combination of 1 and the free ones, the columns.
    coefficients: FloatArray

    def limits(self) -> FloatArray:
        """Return limits of |y_k|: Σ_j |W_ij|² = 2 P_ii is the tight-frame equation (i, i)."""
        square = 2 * float(self.frame.projector(0, 0))
        return np.array([square ** len(graph.w) for graph in self.free])


def solve_moment_equations(frame: Frame, order: int) -> LinearMoments:
    """Solve the moment equations of a frame exactly, up to `order` edges of each colour."""
    graphs = classes(frame.joints, order, loops=frame.diagonal)
    equations = rewriting(frame, order)
    determined = equations.rules.keys() | equations.relations.keys()
    distinct = {frozenset(terms.items()) for terms in equations.averaged.values()}
    known = [graph for graph in graphs if graph not in determined or graph == ONE]
    values = [equations.remainder({graph: Fraction(1)}) for graph in graphs]
    coefficients = np.array([[float(v.get(k, 0)) for k in known] for v in values])
    free = tuple(known[1:]) if equations.consistent else ()
    counts = len(distinct), len(determined - {ONE})
    return LinearMoments(
        frame, order, graphs, *counts, equations.consistent, free, coefficients
    )


@dataclass(frozen=True, eq=False)
class MomentBlock:
    """One block of the moment matrix, B_0 + Σ_k y_k B_k for free moments y_k."""

    #: The charge of its rows, and the partition that names their representation.
    charge: int
    shape: Shape
    #: How often the representation occurs: number of rows before zeros were taken out.
    copies: int
    #: B_0, B_1, …: shape (1 + free moments, size, size).
    matrices: FloatArray
    #: Largest singular value taken for zero over the smallest taken for nonzero; far below 1
    #: if the size is certain.
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
        end = 0
        for (shape,), own in bases.items():
            start, end = end, end + own.shape[1]
            blocks.append(_reduced(charge, shape, matrices[:, start:end, start:end]))
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
