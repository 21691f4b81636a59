"""Moment matrices seen through a few combinations of their rows, without storing them."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from formulations.bounds.existence_moments.moment_table import MomentTable
from formulations.bounds.existence_moments.row_sectors import RowSector

Matrix: TypeAlias = NDArray[np.float64]


def projected_moment_matrices(
    sector: RowSector, table: MomentTable, moments: Matrix, basis: Matrix
) -> Matrix:
    """Return basisᵀ·M_k·basis for moment matrices M_k given by their class moments.

    Parameters
    ----------
    sector
        The rows of one charge.
    table
        The class of every monomial.
    moments
        Class moments, one column per matrix: shape (classes, K).
    basis
        Columns in the rows of this sector: shape (length, r).

    Returns
    -------
    ndarray
        Shape (K, r, r).
    """
    result = np.zeros((moments.shape[1], basis.shape[1], basis.shape[1]))
    for p, q in sector.types:
        left = basis[sector.offset(p, q) :][: sector.size(p, q)]
        left = left.reshape(-1, len(sector.multisets.members[q]), basis.shape[1])
        for r, s in sector.types:
            right = basis[sector.offset(r, s) :][: sector.size(r, s)]
            # Row conj(u), column v: the factors W of v meet the factors conj(W) of u.
            w = sector.multisets.unions(q, r)
            wbar = sector.multisets.unions(p, s)
            for a, part in enumerate(left):
                found = table.tables[q + r][w[:, :, None], wbar[a][None, None, :]]
                found = found.reshape(len(part), -1)
                for k, values in enumerate(moments.T):
                    result[k] += part.T @ (values[found] @ right)
    return result
