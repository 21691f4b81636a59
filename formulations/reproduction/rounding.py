"""What rounding of printed numbers can change, so that tolerances are derived, not chosen."""

from __future__ import annotations

from decimal import ROUND_HALF_UP, Decimal

import numpy as np

from nlp.arrays import FloatArray


def rounded(value: float, like: Decimal) -> Decimal:
    """Return `value` with as many decimals as `like`, halves away from zero."""
    if not np.isfinite(value):
        return Decimal("NaN")
    return Decimal(value).quantize(like, rounding=ROUND_HALF_UP)


def rounded_twice(value: float, like: Decimal) -> Decimal:
    """Return `value` rounded to one decimal more than `like`, and then to as many."""
    finer = rounded(value, like.scaleb(-1))
    return finer.quantize(like, rounding=ROUND_HALF_UP)


def entry_slack(decimals: int) -> float:
    """Largest error of one printed entry: half a unit of its last decimal."""
    return 0.5 * float(Decimal(1).scaleb(-decimals))


def singular_value_slack(matrix: FloatArray, decimals: int) -> float:
    """Largest error of any singular value of a printed matrix, or of its submatrices.

    Singular values move by at most ‖ΔJ‖₂ ≤ ‖ΔJ‖_F ≤ √(mn) times the error of an entry.
    """
    return float(np.sqrt(matrix.size)) * entry_slack(decimals)


def product_slack(matrix: FloatArray, decimals: int) -> float:
    """Largest error of any entry of JJᵀ of a printed matrix J with rows of m entries each."""
    half = entry_slack(decimals)
    lengths = np.sum(np.abs(matrix), axis=1)
    return float(2 * half * lengths.max() + matrix.shape[1] * half**2)


def defect_slack(matrix: FloatArray, defect: float, decimals: int) -> float:
    """Largest error of ½‖G‖_F², G = JJᵀ − (T/m)I, of a printed matrix J.

    With ‖ΔG‖_F ≤ 2σ₁‖ΔJ‖_F + ‖ΔJ‖_F² it moves by at most ‖G‖_F‖ΔG‖_F + ½‖ΔG‖_F².
    """
    change = singular_value_slack(matrix, decimals)
    moved = 2 * float(np.linalg.norm(matrix, 2)) * change + change**2
    return float(np.sqrt(2 * defect) * moved + 0.5 * moved**2)
