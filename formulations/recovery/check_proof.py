"""Check a proof that a goal is out of reach: ``python -m formulations.recovery.check_proof``.

Of a file, alone with it and NumPy. Boxes of the joints' positions are bisected until in each of
them a point of the tool is seen to stay away from its target, in one of two ways:

* *ball*: from the tip to the base a ball is kept that holds the point for all positions in the
  box. A revolute joint that turns by at most r < π/2 from a middle takes the ball's centre, at
  distance ρ from the axis, along an arc, which a ball of radius ρ sin r holds around the middle
  of the arc at distance ρ cos r; radii add.
* *slope*: along the direction u from the goal to the point at the middle of the box, the point
  is at least u·y − Σ|u·∂y/∂q_i| r_i − ½ Σ_ij M_max(i,j) r_i r_j away. M_j is the largest
  distance of the point from joint j's axis in the box: |∂²y/∂q_i∂q_j| for i ≤ j is at most it.

The first revolute joint turns the goal instead, backwards: an arc. All is computed in interval
arithmetic: of +, −, × and √, which are correctly rounded, the next number outwards is taken.
Bisection covers the box of all positions by construction, so the leaves are all that is
checked. Axes and placements in the file are taken for unit vectors and rotations: what rounding
they have is within `SURPLUS`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
#: Metres by which a point has to be farther away than its tolerance.
SURPLUS = 1e-10
# Boxes that are looked at together.
_TOGETHER = 20_000
# Angles are halved so often, and the series of their cosine and sine has so many terms.
_HALVED, _TERMS = 6, 18


def check(proof: dict[str, Any]) -> int:
    """Return the number of leaves; ValueError if in one of them no point misses its target."""
    low, high = (np.array(proof[side], dtype=float)[:, None] for side in ("lower", "upper"))
    splits, leaves = np.array(proof["splits"], dtype=int), []
    while low.size:
        split, splits = splits[: low.shape[1]], splits[low.shape[1] :]
        if len(split) < low.shape[1]:
            raise ValueError(f"{low.shape[1] - len(split)} boxes are left over")
        leaves.append(np.stack([low, high])[:, :, split < 0])
        low, high = bisected(low, high, split)
    low, high = np.concatenate(leaves, axis=2)
    for first in range(0, low.shape[1], _TOGETHER):
        left = np.arange(first, min(first + _TOGETHER, low.shape[1]))
        for point in proof["points"]:
            part = low[:, left], high[:, left]
            left = left[~stays_away(proof["motions"], point, *part, SURPLUS, True)[0]]
        if left.size:
            box = " to ".join(str(side[:, left[0]].tolist()) for side in (low, high))
            raise ValueError(f"no point misses its target from {box}")
    return int(low.shape[1])


def bisected(
    low: FloatArray, high: FloatArray, split: npt.NDArray[np.int64]
) -> tuple[FloatArray, FloatArray]:
    """Return the halves of boxes (n, B) by the joint at whose middle each is split, if any."""
    parts = np.flatnonzero(split >= 0)
    joint, first = split[parts], np.arange(0, 2 * len(parts), 2)
    low, high = (np.repeat(side[:, parts], 2, axis=1) for side in (low, high))
    middle = (low[joint, first] + high[joint, first]) / 2
    high[joint, first] = low[joint, first + 1] = middle
    return low, high


@dataclass(frozen=True, eq=False)
class Interval:
    """Numbers from `low` to `high`, arrays (B,): what comes out of + − × holds all that can."""

    low: Any
    high: Any

    def __add__(self, other: Any) -> Interval:
        return _rounded(self.low + bottom(other), self.high + top(other))

    def __neg__(self) -> Interval:
        return Interval(-self.high, -self.low)

    def __sub__(self, other: Any) -> Interval:
        return _rounded(self.low - top(other), self.high - bottom(other))

    def __mul__(self, other: Any) -> Interval:
        if not isinstance(other, Interval):
            ends: Any = (self.low * other, self.high * other)
        else:
            ends = [a * b for a in (self.low, self.high) for b in (other.low, other.high)]
        return _rounded(np.minimum.reduce(ends), np.maximum.reduce(ends))

    def __abs__(self) -> Interval:
        largest = np.maximum(-self.low, self.high)
        return Interval(np.maximum(np.maximum(self.low, -self.high), 0.0), largest)

    __radd__, __rmul__ = __add__, __mul__
    __array_ufunc__ = None  # arrays of NumPy leave operations to it


Number: TypeAlias = Any  # an array of floats, or an Interval of them
Vector: TypeAlias = Any  # three of these


def _rounded(low: Any, high: Any) -> Interval:
    return Interval(np.nextafter(low, -np.inf), np.nextafter(high, np.inf))


def bottom(number: Number) -> Any:
    """Return the least that a number can be."""
    return number.low if isinstance(number, Interval) else number


def top(number: Number) -> Any:
    """Return the most that a number can be."""
    return number.high if isinstance(number, Interval) else number


def _middle(vector: Vector) -> FloatArray:
    return np.array([(bottom(entry) + top(entry)) / 2 for entry in vector])


def _root(number: Number) -> Number:
    if isinstance(number, Interval):
        return _rounded(*(np.sqrt(np.maximum(side, 0.0)) for side in (number.low, number.high)))
    return np.sqrt(np.maximum(number, 0.0))


def _cos_sin(angle: FloatArray, rigorous: bool) -> tuple[Number, Number]:
    """Return cosine and sine of floats, by Taylor's series of a part and doubling."""
    if not rigorous:
        return np.cos(angle), np.sin(angle)
    if not np.all(np.abs(angle) < 2.0**_HALVED):
        raise ValueError(f"an angle of more than {2**_HALVED} rad")
    each, place = np.unique(angle, return_inverse=True)
    part = Interval(each, each) * 2.0**-_HALVED
    term = Interval(np.ones_like(each), np.ones_like(each))
    sums: list[Number] = [term, term * 0.0]
    for k in range(1, _TERMS):
        # Of at most 1 in size, and of alternating signs: the rest is at most the last term.
        term = term * part * Interval(*np.nextafter(1 / k, (0.0, 1.0)))
        sums[k % 2] = sums[k % 2] + (-term if k % 4 > 1 else term)
    rest = top(abs(term))
    cosine, sine = (_rounded(entry.low - rest, entry.high + rest) for entry in sums)
    for _ in range(_HALVED):
        cosine, sine = cosine * cosine - sine * sine, cosine * sine * 2.0
    return tuple(Interval(each.low[place], each.high[place]) for each in (cosine, sine))  # type: ignore[return-value]


def _dot(a: Vector, b: Vector) -> Number:
    total: Number = 0.0
    for first, second in zip(a, b, strict=True):
        if not (isinstance(second, float) and second == 0.0):  # of axes and placements
            total = first * second + total
    return total


def _cross(axis: Sequence[float], v: Vector) -> Vector:
    x, y, z = axis
    return [_dot(v, row) for row in ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))]


def _sum(a: Vector, b: Vector) -> Vector:
    return [first + second for first, second in zip(a, b, strict=True)]


def _times(v: Vector, number: Number) -> Vector:
    return [entry * number for entry in v]


def _off(axis: Sequence[float], v: Vector) -> tuple[Number, Vector]:
    """Return how far a vector is along an axis, and the rest of it."""
    along = _dot(v, axis)
    return along, [entry - along * x if x else entry for entry, x in zip(v, axis, strict=True)]


def _turned(axis: Sequence[float], v: Vector, cosine: Number, sine: Number) -> Vector:
    """Rotate about an axis."""
    along, off = _off(axis, v)
    turned = _sum(_times(off, cosine), _times(_cross(axis, off), sine))
    return [entry + along * x if x else entry for entry, x in zip(turned, axis, strict=True)]


def _interval(
    motion: Any, low: FloatArray, high: FloatArray, rigorous: bool
) -> tuple[FloatArray, FloatArray]:
    """Return floats, and how far from them a motion's values are at most."""
    sides = [side[motion["joint"]] for side in (low, high)]
    wide: list[Number] = [Interval(side, side) if rigorous else side for side in sides]
    ends = [side * motion["multiplier"] + motion["offset"] for side in wide]
    least = np.minimum(*map(bottom, ends))
    most = np.maximum(*map(top, ends))
    middle = (least + most) / 2
    half = np.maximum(most - middle, middle - least)
    return middle, np.nextafter(half, np.inf) if rigorous else half


def _largest(axis: Sequence[float], v: Vector, arc: Vector, cosine: Any, sine: Any) -> Number:
    """Return what the product of two vectors across an axis can be if one is turned.

    By up to a half width, at most π, of which cosine and sine are given.
    """
    sizes = _root(_dot(v, v)) * _root(_dot(arc, arc))
    now, beside = _dot(v, arc), abs(_dot(_cross(axis, v), arc))
    turned = now * cosine + beside * sine
    return np.where(top(now) >= bottom(sizes * cosine), top(sizes), top(turned))


def stays_away(
    motions: Any, point: Any, low: FloatArray, high: FloatArray, enough: float, rigorous: bool
) -> tuple[npt.NDArray[np.bool_], FloatArray]:
    """Return in which boxes (n, B) a point misses its target, and the joints' weights, (n, B).

    By more than its tolerance and `enough`. In interval arithmetic, or in plain numbers.
    """

    def number(array: FloatArray) -> Number:
        return Interval(array, array) if rigorous else array

    weights, none = np.zeros(low.shape), np.zeros(low.shape[1])
    turning = not motions[0]["prismatic"]
    ball: Vector = [number(none + entry) for entry in point["start"]]
    at, radius, moved = ball, number(none), []
    for motion in reversed(motions[1:] if turning else motions):
        axis, frame = motion["axis"], motion["placement"]
        middle, half = _interval(motion, low, high, rigorous)
        cosine, sine = none + 1.0, none
        if motion["prismatic"]:
            ball, at = (_sum(v, [middle * x for x in axis]) for v in (ball, at))
            far, slope, radius = none + 1.0, axis, radius + half
        else:
            cosine, sine = _cos_sin(middle, rigorous)
            along, off = _off(axis, ball)
            far = _root(_dot(off, off))
            narrow_cosine, narrow_sine = _cos_sin(np.minimum(half, np.pi / 2), rigorous)
            ball = _turned(axis, _times(off, narrow_cosine), cosine, sine)
            ball = _sum(ball, [along * x for x in axis])
            radius, far = radius + far * narrow_sine, far + radius
            at = _turned(axis, at, cosine, sine)
            slope = _cross(axis, at)
        weights[motion["joint"]] += top(far) * half
        moved.append((axis, cosine, sine, frame, slope, far, half))
        ball, at = ([_dot(v, row[:3]) + row[3] for row in frame[:3]] for v in (ball, at))
    target: Vector = [number(none + entry) for entry in point["target"]]
    axis, middle, half = [0.0, 0.0, 1.0], none, none
    if turning:
        axis, frame = motions[0]["axis"], motions[0]["placement"]
        middle, half = _interval(motions[0], low, high, rigorous)
        shifted = [entry - row[3] for entry, row in zip(target, frame[:3], strict=True)]
        target = [_dot(shifted, [row[k] for row in frame[:3]]) for k in range(3)]
    arc = _cos_sin(np.minimum(half, np.pi), rigorous)
    height, across = _off(axis, _turned(axis, target, *_cos_sin(-middle, rigorous)))
    if turning:
        weights[motions[0]["joint"]] += top(_root(_dot(across, across))) * half
    enough = enough + point["tolerance"]
    along, off = _off(axis, ball)
    apart, reach = along - height, radius + enough
    gap = apart * apart + _dot(off, off) + _dot(across, across)
    gap = gap - _largest(axis, off, across, *arc) * 2.0
    away = bottom(gap) > top(reach * reach)
    # Any direction will do: towards the target's nearest place, by plain numbers.
    plain, middles = _middle(across), _middle(at)
    beside = _middle(_off(axis, middles)[1])
    angle = np.arctan2(_dot(_cross(axis, plain), beside), _dot(plain, beside))
    angle = np.clip(angle, -half, half)
    nearest = np.array(_turned(axis, plain, np.cos(angle), np.sin(angle)))
    nearest += np.outer(axis, (bottom(height) + top(height)) / 2)
    direction: Vector = list(middles - nearest)
    sizes = np.maximum(np.sqrt(_dot(direction, direction)), 1e-300)
    direction = [number(entry / sizes) for entry in direction]
    along, own = _off(axis, direction)
    size = _root(_dot(direction, direction))
    least = _dot(direction, at) - along * height - size * enough
    before = number(none)
    for axis_here, cosine, sine, frame, slope, far, half in reversed(moved):
        direction = [_dot(direction, [row[k] for row in frame[:3]]) for k in range(3)]
        second = far * size * (before + half * 0.5)
        least = least - (abs(_dot(direction, slope)) + second) * half
        before = before + half
        direction = _turned(axis_here, direction, cosine, -sine)
    return away | (bottom(least) > top(_largest(axis, own, across, *arc))), weights


if __name__ == "__main__":
    print(f"proved: {check(json.loads(Path(sys.argv[1]).read_text('utf-8')))} leaves")
