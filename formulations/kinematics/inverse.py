"""Inverse kinematics of many configurations at once: damped least squares within limits."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from nlp.arrays import FloatArray

BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]
#: What is missing to the targets, shape (k, m), and the Jacobians, (k, m, n): of some of the
#: targets, by number, at their configurations, shape (k, n).
Residual: TypeAlias = Callable[[IntArray, FloatArray], tuple[FloatArray, FloatArray]]
# Damping, as a share of the squared error; and the most that a joint moves in one step.
_SHARE, _LONGEST = 0.01, 0.5


def solve_ik(
    residual: Residual,
    start: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    *,
    reached: float,
    damping: float,
    steps: int,
    largest: float = np.inf,
) -> tuple[FloatArray, BoolArray]:
    """Return configurations near a start, shape (k, n), and which of them reach their targets.

    Steps Jᵀ(JJᵀ + λ)⁻¹e, of which each joint moves at most 0.5, then stays within its limits.

    Parameters
    ----------
    residual
        What is missing, and the Jacobian.
    start
        Shape (k, n).
    lower, upper
        Limits, shape (n,) or (k, n); infinite where there are none, equal for locked joints.
    reached
        Norm of what may be missing, e.
    damping
        λ is this and 1 % of |e|².
    steps
        At most so many.
    largest
        |e|² counts as no more than this in λ.
    """
    q, found = np.clip(start, lower, upper), np.zeros(len(start), dtype=bool)
    lower, upper = np.broadcast_to(lower, q.shape), np.broadcast_to(upper, q.shape)
    active = np.arange(len(start))
    for _ in range(steps):
        missing, matrix = residual(active, q[active])
        size = np.sum(missing**2, axis=1)
        found[active] = size < reached**2
        away = ~found[active]
        active, missing, matrix, size = active[away], missing[away], matrix[away], size[away]
        if not len(active):
            break
        low, high = lower[active], upper[active]
        matrix = matrix * (high > low)[:, None, :]
        square = matrix @ np.swapaxes(matrix, 1, 2)
        rows = np.arange(square.shape[1])
        square[:, rows, rows] += (damping + _SHARE * np.minimum(size, largest))[:, None]
        pushed = np.linalg.solve(square, missing[:, :, None])
        step = (np.swapaxes(matrix, 1, 2) @ pushed)[:, :, 0]
        q[active] = np.clip(q[active] + np.clip(step, -_LONGEST, _LONGEST), low, high)
    return q, found
