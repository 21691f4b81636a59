"""Inverse kinematics of many configurations at once: damped least squares within limits.

The iteration is one, `_descend`. `damped_least_squares` leads configurations from anywhere to
targets of any kind. `solve_ik` is for those that begin near a pose, along a path: a step keeps
its direction, joints that reach a limit stay there, and the others may be centred.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from formulations.kinematics.forward import Kinematics
from formulations.kinematics.link_chain import BoolArray, IntArray
from nlp.arrays import FloatArray

#: What is missing to targets, shape (m, B), and the Jacobians, (m, n, B): of B of the targets,
#: by number, at their configurations, shape (n, B).
Residual: TypeAlias = Callable[[IntArray, FloatArray], tuple[FloatArray, FloatArray]]
# Configurations after a move, from which of them they are, where they were, and the move.
_Limited: TypeAlias = Callable[[IntArray, FloatArray, FloatArray], FloatArray]
# Damping, as a share of the squared error; and the most that a joint moves in one step.
_SHARE, _LONGEST = 0.01, 0.5
# Of `solve_ik`: entries of what is missing to a pose, in metres and radians, that count as
# none; most iterations at a sample; the most that a joint moves in one; the least damping.
TOLERANCE, _ITERATIONS, _STEP, _LEAST = 1e-5, 6, 0.3, 1e-10


def damped_least_squares(
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
    """Return configurations near a start, shape (n, B), and which of them reach their targets.

    Steps Jᵀ(JJᵀ + λ)⁻¹e, of which each joint moves at most 0.5, then stays within its limits.

    Parameters
    ----------
    residual
        What is missing, and the Jacobian.
    start
        Shape (n, B).
    lower, upper
        Limits, shape (n, 1) or (n, B); infinite where there are none, equal for locked joints.
    reached
        Norm of what may be missing, e.
    damping
        λ is this and 1 % of |e|².
    steps
        At most so many.
    largest
        |e|² counts as no more than this in λ.
    """
    q = np.clip(start, lower, upper)
    lower, upper = np.broadcast_to(lower, q.shape), np.broadcast_to(upper, q.shape)

    def limited(which: IntArray, here: FloatArray, move: FloatArray) -> FloatArray:
        move = np.clip(move, -_LONGEST, _LONGEST)
        return np.asarray(np.clip(here + move, lower[:, which], upper[:, which]))

    def near(missing: FloatArray) -> BoolArray:
        return np.asarray(np.sum(missing**2, axis=0) < reached**2)

    return _descend(residual, q, upper > lower, limited, near, steps, damping, largest)


def solve_ik(
    kinematics: Kinematics,
    q: FloatArray,
    position: FloatArray,
    rotation: FloatArray,
    free: BoolArray | None = None,
    iterations: int = _ITERATIONS,
    centre: float = 0.0,
) -> tuple[FloatArray, BoolArray]:
    """Move configurations to a pose by damped least squares, within the limits.

    Parameters
    ----------
    kinematics
        The chain, and the directions that count.
    q
        Where they start, shape (n, B).
    position, rotation
        The pose, see `Kinematics.error`.
    free
        Joints that may move, shape (n, B) or (n, 1); all if left out.
    iterations
        Most iterations.
    centre
        How far the first step goes towards the middle of the joints' ranges along the
        self-motion, as a share of the way.

    Returns
    -------
    numpy.ndarray
        Configurations, shape (n, B).
    numpy.ndarray
        Which of them reached the pose, shape (B,).
    """
    q = q.copy()
    movable = np.broadcast_to(True if free is None else free, q.shape).copy()

    def residual(which: IntArray, here: FloatArray) -> tuple[FloatArray, FloatArray]:
        origin, orientation, matrix = kinematics.forward(here)
        target = _some(position, which), _some(rotation, which)
        return kinematics.error(origin, orientation, *target), matrix

    def limited(which: IntArray, here: FloatArray, move: FloatArray) -> FloatArray:
        move = move * np.minimum(1, _STEP / np.maximum(np.max(np.abs(move), axis=0), 1e-12))
        inside = np.clip(here + move, kinematics.lower, kinematics.upper)
        # A joint that is pushed against its limit stays there while the others go on.
        movable[:, which] &= np.abs(here + move - inside) < 1e-9
        return np.asarray(inside)

    def near(missing: FloatArray) -> BoolArray:
        return np.asarray(np.max(np.abs(missing), axis=0) < TOLERANCE)

    if centre:
        every = np.arange(q.shape[1])
        missing, matrix = residual(every, q)
        damping = _LEAST + _SHARE * np.sum(missing**2, axis=0)
        drift = centre * (kinematics.middle - q) * kinematics.ranged * movable
        matrix = matrix * movable
        missing = missing - np.einsum("inb,nb->ib", matrix, drift)
        q = limited(every, q, drift + _least_squares(matrix, missing, damping))
        iterations -= 1
    return _descend(residual, q, movable, limited, near, iterations + 1, _LEAST)


def _descend(
    residual: Residual,
    q: FloatArray,
    movable: BoolArray,
    limited: _Limited,
    near: Callable[[FloatArray], BoolArray],
    evaluations: int,
    damping: float,
    largest: float = np.inf,
) -> tuple[FloatArray, BoolArray]:
    """Move configurations (n, B) until what is missing is near none; say which of them are."""
    done, active = np.zeros(q.shape[1], dtype=bool), np.arange(q.shape[1])
    for k in range(evaluations):
        missing, matrix = residual(active, q[:, active])
        there = near(missing)
        done[active[there]] = True
        active, missing, matrix = active[~there], missing[:, ~there], matrix[:, :, ~there]
        if not active.size or k == evaluations - 1:
            break
        share = damping + _SHARE * np.minimum(np.sum(missing**2, axis=0), largest)
        move = _least_squares(matrix * movable[:, active], missing, share)
        q[:, active] = limited(active, q[:, active], move)
    return q, done


def _some(pose: FloatArray, which: IntArray) -> FloatArray:
    return pose if pose.shape[-1] == 1 else pose[..., which]


def _least_squares(matrix: FloatArray, missing: FloatArray, damping: FloatArray) -> FloatArray:
    """Return Jᵀ(JJᵀ + λ)⁻¹e for each of many, shape (n, B): Cholesky, entry by entry."""
    rows = len(matrix)
    factor: list[list[FloatArray]] = []
    right: list[FloatArray] = []
    for i in range(rows):
        line: list[FloatArray] = []
        for j in range(i + 1):
            entry = np.einsum("nb,nb->b", matrix[i], matrix[j])
            if i == j:
                entry += damping
            for k in range(j):
                entry -= line[k] * (factor[j][k] if j < i else line[k])
            line.append(np.sqrt(np.maximum(entry, 1e-14)) if i == j else entry / factor[j][j])
        factor.append(line)
        value = missing[i].copy()
        for k in range(i):
            value -= line[k] * right[k]
        right.append(value / line[i])
    for i in reversed(range(rows)):
        for k in range(i + 1, rows):
            right[i] = right[i] - factor[k][i] * right[k]
        right[i] = right[i] / factor[i][i]
    return np.asarray(np.einsum("inb,ib->nb", matrix, np.stack(right)))
