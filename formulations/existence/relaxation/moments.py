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
from functools import partial
from typing import Any

import numpy as np

from formulations.existence.equations import Frame
from formulations.existence.graphs import ONE, Monomial, classes
from formulations.existence.relaxation.monomials import EdgeMultisets
from formulations.existence.relaxation.tableaux import Shape, adapted_bases
from formulations.existence.rewriting import rewriting
from nlp.arrays import FloatArray

# Singular values and entries of blocks below these are rounding.
_RANK_TOLERANCE, _ZERO = 1e-8, 1e-12
# A moment matrix has up to 24 million entries: it is not stored, but used in pieces.
_ENTRIES_AT_ONCE = 2_000_000


@dataclass(frozen=True, eq=False)
class LinearMoments:
    """Exact solution of the moment equations of one order.

    Parameters
    ----------
    frame, order
        The Jacobians in question, and the largest number of edges of each colour.
    classes
        One monomial per class; the first is 1.
    equations, rank
        Number of distinct averaged equations, and their rank in the moments other than E[1].
    consistent, free
        Whether any moments satisfy the equations, and the classes whose moments are then free.
    coefficients
        The moment of each class, a row, as a combination of 1 and the free ones, the columns.
    """

    frame: Frame
    order: int
    classes: tuple[Monomial, ...]
    equations: int
    rank: int
    consistent: bool
    free: tuple[Monomial, ...]
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
    """One block of the moment matrix, B_0 + Σ_k y_k B_k for free moments y_k.

    Parameters
    ----------
    charge, shape
        The charge of its rows, and the partition that names their representation.
    copies
        How often the representation occurs: number of rows before zeros were taken out.
    matrices
        B_0, B_1, …: shape (1 + free moments, size, size).
    doubt
        Largest singular value taken for zero over the smallest taken for nonzero; far below 1
        if the size is certain.
    """

    charge: int
    shape: Shape
    copies: int
    matrices: FloatArray
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
        bases = adapted_bases(multisets.joints, partial(multisets.images, rows))
        basis = np.hstack(list(bases.values()))
        matrices = np.zeros((moments.coefficients.shape[1], basis.shape[1], basis.shape[1]))
        for part in np.array_split(np.arange(len(w)), 1 + len(w) ** 2 // _ENTRIES_AT_ONCE):
            # In conj(u)·v the factors W of v meet the factors conj(W) of u.
            entries = table[unions[wbar[part, None], w], unions[w[part, None], wbar]]
            for matrix, values in zip(matrices, moments.coefficients.T, strict=True):
                matrix += basis[part].T @ (values[entries] @ basis)
        end = 0
        for shape, own in bases.items():
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
