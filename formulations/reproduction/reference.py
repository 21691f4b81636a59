"""The paper's matrices and printed numbers, by equation, as data.

A. A. Maciejewski and R. G. Roberts, "On the existence of an optimally failure tolerant 7R
manipulator Jacobian", Applied Mathematics and Computer Science 5(2), 1995.

Jacobians J are read-only arrays of shape (m, n), one column per joint. With six rows a column
is (v; ω), its linear part v above its angular part ω. V is the orthogonal matrix of right
singular vectors of J, one a column: where the rows of J are orthonormal, they are the first
rows of Vᵀ. σ_i is a singular value, fσ_m the smallest one after joint f has locked. Joints
are revolute, R: 7R has seven. All numbers are without a unit, angles but for
`PLANAR_3R_ANGLE` in radians.

Closed forms are evaluated; numbers printed with decimals are `Decimal`, so that it stays known
how many decimals were printed. What rounding can change follows from them: tolerances are not
chosen, and no number here may be changed.
"""

from decimal import Decimal
from typing import Final

import numpy as np
import numpy.typing as npt

from lockedjoint.nlp.arrays import FloatArray


def _read_only(rows: npt.ArrayLike) -> FloatArray:
    """Return numbers as an array of doubles that nobody can change by mistake."""
    matrix = np.array(rows, dtype=np.float64)
    matrix.setflags(write=False)
    return matrix


def simplex_jacobian(task_dimension: int) -> FloatArray:
    """Canonical optimally failure-tolerant Jacobian for n = m + 1, shape (m, m + 1).

    The pattern of eqs. (12), (18) and (20): columns to the corners of a regular simplex,
    rows orthonormal, upper triangular but for the last column.
    """
    m = task_dimension
    matrix = np.zeros((m, m + 1))
    for i in range(m):
        rest = m - i
        matrix[i, i] = -np.sqrt(rest / (rest + 1))
        matrix[i, i + 1 :] = np.sqrt(1 / (rest * (rest + 1)))
    return _read_only(matrix)


def harmonic_jacobian(task_dimension: int, joints: int) -> FloatArray:
    """Optimally failure-tolerant Jacobian for any n > m, shape (m, n).

    The paper names a canonical form "for a task space or manipulator of any dimension" and
    prints n = m + 1 only. This one is the harmonic frame: rows √(2/n) cos(2πki/n) and
    √(2/n) sin(2πki/n) for k = 1, 2, …, and for odd m the constant row √(1/n) besides. Rows
    are orthonormal, every column has norm² m/n; for n = m + 1 it is the simplex, turned.
    """
    m, n = task_dimension, joints
    angles = 2 * np.pi * np.arange(n) / n
    waves = [wave(k * angles) for k in range(1, m // 2 + 1) for wave in (np.cos, np.sin)]
    rows = [np.sqrt(2 / n) * wave for wave in waves]
    if m % 2:
        rows.append(np.full(n, np.sqrt(1 / n)))
    return _read_only(rows)


def planar_4r(alpha: float) -> FloatArray:
    """Eq. (16): Vᵀ of the planar 4R family, shape (4, 4); its first two rows are J.

    `alpha` is the family's parameter α, in radians.
    """
    c, s = np.cos(alpha), np.sin(alpha)
    rows = [[1, 0, c, -s], [0, 1, s, c], [1, 0, -c, s], [0, 1, -s, -c]]
    return _read_only(np.sqrt(1 / 2) * np.array(rows))


# Section 3 -----------------------------------------------------------------------------------

#: Eq. (12): planar 3R.
PLANAR_3R: Final = _read_only(
    [[-np.sqrt(2 / 3), np.sqrt(1 / 6), np.sqrt(1 / 6)], [0, -np.sqrt(1 / 2), np.sqrt(1 / 2)]]
)
#: Eq. (13): its null space.
PLANAR_3R_NULL_SPACE: Final = _read_only(np.full(3, np.sqrt(1 / 3)))
#: Angle between its columns, in degrees.
PLANAR_3R_ANGLE: Final = 120.0
#: Eq. (14): its smallest singular value after each failure, and the best of Fig. 2.
PLANAR_3R_SIGMA: Final = float(np.sqrt(1 / 3))
#: Fig. 2: the worst index of a planar 3R.
PLANAR_3R_WORST: Final = 0.0
#: Eq. (17): smallest singular value of the planar 4R family after each failure.
PLANAR_4R_SIGMA: Final = float(np.sqrt(1 / 2))
#: Angles α in [0, 2π) optimal for double failures, odd multiples of π/4 (after eq. (17)).
PLANAR_4R_DOUBLE_FAILURE: Final = _read_only(np.pi / 4 * np.array([1, 3, 5, 7]))
#: Eq. (18): Vᵀ of the positional 4R; its first three rows are J.
POSITIONAL_4R: Final = _read_only(
    [
        [-np.sqrt(3 / 4), np.sqrt(1 / 12), np.sqrt(1 / 12), np.sqrt(1 / 12)],
        [0, -np.sqrt(2 / 3), np.sqrt(1 / 6), np.sqrt(1 / 6)],
        [0, 0, -np.sqrt(1 / 2), np.sqrt(1 / 2)],
        [1 / 2, 1 / 2, 1 / 2, 1 / 2],
    ]
)
#: Eq. (19): its smallest singular value after each failure.
POSITIONAL_4R_SIGMA: Final = 0.5
#: Eq. (20): the canonical optimally failure-tolerant 6×7 matrix.
CANONICAL_6X7: Final = _read_only(
    [
        [-np.sqrt(6 / 7)] + 6 * [np.sqrt(1 / 42)],
        [0] + [-np.sqrt(5 / 6)] + 5 * [np.sqrt(1 / 30)],
        2 * [0] + [-np.sqrt(4 / 5)] + 4 * [np.sqrt(1 / 20)],
        3 * [0] + [-np.sqrt(3 / 4)] + 3 * [np.sqrt(1 / 12)],
        4 * [0] + [-np.sqrt(2 / 3)] + 2 * [np.sqrt(1 / 6)],
        5 * [0] + [-np.sqrt(1 / 2)] + [np.sqrt(1 / 2)],
    ]
)

# Section 4 -----------------------------------------------------------------------------------

#: Numbers of independent equations on the diagonal and off it (after eqs. (28) and (43)).
INDEPENDENT_NORM_EQUATIONS: Final = 4
INDEPENDENT_ORTHOGONALITY_EQUATIONS: Final = 14
#: The value fᵀf at every local minimum found for 7R (before eq. (44)).
RESIDUAL_MINIMUM_7R: Final = Decimal("0.056827")
#: Eq. (44): a nearly optimal 7R Jacobian.
NEARLY_OPTIMAL_7R: Final = _read_only(
    [
        [1, 0.4296, 0.7495, -0.5431, 0.1401, 0.3298, -0.3783],
        [0, -0.6041, 0.6479, 0.4640, -0.7889, -0.1853, -0.8047],
        [0, -0.6712, -0.1357, -0.6998, 0.5983, -0.9257, -0.4575],
        [0, 0.7678, 0.1449, 0.8391, 0.5831, -0.6882, -0.4296],
        [1, -0.1469, -0.3607, 0.3308, -0.4226, -0.7184, 0.5904],
        [0, 0.6236, -0.9214, -0.4319, -0.6938, -0.1014, -0.6832],
    ]
)
#: Eq. (45): its singular values.
SINGULAR_VALUES_7R: Final = tuple(
    Decimal(printed) for printed in ("1.5829", "1.5829", "1.5250", "1.5250", "1.4727", "1.4727")
)
#: The value σ = √(n/3) of an isotropic 7R (after eq. (45)).
ISOTROPIC_SIGMA_7R: Final = Decimal("1.5275")
#: Eq. (46): worst case after a failure, and the joint (counted from 1) that causes it.
WORST_CASE_7R: Final = Decimal("0.5196")
WORST_JOINT_7R: Final = 7
#: The theoretical optimum √(1/3), and the percent by which (46) is poorer (after eq. (46)).
OPTIMAL_SIGMA_7R: Final = Decimal("0.5774")
POORER_PERCENT_7R: Final = Decimal("10")
#: Eq. (47): an optimally failure-tolerant 8R Jacobian.
OPTIMAL_8R: Final = _read_only(
    [
        [1, 0.0223, -0.9878, 0.1851, -0.6558, 0.4505, -0.1501, -0.0246],
        [0, 0.7775, -0.1554, -0.9784, 0.3045, 0.1982, -0.8740, 0.4298],
        [0, -0.6284, -0.0002, -0.0917, 0.6908, 0.8705, -0.4622, -0.9026],
        [0, 0.4130, -0.0978, 0.5393, 0.7384, 0.8588, 0.5993, 0.7442],
        [1, -0.5796, 0.6228, 0.1791, 0.4491, -0.3626, -0.4523, 0.6108],
        [0, -0.7024, -0.7762, -0.8229, 0.5030, -0.3619, 0.6606, 0.2706],
    ]
)
#: Decimals printed in eqs. (44) and (47).
_MATRIX_DECIMALS: Final = 4
#: Eq. (48): its singular values.
SIGMA_8R: Final = float(np.sqrt(8 / 3))
#: Eq. (49): its smallest singular value after each failure.
WORST_CASE_8R: Final = float(np.sqrt(2 / 3))

#: Number of rounds in which `aligned` alternates. On matrices that differ by rounding it
#: has converged after a few; more rounds change nothing.
_ALIGNMENT_ROUNDS: Final = 100

# Rounded matrices ----------------------------------------------------------------------------

#: Largest error of one printed entry of (44) or (47): half a unit of its last decimal.
ENTRY_SLACK: Final = 0.5 * float(Decimal(1).scaleb(-_MATRIX_DECIMALS))


def singular_value_slack(matrix: FloatArray, half: float = ENTRY_SLACK) -> float:
    """Return the largest error of any singular value of a printed matrix or of its submatrices.

    Singular values move by at most ‖ΔJ‖₂ ≤ ‖ΔJ‖_F ≤ √(mn) times `half`, the error of an entry.
    """
    return float(np.sqrt(matrix.size)) * half


def product_slack(matrix: FloatArray, half: float = ENTRY_SLACK) -> float:
    """Return the largest error of any entry of JJᵀ, J a printed matrix with entries off by h.

    Entry (i, k) is Σ_f J_if J_kf over n columns: it moves by at most
    h(Σ_f |J_if| + Σ_f |J_kf|) + nh², h = `half`.
    """
    lengths = np.sum(np.abs(matrix), axis=1)
    return float(2 * half * lengths.max() + matrix.shape[1] * half**2)


def defect_slack(matrix: FloatArray, defect: float, half: float = ENTRY_SLACK) -> float:
    """Return the largest error of ½‖G‖_F², G = JJᵀ − (T/m)I, T = tr JJᵀ, of a printed matrix J.

    `defect` is ½‖G‖_F² itself, so that ‖G‖_F = √(2·defect). With
    ‖ΔG‖_F ≤ 2σ₁‖ΔJ‖_F + ‖ΔJ‖_F² it moves by at most ‖G‖_F‖ΔG‖_F + ½‖ΔG‖_F².
    """
    change = singular_value_slack(matrix, half)
    moved = 2 * float(np.linalg.norm(matrix, 2)) * change + change**2
    return float(np.sqrt(2 * defect) * moved + 0.5 * moved**2)


def nearest_unit_revolute(jacobian: FloatArray) -> FloatArray:
    """Return the nearest J whose columns have |v| = |ω| = 1 and v·ω = 0, shape (6, n).

    Column by column: the 3×2 matrix (v ω) = USVᵀ, and UVᵀ is the nearest one with orthonormal
    columns (polar decomposition).
    """
    pairs = np.stack([jacobian[:3].T, jacobian[3:].T], axis=2)  # shape (n, 3, 2)
    left, _, right = np.linalg.svd(pairs, full_matrices=False)
    nearest = left @ right
    return np.vstack([nearest[:, :, 0].T, nearest[:, :, 1].T])


def column_error(jacobian: FloatArray) -> float:
    """Return the largest of ||v|² − 1|, ||ω|² − 1| and |v·ω| over the columns, shape (6, n)."""
    velocity, axis = jacobian[:3], jacobian[3:]
    squares = np.sum([velocity**2, axis**2, velocity * axis], axis=1)
    return float(np.max(np.abs(squares - [[1], [1], [0]])))


def aligned(jacobian: FloatArray, target: FloatArray) -> FloatArray:
    """Return J in the frame and phase in which it is nearest to `target`; both of shape (6, n).

    With z = v + iω a rotation R of the frame takes z to Rz, and a phase θ takes it to e^{iθ}z:
    singular values of J do not change. Rotation and phase are each optimal given the other;
    alternating them converges from matrices that differ little.
    """
    for _ in range(_ALIGNMENT_ROUNDS):
        # The rotation that is best in the least squares (Kabsch).
        correlation = target[:3] @ jacobian[:3].T + target[3:] @ jacobian[3:].T
        left, _, right = np.linalg.svd(correlation)
        sign = np.sign(np.linalg.det(left @ right))
        frame = left @ np.diag([1.0, 1.0, sign]) @ right
        z = frame @ jacobian[:3] + 1j * (frame @ jacobian[3:])
        # The phase that makes the inner product of both real and positive.
        z = z * np.exp(1j * np.angle(np.vdot(z, target[:3] + 1j * target[3:])))
        jacobian = np.vstack([z.real, z.imag])
    return jacobian
