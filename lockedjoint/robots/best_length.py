"""The characteristic length ℓ with the largest percentage of the bound (6): a search by slopes.

Up to a constant factor the percentage is σ/‖J‖_F: its logarithm is the *height* in the code. σ
is the least singular value that is left after the worst failure, eq. (5).

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
from collections.abc import Callable, Sequence
from typing import NamedTuple

# Length of a bracket, in log ℓ, above which it is halved: far from the best length slopes are
# nearly 0, and their zero is nowhere near. Neighbours that are shown are nearer.
_LONG_BRACKET = 0.6
# The same where the ends have different worst failures: tangents then meet where heights do.
_LONG_BETWEEN_FAILURES = 1e-6
# The next point is this share of such a bracket, if it is longer, from its best end, if that is
# where the tangents meet: the other end has to come nearer.
_NEAR_SHARE = 0.05
# Length of a bracket, in log ℓ, at which the search ends.
_SHORTEST_BRACKET = 1e-13
# Possible gain in height at which the search ends: rounding.
_NO_GAIN = 1e-13
# A step has to be at most this share of the one before the last, or the bracket between two
# failures of that before the last: else the bracket is halved.
_SHORTER = 0.5
# Largest number of evaluations in one search; 4 were needed on average, and 15 at most.
_MOST_STEPS = 60
# Height where nothing is left after a failure: near the logarithm of the least float.
_NO_HEIGHT = -700.0
# Height up to which all that is left is rounding. What rank is left is the same at all lengths.
_ROUNDING_HEIGHT = -32.0


class Point(NamedTuple):
    """The height at one length, and its slope."""

    log_length: float  #: log ℓ, ℓ in metres.
    slope: float  #: Derivative of the height by log ℓ.
    failure: int  #: Number of the worst failure.
    sigma: float  #: σ of J in units of ℓ.
    norm: float  #: ‖J‖_F in units of ℓ.
    sure: bool  #: Whether σ has all its digits.

    @property
    def height(self) -> float:
        """log(σ/‖J‖_F), or a number that is lower than all others where nothing is left."""
        return math.log(self.sigma / self.norm) if self.sigma > 0 else _NO_HEIGHT

    def tangent(self, log_length: float) -> float:
        """Return the value of the tangent at another log ℓ."""
        return self.height + self.slope * (log_length - self.log_length)


#: A function takes log ℓ and returns the point there.
At = Callable[[float], Point]


def highest(points: Sequence[Point], least: float, largest: float, at: At) -> Point:
    """Return the highest point between two log ℓ, `least` and `largest`.

    `points` are some of those between them, in ascending order of ℓ.
    """
    k = max(range(len(points)), key=lambda one: points[one].height)
    if points[k].height < _ROUNDING_HEIGHT:
        return points[k]
    if points[k].slope > 0:
        return _climb(points[k], points[k + 1] if k + 1 < len(points) else at(largest), at)
    return _climb(points[k - 1] if k else at(least), points[k], at)


def _climb(low: Point, high: Point, at: At) -> Point:
    """Return the highest point between two: the slope is above 0 at `low`, below at `high`.

    If it is not, the maximum is not inside, and the higher of the two ends is returned.

    It is Brent's way to find where the slope is 0 or changes its sign: steps by formulas as
    long as they become shorter, and the middle of the bracket where they do not.
    """
    best, other = (low, high) if low.height > high.height else (high, low)
    if not low.slope > 0 > high.slope:
        return best
    sizes = [math.inf, math.inf]  # of the steps before the last and the last
    for _ in range(_MOST_STEPS):
        width, between = high.log_length - low.log_length, low.failure != high.failure
        step = _next(low, high, best, other) - best.log_length
        done = abs(best.slope * step) < _NO_GAIN  # as far as the tangent foretells it
        long = width > (_LONG_BETWEEN_FAILURES if between else _LONG_BRACKET)
        if width < _SHORTEST_BRACKET or (done and not long):
            break
        size = width if between else abs(step)
        inside = low.log_length < best.log_length + step < high.log_length
        if width > _LONG_BRACKET or not inside or size > _SHORTER * sizes[0]:
            step = (low.log_length + high.log_length) / 2 - best.log_length
        elif done:
            step = math.copysign(_NEAR_SHARE * width, best.slope)
        sizes = [sizes[1], size]
        point = at(best.log_length + step)
        low, high = (point, high) if point.slope > 0 else (low, point)
        best, other = (point, best) if point.height > best.height else (best, point)
    return best


def _next(low: Point, high: Point, best: Point, other: Point) -> float:
    """Return the log ℓ at which the height should be largest.

    It is between `low` and `high`, where the slope is above 0 and below 0. `best` and `other`
    are the best point so far and the one before, or the one after.
    """
    if low.failure != high.failure:  # the tangents of two failures meet there
        return (high.tangent(0.0) - low.tangent(0.0)) / (low.slope - high.slope)
    # One smooth piece: the zero of the slope, if that is a straight line through both.
    steeper = best.slope - other.slope
    if best.failure != other.failure or steeper == 0:
        return math.inf
    return best.log_length - best.slope * (best.log_length - other.log_length) / steeper
