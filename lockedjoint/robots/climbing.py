"""All starts of max-min on an arm at once, by a primal-dual interior-point method in NumPy.

A start needs the same twenty small steps as all others, so that each is one step with arrays.
The variables are x = (q, τ) with τ = log t, and t ≤ σ², the square of the worst case. The
conditions c_i ≥ 0 and their derivatives are those of `max_min_values`. There are N starts, B of
them in one step, n joints and p conditions. For a barrier parameter μ, which falls, Newton's
method is on

    ∇f − Σ y_i ∇c_i = 0,    y_i c_i = μ,        f = −τ,

with all c_i > 0 and y_i > 0. Eliminating the y_i, with K for the Hessian, gives

    K d = −(∇f − Σ μ/c_i ∇c_i),    K = −Σ y_i ∇²c_i + Σ y_i/c_i ∇c_i ∇c_iᵀ.

Negative eigenvalues of K change their sign, which makes d a direction of descent of the barrier
function f − μ Σ log c_i; a line search follows it. A start ends by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lockedjoint.kinematics.geometry import BoolArray
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.problem import LIMIT, SUCCESS
from lockedjoint.robots.max_min_values import MaxMinValues

# A start ended in words of Ipopt if its line search found no better point.
STUCK = "Search_Direction_Becomes_Too_Small"
# The barrier parameter is this at first: starts are near an optimum already.
_FIRST_BARRIER = 1e-3
# The barrier parameter falls to this.
LAST_BARRIER = 1e-9
# The barrier parameter falls by this factor, or by this power if that is less.
_BARRIER_FACTOR = 0.2
_BARRIER_POWER = 1.5
# The barrier parameter falls where the error is at most so many times as large.
_BARRIER_ERROR = 10.0
# A start has converged where the error is at most this.
_TOLERANCE = 1e-8
# A start makes at most so many steps.
_MOST_STEPS = 60
# The level starts at this share of the worst case, so that no condition is active.
_LEVEL_SHARE = 0.9
# Positions begin this far from limits, in radians or metres, or this share of a smaller range.
_FROM_LIMITS = 1e-3
# Joints move by at most so much in one step.
_LONGEST_STEP_M_OR_RAD = 0.5
# Eigenvalues of K are at least this.
_LEAST_CURVATURE = 1e-4
# A step keeps this share of each slack and multiplier.
_KEPT_SHARE = 0.01
# A step is halved at most so often.
_MOST_HALVES = 12
# A step must gain this share of what the slope foretells.
_ARMIJO = 1e-4
# A step may lose so much, relatively, which is rounding.
_ROUNDING = 1e-10
# Multipliers stay within this factor of μ/c, as in Ipopt.
_NEAR_CENTRE = 1e10
# So many starts are done together: their arrays stay in the processor's cache.
_STARTS_AT_ONCE = 128


@dataclass(frozen=True, eq=False)
class Climbed:
    """Where starts ended.

    Attributes
    ----------
    points
        The postures, shape (N, n), in radians or, of sliders, in metres.
    levels
        t, shape (N,): what is left is at least √t.
    statuses
        How each ended, in words of Ipopt.
    steps, errors, violations
        Numbers of steps, errors at the end, and by how much conditions are missed, shape (N,).
    """

    points: FloatArray
    levels: FloatArray
    statuses: tuple[str, ...]
    steps: FloatArray
    errors: FloatArray
    violations: FloatArray


def climb(arm: RobotArm, starts: FloatArray) -> Climbed:
    """Maximise the worst case of an arm from starts.

    Parameters
    ----------
    arm
        The arm.
    starts
        The postures to start from, shape (N, n), in radians or, of sliders, in metres.
    """
    values = MaxMinValues(arm)
    parts = [
        _climb(arm, values, starts[first : first + _STARTS_AT_ONCE])
        for first in range(0, len(starts), _STARTS_AT_ONCE)
    ]
    return Climbed(
        np.concatenate([part.points for part in parts]),
        np.concatenate([part.levels for part in parts]),
        tuple(status for part in parts for status in part.statuses),
        np.concatenate([part.steps for part in parts]),
        np.concatenate([part.errors for part in parts]),
        np.concatenate([part.violations for part in parts]),
    )


def _climb(arm: RobotArm, values: MaxMinValues, starts: FloatArray) -> Climbed:
    span = np.minimum(values.upper - values.lower, 1.0)
    q = np.clip(starts, values.lower + _FROM_LIMITS * span, values.upper - _FROM_LIMITS * span)
    level = _LEVEL_SHARE * np.maximum(arm.worst_case(q)[0] ** 2, np.finfo(float).tiny)
    x = np.column_stack([q, np.log(level)])
    slacks = values.slacks(x)
    barrier = np.full(len(x), _FIRST_BARRIER)
    inside = np.all(slacks > 0, axis=1)
    multipliers = barrier[:, None] / np.where(inside[:, None], slacks, 1.0)
    statuses = np.where(inside, LIMIT, STUCK).astype(object)
    steps, errors = np.zeros(len(x)), np.full(len(x), np.inf)
    going = np.flatnonzero(inside)
    for _ in range(_MOST_STEPS):
        if not going.size:
            break
        here = _State(x[going], slacks[going], multipliers[going], barrier[going])
        step = _Step(values, here)
        errors[going] = step.error(0.0)
        ended = errors[going] <= _TOLERANCE
        statuses[going[ended]] = SUCCESS
        going, moving = going[~ended], ~ended
        if not going.size:
            break
        after, better = step.taken(values, moving)
        x[going], slacks[going] = after.x, after.slacks
        multipliers[going], barrier[going] = after.multipliers, after.barrier
        steps[going] += 1
        statuses[going[~better]] = STUCK
        going = going[better]
    missed = np.maximum(-np.min(slacks, axis=1), 0.0)
    return Climbed(x[:, :-1], np.exp(x[:, -1]), tuple(statuses), steps, errors, missed)


@dataclass(frozen=True, eq=False)
class _State:
    """x, shape (B, n + 1); c and y, shape (B, p); and μ, shape (B,)."""

    x: FloatArray
    slacks: FloatArray
    multipliers: FloatArray
    barrier: FloatArray


class _Step:
    """One step of starts that are at a state."""

    def __init__(self, values: MaxMinValues, here: _State) -> None:
        self._here = here
        # ∇c, shape (B, p, n + 1), and −Σ y_i ∇²c_i, shape (B, n + 1, n + 1).
        self._slopes, self._curved = values.derivatives(here.x, here.multipliers)
        self._objective = np.zeros(values.size)
        self._objective[-1] = -1.0
        pulled = np.einsum("bp,bpa->ba", here.multipliers, self._slopes)
        # Ipopt's scale: with large multipliers the first equation is as much less exact.
        scale = np.maximum(1.0, np.mean(here.multipliers, axis=1) / 100)
        self._unbalanced = np.max(np.abs(self._objective - pulled), axis=1) / scale

    def error(self, barrier: FloatArray | float) -> FloatArray:
        """Return by how much the equations are missed for some μ, shape (B,)."""
        products = self._here.multipliers * self._here.slacks
        missed = np.max(np.abs(products - np.reshape(barrier, (-1, 1))), axis=1)
        return np.asarray(np.maximum(self._unbalanced, missed))

    def _lower_barrier(self) -> FloatArray:
        barrier = self._here.barrier.copy()
        for _ in range(4):
            near = (self.error(barrier) <= _BARRIER_ERROR * barrier) & (barrier > LAST_BARRIER)
            if not near.any():
                break
            lower = np.minimum(_BARRIER_FACTOR * barrier, barrier**_BARRIER_POWER)
            barrier = np.where(near, np.maximum(lower, LAST_BARRIER), barrier)
        return barrier

    def taken(self, values: MaxMinValues, moving: BoolArray) -> tuple[_State, BoolArray]:
        """Return the state after a step of some starts, and which found a better one."""
        barrier = self._lower_barrier()[moving]
        x, slacks = self._here.x[moving], self._here.slacks[moving]
        multipliers = self._here.multipliers[moving]
        slopes, wanted = self._slopes[moving], barrier[:, None] / slacks
        pulled = self._objective - np.einsum("bp,bpa->ba", wanted, slopes)
        weighted = (multipliers / slacks)[:, :, None] * slopes
        hessian = self._curved[moving] + slopes.transpose(0, 2, 1) @ weighted
        direction = -_solved(hessian, pulled)
        longest = np.max(np.abs(direction[:, :-1]), axis=1)
        direction *= np.minimum(1.0, _LONGEST_STEP_M_OR_RAD / np.maximum(longest, 1e-300))[
            :, None
        ]
        change = np.einsum("bpa,ba->bp", slopes, direction)
        gain = np.sum(pulled * direction, axis=1)
        after, ahead, better = _searched(values, x, slacks, barrier, direction, gain)
        ways = wanted - multipliers * change / slacks - multipliers
        share = _largest_share(multipliers, ways)
        centre = barrier[:, None] / ahead
        moved = multipliers + share[:, None] * ways
        moved = np.clip(moved, centre / _NEAR_CENTRE, centre * _NEAR_CENTRE)
        return _State(after, ahead, moved, barrier), better


def _solved(matrices: FloatArray, sides: FloatArray) -> FloatArray:
    """Return |K|⁻¹ times sides, (B, n + 1), of symmetric matrices K, (B, n + 1, n + 1)."""
    values, vectors = np.linalg.eigh(matrices)
    values = np.maximum(np.abs(values), _LEAST_CURVATURE)
    inner = (vectors.transpose(0, 2, 1) @ sides[:, :, None])[:, :, 0] / values
    return np.asarray((vectors @ inner[:, :, None])[:, :, 0])


def _largest_share(values: FloatArray, changes: FloatArray) -> FloatArray:
    """Return the share of changes, (B, p), that leaves `_KEPT_SHARE` of values, (B,)."""
    falling = np.where(changes < 0, changes, -1e-300)
    share = np.min((_KEPT_SHARE - 1.0) * values / falling, axis=1)
    return np.asarray(np.minimum(1.0, share))


def _searched(
    values: MaxMinValues,
    x: FloatArray,
    slacks: FloatArray,
    barrier: FloatArray,
    direction: FloatArray,
    gain: FloatArray,
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Follow a direction until the barrier function falls; halve the step where it does not.

    Returns the points, their slacks, and which fell. A start that found none stays.
    """
    before = _barrier_function(x, slacks, barrier)
    after, ahead, better = x.copy(), slacks.copy(), np.zeros(len(x), dtype=bool)
    share = np.ones(len(x))
    for _ in range(_MOST_HALVES):
        again = np.flatnonzero(~better)
        tried = x[again] + share[again, None] * direction[again]
        found = values.slacks(tried)
        kept = np.all(found >= _KEPT_SHARE * slacks[again], axis=1)
        value = _barrier_function(tried, np.where(kept[:, None], found, 1.0), barrier[again])
        limit = before[again] + _ARMIJO * share[again] * gain[again]
        falls = kept & (value <= limit + _ROUNDING * np.abs(before[again]))
        own = again[falls]
        after[own], ahead[own], better[own] = tried[falls], found[falls], True
        if better.all():
            break
        share[~better] /= 2
    return after, ahead, better


def _barrier_function(x: FloatArray, slacks: FloatArray, barrier: FloatArray) -> FloatArray:
    return np.asarray(-x[:, -1] - barrier * np.sum(np.log(slacks), axis=1))
