"""Promising starts: the best of many random configurations, after some steps uphill.

A robot has many poor optima, and near-singular postures from which max-min hardly moves. Each
start is therefore the winner of a tournament: configurations are drawn, the better ones climb
along the gradient of their worst case σ (eq. 5, see `RobotArm.worst_case`), and the better of
these climb on, with shorter steps.

Letters: N starts, n joints, P points of all starts together. Points are configurations, shape
(P, n), radians or (prismatic joints) metres; the points of one start stand next to each other.
A point has a value σ, shape (P,), and a slope ∂σ/∂q, shape (P, n).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lockedjoint.kinematics.geometry import IntArray
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray

# Number of random configurations of each start: with fewer, more starts end at poor optima.
_DRAWS_PER_START = 192


@dataclass(frozen=True)
class _Round:
    """One round of the tournament."""

    keep: int  #: Number of points of each start that climb in this round.
    steps: int  #: Number of steps that each takes.
    last_step_rad: float  #: Length of the last step; the first is as long as the one before.


# Rounds of the tournament, whose best point is the start: more gain less than they cost.
_ROUNDS = (_Round(64, 5, 0.25), _Round(20, 5, 0.1), _Round(6, 10, 0.02))
# Length of the first step of the first round.
_FIRST_STEP_RAD = 0.5
# Slides are as long as turns: a prismatic joint has two metres where a revolute one has a turn.
_METRES_PER_RADIAN = 1 / np.pi
# Number of starts that are found together: bounds the memory.
_STARTS_AT_ONCE = 64


def promising_starts(arm: RobotArm, generators: Sequence[np.random.Generator]) -> FloatArray:
    """Return one start for each of N random generators, shape (N, n)."""
    parts = [
        _winners(arm, generators[first : first + _STARTS_AT_ONCE])
        for first in range(0, len(generators), _STARTS_AT_ONCE)
    ]
    return np.concatenate(parts)


def _winners(arm: RobotArm, generators: Sequence[np.random.Generator]) -> FloatArray:
    """Hold the tournament of some starts; return the winner of each, shape (starts, n)."""
    draws = [arm.samples(rng, _DRAWS_PER_START) for rng in generators]
    points = np.concatenate(draws)
    values, slopes = arm.worst_case(points)
    longest = _FIRST_STEP_RAD
    for each in _ROUNDS:
        kept = _best(values, len(generators), each.keep)
        lengths = np.geomspace(longest, each.last_step_rad, each.steps)
        points, values, slopes = _climb(arm, points[kept], values[kept], slopes[kept], lengths)
        longest = each.last_step_rad
    return np.asarray(points[_best(values, len(generators), 1)])


def _best(values: FloatArray, starts: int, keep: int) -> IntArray:
    """Return the numbers of the `keep` points of each start that have the largest values.

    Values have shape (P,), P being the number of starts times the points of one start; the
    result has shape (starts·keep,), start by start.
    """
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
    """Step along the gradient within the limits; return the best point of each way.

    Takes and returns points (P, n), values (P,) and slopes (P, n); `points` is not changed,
    `values` and `slopes` are. The lengths of the steps, shape (steps,), are radians. Where
    failures tie, a step may lead down, as in any subgradient method: the way goes on.
    """
    lower, upper = arm.bounds
    units = np.where(arm.chain.prismatic, _METRES_PER_RADIAN, 1.0)
    best = [points, values, slopes]
    for length in lengths:
        # A joint at a limit does not move against it.
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
