"""How the worst case of one configuration depends on the characteristic length ℓ.

The Jacobian in metres is computed once; all lengths and failures are one stack of matrices.

The percentage of the bound (6) is quasi-concave in s = ℓ², so that the best length is found
from slopes. Proof: with D = diag(I/ℓ, I), the least eigenvalue of what a failure leaves of JJᵀ
is at least τ tr(JJᵀ) if and only if N(s) − τ tr(s) diag(sI, I) is positive semidefinite. N(s)
is affine in s, tr(s) = a/s + b, and a + bs and a/s + b are convex. For every τ > 0 and every
failure the set of such s is convex, and so is the intersection of these sets.
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

# So many matrices, one for each length and failure, are decomposed together.
_MATRICES_AT_ONCE = 10_000
# The best length is looked for so many decades to either side of the present one.
_DECADES = 2.0
# Slopes mislead in a longer bracket, in log ℓ: far from the best length they are nearly 0.
_LONG_BRACKET = 0.3
# A bracket, in log ℓ, that is shorter is not made shorter still.
_SHORTEST_BRACKET = 1e-9
# The search ends if it gains less than this, in the logarithm of the percentage.
_NO_GAIN = 1e-13
# A new point keeps this share of the bracket to either end, unless the bracket is tiny.
_INSIDE_SHARE = 0.05
# A bracket, in log ℓ, is tiny if it is at most this long.
_TINY_BRACKET = 1e-6
# The search ends after so many evaluations; it needed 13 on average, and 18 at most.
_MOST_STEPS = 60
# A percentage up to this is 0, but for rounding.
_NOTHING_PERCENT = 1e-9
# The logarithm of the percentage is this where nothing is left after a failure.
_MINUS_INFINITY = -700.0


@dataclass(frozen=True)
class AtLength:
    """The worst case of a configuration at one characteristic length."""

    length: float  #: ℓ in metres.
    worst_case_sigma: float  #: Eq. (5) of J in units of ℓ.
    percent_of_bound: float  #: That, in percent of the bound (6) at the same ‖J‖_F.
    worst_case_joints: tuple[str, ...]  #: Names of the joints whose failure it is.


@dataclass(frozen=True)
class _Point:
    """One length: its logarithm, that of σ/‖J‖_F, the slope of this, and the worst failure."""

    log_length: float
    log_share: float
    slope: float
    failure: int

    def tangent(self, log_length: float) -> float:
        """Return the value of the tangent at another length."""
        return self.log_share + self.slope * (log_length - self.log_length)


class LengthScale:
    """A configuration of an arm at any characteristic length.

    Parameters
    ----------
    arm
        The robot and its task.
    metric
        The Jacobian (v; ω) in metres and radians, shape (6, n), as `RobotArm.metric_jacobian`.
    failures
        How many joints lock at once.
    """

    def __init__(self, arm: RobotArm, metric: FloatArray, failures: int) -> None:
        self._names, self._shape = arm.chain.names, arm.shape
        powers = np.zeros(metric.shape)  # entry ik of J is proportional to ℓ to the power ik
        powers[:3] -= 1
        powers[:, list(arm.chain.prismatic)] += 1
        rows = arm.task.rows
        self._metric, self._powers = (metric * arm.chain.speeds)[rows], powers[rows]
        self._sets = measures.locked_sets(self._metric, failures)
        self._left = joints_left(self._sets, len(self._names))
        self._full_rank = self._left.shape[1] >= self._shape[0]
        # The bound (6) is proportional to ‖J‖_F.
        self._bound = measures.sigma_bound(*self._shape, 1.0)

    def at(self, lengths: FloatArray) -> tuple[AtLength, ...]:
        """Return the worst case at lengths in metres, shape (k,)."""
        size = max(1, _MATRICES_AT_ONCE // len(self._sets))
        parts = [self._at(lengths[k : k + size]) for k in range(0, len(lengths), size)]
        return tuple(one for part in parts for one in part)

    def _at(self, lengths: FloatArray) -> list[AtLength]:
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
        """Return the best point between two."""
        best = max(low, high, key=lambda point: point.log_share)
        if not low.slope > 0 > high.slope:
            return best
        for _ in range(_MOST_STEPS):
            width = high.log_length - low.log_length
            step = _next(low, high)
            gain = low.tangent(step) - best.log_share
            if width < _SHORTEST_BRACKET or (width < _LONG_BRACKET and gain < _NO_GAIN):
                break
            if width > _TINY_BRACKET:
                inside = _INSIDE_SHARE * width
                step = min(max(step, low.log_length + inside), high.log_length - inside)
            point = self._point(step)
            best = max(best, point, key=lambda one: one.log_share)
            low, high = (point, high) if point.slope > 0 else (low, point)
        return best

    def _point(self, log_length: float) -> _Point:
        matrix = self._metric * math.exp(log_length) ** self._powers
        slopes = matrix * self._powers  # ∂J/∂ log ℓ
        left = matrix[:, self._left].transpose(1, 0, 2)
        values, vectors = np.linalg.eigh(left @ left.transpose(0, 2, 1))
        worst = int(values[:, 0].argmin())
        weakest, kept = vectors[worst, :, 0], self._left[worst]
        moved = weakest @ matrix[:, kept]
        square, trace = float(moved @ moved), float((matrix * matrix).sum())
        if not square > 0:
            return _Point(log_length, _MINUS_INFINITY, 0.0, worst)
        slope = float(weakest @ slopes[:, kept] @ moved) / square
        slope -= float((matrix * slopes).sum()) / trace
        return _Point(log_length, 0.5 * math.log(square / trace), slope, worst)


def _next(low: _Point, high: _Point) -> float:
    """Return where to look next between two points with slopes of both signs."""
    width = high.log_length - low.log_length
    if width > _LONG_BRACKET:
        return (low.log_length + high.log_length) / 2
    steeper = low.slope - high.slope
    if low.failure == high.failure:  # one smooth piece: where its slope is 0
        return low.log_length + width * low.slope / steeper
    # The tangents of two failures meet there.
    return (high.tangent(0.0) - low.tangent(0.0)) / steeper


def joints_left(sets: list[tuple[int, ...]], joints: int) -> IntArray:
    """Return the joints that each set of locked joints leaves, shape (failures, n − k)."""
    return _joints_left(tuple(sets), joints)


@lru_cache(maxsize=64)
def _joints_left(sets: tuple[tuple[int, ...], ...], joints: int) -> IntArray:
    left = np.array([np.delete(np.arange(joints), locked) for locked in sets])
    left.flags.writeable = False
    return left


def percent(sigma: float, best: float) -> float:
    """Return σ in percent of the best; 0 if that is 0."""
    return 100.0 * sigma / best if best > 0 else 0.0
