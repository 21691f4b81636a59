"""All starts of max-min on an arm at once, by a primal-dual interior-point method in NumPy.

Every start takes the same ten or twenty small steps, so one step of all starts is one operation
on arrays. The method is Ipopt's: Wächter and Biegler (2006), without filter and restoration.

The letters, for B starts in one step, n joints and p conditions:

============  ==============================================================================
x = (q, τ)    variables, shape (B, n + 1): joint positions q, radians or (prismatic joints)
              metres, and τ = log t
t             level, t ≤ σ²: the square of what the worst failure leaves; σ is eq. (5), in the
              unit of the arm's Jacobian
c_i ≥ 0       conditions, "slacks" in the code, shape (B, p): see `max_min_values`
y_i > 0       multipliers of the conditions, shape (B, p)
μ > 0         barrier parameter, shape (B,): it falls from start to end
f = −τ        what is minimised
K, d          Newton's matrix, shape (B, n + 1, n + 1), and its step in x, shape (B, n + 1)
============  ==============================================================================

With all c_i > 0 and y_i > 0, Newton's method is on the equations ::

    ∇f − Σ y_i ∇c_i = 0,    y_i c_i = μ.

Eliminating the changes of the y_i gives ::

    K d = −(∇f − Σ μ/c_i ∇c_i),    K = −Σ y_i ∇²c_i + Σ y_i/c_i ∇c_i ∇c_iᵀ.

The eigenvalues of K are replaced by their absolute values, so that d is a direction of descent
of the barrier function f − μ Σ log c_i. A line search follows d. Each start stops on its own:
when the equations hold for μ = 0, when its line search fails, or after `_MOST_STEPS`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lockedjoint.kinematics.geometry import BoolArray
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.problem import LIMIT, SUCCESS
from lockedjoint.robots.max_min_values import MaxMinValues

# Status, in Ipopt's words, of a start whose line search found no better point.
STUCK = "Search_Direction_Becomes_Too_Small"
# First barrier parameter μ: starts are near an optimum already, and a larger one leads away.
_FIRST_BARRIER = 1e-3
# Last barrier parameter μ: the answer falls short of the optimum by about p·μ in log t.
LAST_BARRIER = 1e-9
# μ falls to this factor times μ, or to μ to the power below, whichever is less (as in Ipopt).
_BARRIER_FACTOR = 0.2
_BARRIER_POWER = 1.5
# μ falls when the error of the equations is at most this times μ (as in Ipopt).
_BARRIER_ERROR = 10.0
# Largest number of times that μ falls between two steps: each fall costs no derivative.
_MOST_FALLS = 4
# Error of the equations for μ = 0 up to which a start has converged; Ipopt's default tolerance.
_TOLERANCE = 1e-8
# Mean of the multipliers above which the first equation's error is divided (as in Ipopt).
_LARGE_MULTIPLIER = 100
# Largest number of steps of a start; arms of seven joints need 9 to 18 as a rule.
_MOST_STEPS = 60
# First level t as a share of σ²: below 1, so that every condition holds strictly.
_LEVEL_SHARE = 0.9
# First distance of positions from limits, in radians or metres; a range shorter than 1 has this
# share of it. On a limit a slack would be 0, and the barrier infinite.
_FROM_LIMITS_M_OR_RAD = 1e-3
# Largest move of a joint in one step: J turns with q, and a longer step trusts a poor model.
_LONGEST_STEP_M_OR_RAD = 0.5
# Least eigenvalue of K: a smaller one makes d longer where the barrier function is nearly flat.
_LEAST_CURVATURE = 1e-4
# Share of each slack and each multiplier that a step leaves, so that both stay above 0.
_KEPT_SHARE = 0.01
# Largest number of lengths that the line search tries, each half of the one before.
_MOST_HALVES = 12
# Share of the decrease predicted by the slope that a step must bring (Armijo's rule).
_ARMIJO = 1e-4
# Relative increase of the barrier function that counts as rounding.
_ROUNDING = 1e-10
# Multipliers y stay between μ/c divided by and multiplied by this (as in Ipopt).
_NEAR_CENTRE = 1e10
# Number of starts in one step: their arrays stay in the processor's cache.
_STARTS_AT_ONCE = 128
# Least divisor, in place of 0.
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Climbed:
    """Where N starts ended.

    Attributes
    ----------
    points
        The postures q, shape (N, n), radians or (prismatic joints) metres.
    levels
        t, shape (N,): the worst failure leaves σ ≥ √t.
    statuses
        N statuses in Ipopt's words: `SUCCESS`, `LIMIT` (too many steps) or `STUCK`.
    steps
        Number of steps of each start, shape (N,), as floats.
    errors
        Error of the equations for μ = 0 at the end, shape (N,); infinite if a start that was
        not feasible took no step.
    violations
        max(0, −min c_i) at the end, shape (N,).
    """

    points: FloatArray
    levels: FloatArray
    statuses: tuple[str, ...]
    steps: FloatArray
    errors: FloatArray
    violations: FloatArray


def climb(arm: RobotArm, starts: FloatArray) -> Climbed:
    """Maximise the worst case of an arm from N starts.

    Parameters
    ----------
    arm
        The arm: its chain, limits, task and characteristic length.
    starts
        Postures to start from, shape (N, n), N ≥ 1, radians or (prismatic joints) metres.
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
    """Maximise from B starts, shape (B, n); `going` has the numbers of those still moving."""
    span = np.minimum(values.upper - values.lower, 1.0)
    inset = _FROM_LIMITS_M_OR_RAD * span
    q = np.clip(starts, values.lower + inset, values.upper - inset)
    level = _LEVEL_SHARE * np.maximum(arm.worst_case(q)[0] ** 2, np.finfo(float).tiny)
    x = np.column_stack([q, np.log(level)])
    slacks = values.slacks(x)
    barrier = np.full(len(x), _FIRST_BARRIER)
    inside = np.all(slacks > 0, axis=1)
    # y_i = μ/c_i solves the second equation; the starts outside take no step.
    multipliers = barrier[:, None] / np.where(inside[:, None], slacks, 1.0)
    statuses = np.where(inside, LIMIT, STUCK).astype(object)
    steps, errors = np.zeros(len(x)), np.full(len(x), np.inf)
    going = np.flatnonzero(inside)
    for _ in range(_MOST_STEPS):
        if not going.size:
            break
        here = _State(x[going], slacks[going], multipliers[going], barrier[going])
        newton = _Newton(values, here)
        errors[going] = newton.error(0.0)
        ended = errors[going] <= _TOLERANCE
        statuses[going[ended]] = SUCCESS
        going, moving = going[~ended], ~ended
        if not going.size:
            break
        after, better = newton.step(values, moving)
        x[going], slacks[going] = after.x, after.slacks
        multipliers[going], barrier[going] = after.multipliers, after.barrier
        steps[going] += 1
        statuses[going[~better]] = STUCK
        going = going[better]
    violations = np.maximum(-np.min(slacks, axis=1), 0.0)
    return Climbed(x[:, :-1], np.exp(x[:, -1]), tuple(statuses), steps, errors, violations)


@dataclass(frozen=True, eq=False)
class _State:
    """Where B starts are."""

    x: FloatArray  #: (q, τ), shape (B, n + 1).
    slacks: FloatArray  #: c at x, shape (B, p), all above 0.
    multipliers: FloatArray  #: y, shape (B, p), all above 0.
    barrier: FloatArray  #: μ, shape (B,).


class _Newton:
    """Newton's equations of B starts at a state: their error, and a step."""

    def __init__(self, values: MaxMinValues, here: _State) -> None:
        self._here = here
        # ∇c, shape (B, p, n + 1), and −Σ y_i ∇²c_i, shape (B, n + 1, n + 1).
        self._slopes, self._curved = values.derivatives(here.x, here.multipliers)
        self._objective = np.zeros(values.size)  # ∇f, shape (n + 1,): f = −τ
        self._objective[-1] = -1.0
        pulled = np.einsum("bp,bpa->ba", here.multipliers, self._slopes)  # Σ y_i ∇c_i
        # Large multipliers make the first equation less exact: Ipopt divides its error, too.
        scale = np.maximum(1.0, np.mean(here.multipliers, axis=1) / _LARGE_MULTIPLIER)
        self._unbalanced = np.max(np.abs(self._objective - pulled), axis=1) / scale

    def error(self, barrier: FloatArray | float) -> FloatArray:
        """Return the largest error of both equations for some μ, (B,) or one, shape (B,)."""
        products = self._here.multipliers * self._here.slacks
        missed = np.max(np.abs(products - np.reshape(barrier, (-1, 1))), axis=1)
        return np.asarray(np.maximum(self._unbalanced, missed))

    def _lower_barrier(self) -> FloatArray:
        """Return the next μ, shape (B,): lower where the equations for the present one hold."""
        barrier = self._here.barrier.copy()
        for _ in range(_MOST_FALLS):
            near = (self.error(barrier) <= _BARRIER_ERROR * barrier) & (barrier > LAST_BARRIER)
            if not near.any():
                break
            lower = np.minimum(_BARRIER_FACTOR * barrier, barrier**_BARRIER_POWER)
            barrier = np.where(near, np.maximum(lower, LAST_BARRIER), barrier)
        return barrier

    def step(self, values: MaxMinValues, moving: BoolArray) -> tuple[_State, BoolArray]:
        """Move the starts that `moving`, shape (B,), selects, by one step.

        Returns their states afterwards, and for each whether its line search succeeded: a
        start whose search failed keeps its x and c.
        """
        barrier = self._lower_barrier()[moving]
        x, slacks = self._here.x[moving], self._here.slacks[moving]
        multipliers = self._here.multipliers[moving]
        slopes, central = self._slopes[moving], barrier[:, None] / slacks  # ∇c and μ/c
        gradient = self._objective - np.einsum("bp,bpa->ba", central, slopes)
        weighted = (multipliers / slacks)[:, :, None] * slopes
        hessian = self._curved[moving] + slopes.transpose(0, 2, 1) @ weighted  # K
        direction = _shortened(-_solved(hessian, gradient))
        after, ahead, better = _searched(values, x, slacks, barrier, direction, gradient)
        # Newton's change of y from y_i c_i = μ:  Δy = μ/c − y ∇c·d/c − y.
        change = np.einsum("bpa,ba->bp", slopes, direction)
        changes = central - multipliers * change / slacks - multipliers
        share = _largest_share(multipliers, changes)
        centre = barrier[:, None] / ahead
        moved = multipliers + share[:, None] * changes
        moved = np.clip(moved, centre / _NEAR_CENTRE, centre * _NEAR_CENTRE)
        return _State(after, ahead, moved, barrier), better


def _solved(matrices: FloatArray, sides: FloatArray) -> FloatArray:
    """Return |K|⁻¹ times the sides, shape (B, n + 1), for symmetric K, (B, n + 1, n + 1).

    |K| has the eigenvectors of K, and the absolute values of its eigenvalues.
    """
    values, vectors = np.linalg.eigh(matrices)
    values = np.maximum(np.abs(values), _LEAST_CURVATURE)
    inner = (vectors.transpose(0, 2, 1) @ sides[:, :, None])[:, :, 0] / values
    return np.asarray((vectors @ inner[:, :, None])[:, :, 0])


def _shortened(direction: FloatArray) -> FloatArray:
    """Return directions, shape (B, n + 1), along which no joint moves too far."""
    longest = np.max(np.abs(direction[:, :-1]), axis=1)
    share = np.minimum(1.0, _LONGEST_STEP_M_OR_RAD / np.maximum(longest, _TINY))
    return np.asarray(direction * share[:, None])


def _largest_share(values: FloatArray, changes: FloatArray) -> FloatArray:
    """Return the largest s ≤ 1 with values + s·changes ≥ `_KEPT_SHARE`·values, shape (B,).

    Values and changes have shape (B, p), and the values are above 0.
    """
    falling = np.where(changes < 0, changes, -_TINY)
    share = np.min((_KEPT_SHARE - 1.0) * values / falling, axis=1)
    return np.asarray(np.minimum(1.0, share))


def _searched(
    values: MaxMinValues,
    x: FloatArray,
    slacks: FloatArray,
    barrier: FloatArray,
    direction: FloatArray,
    gradient: FloatArray,
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Follow directions, shape (B, n + 1), until the barrier function falls; else halve them.

    The gradient, shape (B, n + 1), is that of the barrier function at x. Returns the points,
    their slacks, and which starts fell. A start that did not stays at x.
    """
    slope = np.sum(gradient * direction, axis=1)  # below 0: the direction descends
    before = _barrier_function(x, slacks, barrier)
    after, ahead, better = x.copy(), slacks.copy(), np.zeros(len(x), dtype=bool)
    share = np.ones(len(x))
    for _ in range(_MOST_HALVES):
        again = np.flatnonzero(~better)
        tried = x[again] + share[again, None] * direction[again]
        found = values.slacks(tried)
        kept = np.all(found >= _KEPT_SHARE * slacks[again], axis=1)
        value = _barrier_function(tried, np.where(kept[:, None], found, 1.0), barrier[again])
        limit = before[again] + _ARMIJO * share[again] * slope[again]
        falls = kept & (value <= limit + _ROUNDING * np.abs(before[again]))
        own = again[falls]
        after[own], ahead[own], better[own] = tried[falls], found[falls], True
        if better.all():
            break
        share[~better] /= 2
    return after, ahead, better


def _barrier_function(x: FloatArray, slacks: FloatArray, barrier: FloatArray) -> FloatArray:
    """Return −τ − μ Σ log c_i, shape (B,)."""
    return np.asarray(-x[:, -1] - barrier * np.sum(np.log(slacks), axis=1))
