"""A bound on isotropic arms of five revolute and two prismatic joints, by branch and bound.

J, shape (6, 7), has the columns (v_i; ω_i), |ω_i| = 1 and v_i·ω_i = 0, of five revolute joints,
and (v; 0) with |v| = 1 of two prismatic ones. The worst case is that after one locked joint.

JJᵀ = (5/3)I, because the three rotational rows have the trace 5. Five angles φ_i and five
numbers r_i describe the revolute joints (docs/several_failures.md). The square of the worst
case is (2/15) min cos²φ_i, and with ζ_i = exp(2iφ_i)

    Σ ζ_i = 0,   Σ r_i = 0,   Σ r_i ζ_i = 0,   Σ r_i² (ζ_i − 1/9) = 0,   r ≠ 0.

r may have length 1, because the equations are homogeneous in it. A box of angles is the set of
all 2φ_i within `radii` of `middles`, both of shape (boxes, 5), in radians.

The search excludes all angles 2φ_1 ≤ … ≤ 2φ_5 with cos²φ_i ≥ c: it halves boxes of angles until
one of the equations cannot hold in each. In a box the vectors r that satisfy the linear
equations are near a plane, the kernel at its middle, and there the last sum is on an ellipse of
the complex plane. The prismatic joints have the speed 1; lever arms have any length.

All numbers are in double precision. `_ROUNDING` covers what they lose, some 1e-14 for numbers
of size 1.
"""

import math
from fractions import Fraction
from functools import cache
from typing import Any, TypeAlias

import numpy as np

from lockedjoint.formulations.bounds.rational_roots import root_above
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import LeverRevolute, Prismatic, UnitRevolute
from lockedjoint.nlp.arrays import FloatArray

BoolArray: TypeAlias = np.ndarray[tuple[Any, ...], np.dtype[np.bool_]]

#: What min cos²φ_i is proved to be below; 0.228657 is attained, so it cannot be much smaller.
SHARE = Fraction(2288, 10_000)
# Number of revolute joints.
_REVOLUTE = 5
# The square of the worst case is this times min cos²φ_i.
_SCALE = Fraction(2, 15)
# The rounding that every comparison allows. A larger one needs smaller boxes; one below 1e-14
# would make the proof wrong.
_ROUNDING = 1e-9
# Singular value below which the kernel of the linear equations, or the map of an ellipse to a
# circle, is not used: rounding would count too much.
_REGULAR = 1e-6
# Number of boxes that are looked at together. More take more memory.
_TOGETHER = 20_000
# Number of boxes after which the search gives up; that for `SHARE` looks at 240 000.
_MOST = 1_000_000


def has_five_levers(arm: Arm) -> bool:
    """Whether the bound holds for an arm: five revolute joints without pitch, two prismatic."""
    revolute = sum(map(_is_revolute, arm.joints))
    prismatic = sum(one == Prismatic(1.0) for one in arm.joints)
    return (revolute, prismatic, len(arm.joints)) == (_REVOLUTE, 2, _REVOLUTE + 2)


def _is_revolute(joint: object) -> bool:
    """Whether v·ω = 0 and |ω| = 1 for every column of a joint."""
    if isinstance(joint, LeverRevolute):
        return not joint.pitch
    return type(joint) is UnitRevolute


def five_levers_bound() -> float:
    """Return what no worst case of such an isotropic arm is above; proved once, on record."""
    return root_above(_SCALE * SHARE)


def proves_five_levers(square: Fraction) -> bool:
    """Whether a new search proves that no squared worst case is above `square`."""
    return square >= _SCALE * SHARE and excludes_share(float(SHARE))


@cache
def excludes_share(share: float) -> bool:
    """Whether a search proves that min cos²φ_i is below `share`, which is between 0 and 1."""
    # cos²φ ≥ share says |2φ| ≤ widest, because cos 2φ = 2cos²φ − 1.
    widest = math.acos(2 * share - 1) + _ROUNDING
    waiting = [(np.zeros((1, _REVOLUTE)), np.full((1, _REVOLUTE), widest))]
    count = 0
    while waiting and count < _MOST:
        middles, radii = waiting.pop()
        count += len(middles)
        kept = ~is_excluded(middles, radii)
        middles, radii = _halves(middles[kept], radii[kept])
        for first in range(0, len(middles), _TOGETHER):
            part = slice(first, first + _TOGETHER)
            waiting.append((middles[part], radii[part]))
    return not waiting


def _halves(middles: FloatArray, radii: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the middles and radii of the halves of boxes, cut across their longest side."""
    rows, longest = np.arange(len(middles)), radii.argmax(axis=1)
    smaller = radii.copy()
    smaller[rows, longest] /= 2
    shift = np.zeros_like(middles)
    shift[rows, longest] = smaller[rows, longest]
    both = np.concatenate([middles - shift, middles + shift])
    return both, np.concatenate([smaller, smaller])


def is_excluded(middles: FloatArray, radii: FloatArray) -> BoolArray:
    """Whether no solution has its angles 2φ in a box, shape (boxes,).

    A box is excluded if Σ ζ_i cannot be 0, if the angles cannot ascend, or if the last equation
    cannot hold. |ζ − ζ'| is at most the difference of the angles.
    """
    points = np.exp(1j * middles)
    excluded = np.abs(points.sum(axis=1)) > radii.sum(axis=1) + _ROUNDING
    least, most = middles - radii, middles + radii
    excluded |= (least[:, :-1] > most[:, 1:] + _ROUNDING).any(axis=1)
    rest = np.flatnonzero(~excluded)
    excluded[rest] = _is_off_ellipse(points[rest], radii[rest])
    return np.asarray(excluded, dtype=np.bool_)


def _is_off_ellipse(points: FloatArray, radii: FloatArray) -> BoolArray:
    """Whether Σ r_i² (ζ_i − 1/9) = 0 has no solution r in a box, |r| = 1, shape (boxes,).

    `points` are ζ at the middle, shape (boxes, 5). There the linear equations leave a plane,
    spanned by `first` and `second`, on which the sum is centre + axes · (cos 2α, sin 2α) at
    r = first · cos α + second · sin α. A solution in the box is off this plane by at most
    `beside`, so that its sum is off the ellipse by at most `slack`.
    """
    rows = np.stack([np.ones_like(points.real), points.real, points.imag], axis=1)
    _, sizes, right = np.linalg.svd(rows)
    first, second = right[:, 3], right[:, 4]
    # The linear equations at the middle are off by at most the change of their rows.
    change = np.sqrt(np.sum(radii**2, axis=1))
    beside = change / np.maximum(sizes[:, 2], _REGULAR) + _ROUNDING
    weights = points - 1 / 9
    largest = np.abs(weights).max(axis=1)
    slack = radii.max(axis=1) + 2 * largest * beside * (1 + beside) + _ROUNDING
    both = _form(weights, first, first), _form(weights, second, second)
    middle, half = (both[0] + both[1]) / 2, (both[0] - both[1]) / 2
    mixed = _form(weights, first, second)
    axes = np.stack(
        [np.stack([half.real, mixed.real], 1), np.stack([half.imag, mixed.imag], 1)], axis=1
    )
    centre = np.stack([middle.real, middle.imag], axis=1)
    distance = _distance_from_ellipse(centre, axes)
    regular = (sizes[:, 2] > _REGULAR) & (beside < 1)
    return np.asarray(regular & (distance > slack), dtype=np.bool_)


def _form(weights: FloatArray, one: FloatArray, other: FloatArray) -> FloatArray:
    """Return Σ weights_i one_i other_i, (boxes,), of arrays (boxes, 5)."""
    return np.asarray(np.sum(weights * one * other, axis=1))


def _distance_from_ellipse(centre: FloatArray, axes: FloatArray) -> FloatArray:
    """Return what the distance of 0 from each ellipse centre + axes·(cos, sin) is not below.

    `centre` has the shape (boxes, 2), `axes` (boxes, 2, 2), the result (boxes,). It is the best
    of three bounds. From outside, a line separates 0 from the ellipse: orthogonal to an axis of
    it (`by_axes`), or to the line from 0 to its centre (`length` − `reach`). From anywhere, the
    map that makes the ellipse a unit circle takes 0 to a point at the distance `mapped` from
    the centre of the circle. A distance is at least its image times the smaller half-axis.
    """
    turn, sizes, _ = np.linalg.svd(axes)
    along = np.einsum("nji,nj->ni", turn, centre)
    by_axes = (np.abs(along) - sizes).max(axis=1)
    length = np.sqrt(np.sum(centre**2, axis=1))
    towards = centre / np.maximum(length, _ROUNDING)[:, None]
    reach = np.sqrt(np.sum(np.einsum("nij,ni->nj", axes, towards) ** 2, axis=1))
    thin = sizes[:, 1] < _REGULAR
    mapped = np.sqrt(np.sum((along / np.maximum(sizes, _REGULAR)) ** 2, axis=1))
    by_circle = np.where(thin, 0.0, sizes[:, 1] * np.abs(mapped - 1))
    return np.asarray(np.maximum.reduce([by_axes, length - reach, by_circle]))
