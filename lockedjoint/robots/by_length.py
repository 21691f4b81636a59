"""How the worst case of one configuration depends on the characteristic length ℓ.

A Jacobian has linear rows in metres and angular rows in radians. With all lengths in units of ℓ
its entry (i, k) is proportional to ℓ to a power: −1 in linear rows, +1 more in the columns of
prismatic joints. So the Jacobian in metres is computed once, and the Jacobians for all lengths
and failures are one stack of matrices.

`LengthScale.best` maximises, over log ℓ, the worst case in percent of the bound (6). Up to a
constant factor the percentage is σ/‖J‖_F: its logarithm is the *height* in the code. σ is the
least singular value that is left after the worst failure, eq. (5).

The percentage is quasi-concave in s = ℓ², so that a search by slopes finds its maximum. Proof
for revolute joints: J = D J₁, with J₁ in metres and D = diag(I/ℓ, I). After a failure the
least eigenvalue of what is left of JJᵀ is at least τ tr(JJᵀ) if and only if the matrix
N − τ tr(s) diag(sI, I) is positive semidefinite. N is what is left of J₁J₁ᵀ, and does not
depend on s. tr(s) = tr(JJᵀ) = a/s + b with a, b ≥ 0, so that the entries of tr(s) diag(sI, I),
a + bs and a/s + b, are convex in s. For every τ > 0 and every failure the set of such s is
convex, and so is the intersection over all failures. With prismatic joints N is affine in s,
and the argument is the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lockedjoint.formulations import measures
from lockedjoint.kinematics.geometry import IntArray
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray

# Number of matrices, one for each length and failure, decomposed together: bounds the memory.
_MATRICES_AT_ONCE = 10_000
# Decades of lengths searched on either side of the present one.
_DECADES = 2.0
# Length of a bracket, in log ℓ, above which it is halved: far from the best length slopes are
# nearly 0, and their zero is nowhere near.
_LONG_BRACKET = 0.3
# Length of a bracket, in log ℓ, at which the search ends.
_SHORTEST_BRACKET = 1e-9
# Possible gain in height at which the search ends: rounding.
_NO_GAIN = 1e-13
# Share of the bracket that a new point keeps from either end: without it one end may stay.
_INSIDE_SHARE = 0.05
# Length of a bracket, in log ℓ, up to which that distance is not kept.
_TINY_BRACKET = 1e-6
# Largest number of evaluations in one search; 13 were needed on average, and 18 at most.
_MOST_STEPS = 60
# Percentage of the bound up to which nothing is left, but for rounding.
_NOTHING_PERCENT = 1e-9
# Height where nothing is left after a failure: near the logarithm of the least float.
_NO_HEIGHT = -700.0


@dataclass(frozen=True)
class AtLength:
    """The worst case of a configuration at one characteristic length."""

    length: float  #: ℓ in metres.
    worst_case_sigma: float  #: σ, eq. (5), of J in units of ℓ.
    percent_of_bound: float  #: σ in percent of the bound (6) at the same ‖J‖_F.
    worst_case_joints: tuple[str, ...]  #: Names of the joints that lock in the worst failure.


@dataclass(frozen=True)
class _Point:
    """The height at one length, and its slope."""

    log_length: float  #: log ℓ, ℓ in metres.
    height: float  #: log(σ/‖J‖_F).
    slope: float  #: Derivative of the height by log ℓ.
    failure: int  #: Number of the worst failure, in `LengthScale._sets`.

    def tangent(self, log_length: float) -> float:
        """Return the value of the tangent at another log ℓ."""
        return self.height + self.slope * (log_length - self.log_length)


class LengthScale:
    """A configuration of an arm at any characteristic length.

    Parameters
    ----------
    arm
        The robot and its task.
    metric
        The Jacobian (v; ω) in metres and radians, shape (6, n), as `RobotArm.metric_jacobian`.
    failures
        How many joints lock at once, k.
    """

    def __init__(self, arm: RobotArm, metric: FloatArray, failures: int) -> None:
        self._names, self._shape = arm.chain.names, arm.shape
        # Entry (i, j) of J in units of ℓ is that of the metric J times ℓ to its power.
        powers = np.zeros(metric.shape)
        powers[:3] -= 1
        powers[:, list(arm.chain.prismatic)] += 1
        rows = arm.task.rows
        self._metric, self._powers = (metric * arm.chain.speeds)[rows], powers[rows]
        # The sets of k joints that may lock; the joints that each leaves, (failures, n − k).
        self._sets = measures.locked_sets(self._metric, failures)
        self._left = joints_left(self._sets, len(self._names))
        self._full_rank = self._left.shape[1] >= self._shape[0]
        # The bound (6) for ‖J‖_F = 1: it is proportional to ‖J‖_F.
        self._bound = measures.sigma_bound(*self._shape, 1.0)

    def at(self, lengths: FloatArray) -> tuple[AtLength, ...]:
        """Return the worst case at lengths in metres, shape (k,)."""
        size = max(1, _MATRICES_AT_ONCE // len(self._sets))
        parts = [self._at(lengths[k : k + size]) for k in range(0, len(lengths), size)]
        return tuple(one for part in parts for one in part)

    def _at(self, lengths: FloatArray) -> list[AtLength]:
        """Return the worst case at lengths in metres, shape (k,), few enough for the memory."""
        stack = self._metric * lengths[:, None, None] ** self._powers
        sigmas: FloatArray = np.zeros((len(stack), len(self._sets)))
        if self._full_rank:
            left = stack[:, :, self._left].transpose(0, 2, 1, 3)
            sigmas = np.asarray(np.linalg.svd(left, compute_uv=False)[..., -1], dtype=float)
        found = []
        for length, matrix, after in zip(lengths.tolist(), stack, sigmas, strict=True):
            worst = int(np.argmin(after))
            sigma, bound = float(after[worst]), self._bound * float(np.linalg.norm(matrix))
            joints = tuple(self._names[k] for k in self._sets[worst])
            found.append(AtLength(length, sigma, percent(sigma, bound), joints))
        return found

    def best(self, length: float) -> AtLength | None:
        """Return the length near one in metres with the largest percentage of the bound (6).

        None if no length gives more than 0.
        """
        if not self._full_rank:
            return None
        middle, reach = math.log(length), _DECADES * math.log(10.0)
        best = self._climb(self._point(middle - reach), self._point(middle + reach))
        found = self.at(np.array([math.exp(best.log_length)]))[0]
        return found if found.percent_of_bound > _NOTHING_PERCENT else None

    def _climb(self, low: _Point, high: _Point) -> _Point:
        """Return the highest point between two: the slope is above 0 at `low`, below at `high`.

        If it is not, the maximum is not inside, and the higher of the two ends is returned.
        """
        best = max(low, high, key=lambda point: point.height)
        if not low.slope > 0 > high.slope:
            return best
        for _ in range(_MOST_STEPS):
            width = high.log_length - low.log_length
            step = _next(low, high)
            gain = low.tangent(step) - best.height  # as far as the tangent foretells it
            if width < _SHORTEST_BRACKET or (width < _LONG_BRACKET and gain < _NO_GAIN):
                break
            if width > _TINY_BRACKET:
                inside = _INSIDE_SHARE * width
                step = min(max(step, low.log_length + inside), high.log_length - inside)
            point = self._point(step)
            best = max(best, point, key=lambda one: one.height)
            low, high = (point, high) if point.slope > 0 else (low, point)
        return best

    def _point(self, log_length: float) -> _Point:
        """Return height and slope at log ℓ.

        Let u be the weakest direction after the worst failure F, J_F the columns that it leaves
        and J′ = ∂J/∂ log ℓ. Then σ² = ‖uᵀJ_F‖², and the slope of the height, log(σ/‖J‖_F), is
        uᵀJ′_F J_Fᵀu/σ² − ⟨J, J′⟩/‖J‖_F²: u itself moves only in second order.
        """
        matrix = self._metric * math.exp(log_length) ** self._powers
        slopes = matrix * self._powers  # J′
        left = matrix[:, self._left].transpose(1, 0, 2)
        values, vectors = np.linalg.eigh(left @ left.transpose(0, 2, 1))
        worst = int(values[:, 0].argmin())
        weakest, kept = vectors[worst, :, 0], self._left[worst]
        moved = weakest @ matrix[:, kept]
        square, trace = float(moved @ moved), float((matrix * matrix).sum())
        if not square > 0:
            return _Point(log_length, _NO_HEIGHT, 0.0, worst)
        slope = float(weakest @ slopes[:, kept] @ moved) / square
        slope -= float((matrix * slopes).sum()) / trace
        return _Point(log_length, 0.5 * math.log(square / trace), slope, worst)


def _next(low: _Point, high: _Point) -> float:
    """Return the next log ℓ between two points, where the slope is above 0 and below 0."""
    width = high.log_length - low.log_length
    if width > _LONG_BRACKET:
        return (low.log_length + high.log_length) / 2
    steeper = low.slope - high.slope
    if low.failure == high.failure:  # one smooth piece: where its slope is 0
        return low.log_length + width * low.slope / steeper
    # The tangents of two failures meet there.
    return (high.tangent(0.0) - low.tangent(0.0)) / steeper


def joints_left(sets: list[tuple[int, ...]], joints: int) -> IntArray:
    """Return the joints that each set of k locked ones leaves, shape (failures, n − k).

    `joints` is their number n. The array is shared between calls, and cannot be written to.
    """
    return _joints_left(tuple(sets), joints)


@lru_cache(maxsize=64)
def _joints_left(sets: tuple[tuple[int, ...], ...], joints: int) -> IntArray:
    left = np.array([np.delete(np.arange(joints), locked) for locked in sets])
    left.flags.writeable = False
    return left


def percent(sigma: float, best: float) -> float:
    """Return a singular value in percent of the best one; 0 if the best is 0."""
    return 100.0 * sigma / best if best > 0 else 0.0
