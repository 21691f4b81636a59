"""From a printed, rounded Jacobian to exact ones: unit revolute columns, and alignment."""

from __future__ import annotations

import numpy as np

from nlp.arrays import FloatArray


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
        jacobian = _in_best_phase(_in_best_frame(jacobian, target), target)
    return jacobian


def _in_best_frame(jacobian: FloatArray, target: FloatArray) -> FloatArray:
    correlation = target[:3] @ jacobian[:3].T + target[3:] @ jacobian[3:].T
    left, _, right = np.linalg.svd(correlation)
    sign = np.sign(np.linalg.det(left @ right))
    frame = left @ np.diag([1.0, 1.0, sign]) @ right
    return np.vstack([frame @ jacobian[:3], frame @ jacobian[3:]])


def _in_best_phase(jacobian: FloatArray, target: FloatArray) -> FloatArray:
    z, w = (matrix[:3] + 1j * matrix[3:] for matrix in (jacobian, target))
    z = z * np.exp(1j * np.angle(np.vdot(z, w)))
    return np.vstack([z.real, z.imag])
