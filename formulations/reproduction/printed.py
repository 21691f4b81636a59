"""Printed, rounded numbers: what rounding can change, and exact Jacobians next to printed ones.

Tolerances are derived from the number of printed decimals, not chosen.
"""

from decimal import ROUND_HALF_UP, Decimal

import numpy as np

from formulations.reproduction.reference import MATRIX_DECIMALS
from nlp.arrays import FloatArray

# Largest error of one printed entry of (44) or (47): half a unit of its last decimal.
ENTRY_SLACK = 0.5 * float(Decimal(1).scaleb(-MATRIX_DECIMALS))


def rounded(value: float, like: Decimal) -> Decimal:
    """Return `value` with as many decimals as `like`, halves away from zero."""
    if not np.isfinite(value):
        return Decimal("NaN")
    return Decimal(value).quantize(like, rounding=ROUND_HALF_UP)


def rounded_twice(value: float, like: Decimal) -> Decimal:
    """Return `value` rounded to one decimal more than `like`, and then to as many."""
    finer = rounded(value, like.scaleb(-1))
    return finer.quantize(like, rounding=ROUND_HALF_UP)


def singular_value_slack(matrix: FloatArray, half: float = ENTRY_SLACK) -> float:
    """Largest error of any singular value of a printed matrix, or of its submatrices.

    Singular values move by at most ‖ΔJ‖₂ ≤ ‖ΔJ‖_F ≤ √(mn) times `half`, the error of an entry.
    """
    return float(np.sqrt(matrix.size)) * half


def product_slack(matrix: FloatArray, half: float = ENTRY_SLACK) -> float:
    """Largest error of any entry of JJᵀ of a printed matrix J, whose own error is `half`."""
    lengths = np.sum(np.abs(matrix), axis=1)
    return float(2 * half * lengths.max() + matrix.shape[1] * half**2)


def defect_slack(matrix: FloatArray, defect: float, half: float = ENTRY_SLACK) -> float:
    """Largest error of ½‖G‖_F², G = JJᵀ − (T/m)I, of a printed matrix J.

    With ‖ΔG‖_F ≤ 2σ₁‖ΔJ‖_F + ‖ΔJ‖_F² it moves by at most ‖G‖_F‖ΔG‖_F + ½‖ΔG‖_F².
    """
    change = singular_value_slack(matrix, half)
    moved = 2 * float(np.linalg.norm(matrix, 2)) * change + change**2
    return float(np.sqrt(2 * defect) * moved + 0.5 * moved**2)


def nearest_unit_revolute(jacobian: FloatArray) -> FloatArray:
    """Return the nearest J whose columns have |v| = |ω| = 1 and v·ω = 0, shape (6, n)."""
    pairs = np.stack([jacobian[:3].T, jacobian[3:].T], axis=2)
    left, _, right = np.linalg.svd(pairs, full_matrices=False)
    nearest = left @ right
    return np.vstack([nearest[:, :, 0].T, nearest[:, :, 1].T])


def column_error(jacobian: FloatArray) -> float:
    """Largest of ||v|² − 1|, ||ω|² − 1| and |v·ω| over the columns."""
    velocity, axis = jacobian[:3], jacobian[3:]
    products = [
        np.sum(velocity**2, axis=0) - 1,
        np.sum(axis**2, axis=0) - 1,
        np.sum(velocity * axis, axis=0),
    ]
    return float(np.max(np.abs(products)))


def aligned(jacobian: FloatArray, target: FloatArray) -> FloatArray:
    """Return J in the frame and phase in which it is nearest to `target`.

    Rotation and phase are each optimal given the other; alternating them converges from
    matrices that differ little.
    """
    for _ in range(100):
        correlation = target[:3] @ jacobian[:3].T + target[3:] @ jacobian[3:].T
        left, _, right = np.linalg.svd(correlation)
        sign = np.sign(np.linalg.det(left @ right))
        frame = left @ np.diag([1.0, 1.0, sign]) @ right
        z = frame @ jacobian[:3] + 1j * (frame @ jacobian[3:])
        z = z * np.exp(1j * np.angle(np.vdot(z, target[:3] + 1j * target[3:])))
        jacobian = np.vstack([z.real, z.imag])
    return jacobian
