"""Promising starts: of many random configurations, improved together, the best.

A robot has many poor optima, and near-singular postures from which max-min hardly moves. Each
start is therefore the winner of a tournament: configurations are drawn, the better ones climb
along the gradient of their worst case, the better of these climb on, with shorter steps.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lockedjoint.kinematics.geometry import IntArray
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray

# A start is the best of so many random configurations, after some steps.
_DRAWS_PER_START = 192
# Each round keeps so many points, takes so many steps, and its last step has so many radians.
# The best point of the last round is the start: more rounds gain less than what they cost.
_ROUNDS = ((64, 5, 0.25), (20, 5, 0.1), (6, 10, 0.02))
# The first step of the first round is this long.
_FIRST_STEP_RAD = 0.5
# Slides are as long as turns: a prismatic joint has two metres where a revolute one has a turn.
_METRES_PER_RADIAN = 1 / np.pi
# So many starts are looked for together.
_STARTS_AT_ONCE = 64


def promising_starts(arm: RobotArm, generators: Sequence[np.random.Generator]) -> FloatArray:
    """Return one start per generator, shape (N, n)."""
    parts = [
        _winners(arm, generators[first : first + _STARTS_AT_ONCE])
        for first in range(0, len(generators), _STARTS_AT_ONCE)
    ]
    return np.concatenate(parts)


def _winners(arm: RobotArm, generators: Sequence[np.random.Generator]) -> FloatArray:
    draws = [arm.samples(rng, _DRAWS_PER_START) for rng in generators]
    points = np.concatenate(draws)
    values, slopes = arm.worst_case(points)
    longest = _FIRST_STEP_RAD
    for keep, steps, shortest in _ROUNDS:
        kept = _best(values, len(generators), keep)
        lengths = np.geomspace(longest, shortest, steps)
        points, values, slopes = _climb(arm, points[kept], values[kept], slopes[kept], lengths)
        longest = shortest
    return np.asarray(points[_best(values, len(generators), 1)])


def _best(values: FloatArray, starts: int, keep: int) -> IntArray:
    """Return which points to keep of each start: so many with the largest values."""
    groups = values.reshape(starts, -1)
    best = np.argsort(-groups, axis=1, kind="stable")[:, :keep]
    return np.asarray((best + np.arange(starts)[:, None] * groups.shape[1]).ravel())


def _climb(
    arm: RobotArm,
    points: FloatArray,
    values: FloatArray,
    slopes: FloatArray,
    lengths: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Step along the gradient within the limits; return the best points of each way.

    Where failures tie, a step may lead down, as in any subgradient method: the way goes on.
    """
    lower, upper = arm.bounds
    units = np.where(arm.chain.prismatic, _METRES_PER_RADIAN, 1.0)
    best = [points, values, slopes]
    for length in lengths:
        stopped = ((points <= lower) & (slopes < 0)) | ((points >= upper) & (slopes > 0))
        uphill = np.where(stopped, 0.0, slopes * units)
        size = np.linalg.norm(uphill, axis=1, keepdims=True)
        step = length * units * uphill / np.maximum(size, np.finfo(float).tiny)
        points = np.clip(points + step, lower, upper)
        values, slopes = arm.worst_case(points)
        better = values > best[1]
        for kept, new in zip(best, (points, values, slopes), strict=True):
            kept[better] = new[better]
    return best[0], best[1], best[2]
