"""The moment matrix as small blocks that depend affinely on the free moments.

The rows that the equations send to zero are taken out first: on the others, in an orthonormal
basis, the moment matrix of a true solution is positive semidefinite and may be definite.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from formulations.existence.equations import Frame
from formulations.existence.relaxation.equation_rows import equation_rows
from formulations.existence.relaxation.moment_matrix import projected_moment_matrices
from formulations.existence.relaxation.moment_table import MomentTable
from formulations.existence.relaxation.row_sectors import RowSector
from formulations.existence.relaxation.symmetry_adapted_rows import adapted_rows
from formulations.existence.relaxation.tableaux import Shape

Matrix: TypeAlias = NDArray[np.float64]

# Singular values of the equations' rows below this are rounding.
_RANK_TOLERANCE = 1e-8


@dataclass(frozen=True, eq=False)
class RowBasis:
    """Orthonormal rows of one charge and one representation, equations taken out.

    Parameters
    ----------
    charge
        Number of factors W minus number of factors conj(W).
    shape
        The partition that names the representation of the symmetric group.
    copies
        How often the representation occurs among the monomials.
    rows
        The basis, shape (rows of the sector, block size).
    doubt
        Largest singular value taken for zero over the smallest taken for nonzero; far below 1
        if the number of rows is no guess.
    """

    charge: int
    shape: Shape
    copies: int
    rows: Matrix
    doubt: float


@dataclass(frozen=True, eq=False)
class MomentBlock:
    """One block of the moment matrix, B_0 + Σ_k y_k B_k for free moments y_k.

    Parameters
    ----------
    charge, shape
        The charge of its rows and the partition of their representation.
    copies
        Number of rows before the equations were taken out.
    matrices
        B_0, B_1, …: shape (1 + free moments, size, size).
    """

    charge: int
    shape: Shape
    copies: int
    matrices: Matrix

    @property
    def size(self) -> int:
        """Number of rows."""
        return int(self.matrices.shape[1])

    def at(self, free: NDArray[np.float64]) -> Matrix:
        """Return the block at given free moments."""
        return np.tensordot(np.concatenate([[1.0], free]), self.matrices, axes=1)


def row_bases(sector: RowSector, frame: Frame) -> list[RowBasis]:
    """Return the rows of one charge, per representation, without those that are zero.

    Parameters
    ----------
    sector
        The rows of one charge.
    frame
        The Jacobians whose equations are taken out.
    """
    bases = adapted_rows(sector)
    together = np.hstack(list(bases.values()))
    vanishing = [
        np.asarray(values) @ together[numbers]
        for numbers, values in equation_rows(sector, frame)
    ]
    stacked = np.array(vanishing).reshape(-1, together.shape[1])
    ends = np.cumsum([basis.shape[1] for basis in bases.values()])[:-1]
    parts = np.split(stacked, ends, axis=1)
    return [
        _without(sector.charge, shape, basis, part)
        for (shape, basis), part in zip(bases.items(), parts, strict=True)
    ]


def moment_blocks(
    bases: list[RowBasis], sector: RowSector, table: MomentTable, moments: Matrix
) -> list[MomentBlock]:
    """Return the blocks of one charge.

    Parameters
    ----------
    bases
        The rows, per representation.
    sector
        The monomials that the rows are made of.
    table
        The class of every monomial.
    moments
        Class moments, a column for the constant part and for each free moment.
    """
    kept = [basis for basis in bases if basis.rows.shape[1]]
    together = np.hstack([basis.rows for basis in kept])
    projected = projected_moment_matrices(sector, table, moments, together)
    ends = np.cumsum([0] + [basis.rows.shape[1] for basis in kept])
    blocks = []
    for basis, start, end in zip(kept, ends, ends[1:], strict=False):
        matrices = projected[:, start:end, start:end]
        symmetric = 0.5 * (matrices + matrices.transpose(0, 2, 1))
        blocks.append(MomentBlock(basis.charge, basis.shape, basis.copies, symmetric))
    return blocks


def _without(charge: int, shape: Shape, basis: Matrix, vanishing: Matrix) -> RowBasis:
    """Return the part of a basis that is orthogonal to vanishing rows given in it."""
    copies = basis.shape[1]
    padded = np.vstack([vanishing, np.zeros((copies, copies))])
    _, singular, vectors = np.linalg.svd(padded, full_matrices=False)
    rank = int((singular > _RANK_TOLERANCE).sum())
    dropped = float(singular[rank:].max(initial=0.0))
    kept = float(singular[:rank].min(initial=np.inf))
    return RowBasis(charge, shape, copies, basis @ vectors[rank:].T, dropped / kept)
