"""Moment matrices seen through a few combinations of their rows, without storing them."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from formulations.existence.relaxation.moment_table import MomentTable
from formulations.existence.relaxation.row_sectors import RowSector

Matrix: TypeAlias = NDArray[np.float64]

# Pieces large enough to keep the number of matrix products small, and memory below 50 MB.
_ENTRIES_AT_ONCE = 2_000_000


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
        for r, s in sector.types:
            right = basis[sector.offset(r, s) :][: sector.size(r, s)]
            # Row conj(u), column v: the factors W of v meet the factors conj(W) of u.
            w = sector.multisets.unions(q, r)
            wbar = sector.multisets.unions(p, s)
            step = max(1, _ENTRIES_AT_ONCE // len(right))
            for start in range(0, len(left), step):
                part = left[start : start + step]
                u_w, u_wbar = np.divmod(np.arange(start, start + len(part)), len(w))
                found = table.tables[q + r][w[u_wbar][:, :, None], wbar[u_w][:, None, :]]
                found = found.reshape(len(part), -1)
                for k, values in enumerate(moments.T):
                    result[k] += part.T @ (values[found] @ right)
    return result
