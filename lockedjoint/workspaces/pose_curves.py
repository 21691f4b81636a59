"""Self-motion as curves: of an arm with one joint more than a pose has dimensions.

What comes in: points, shape (k, 3). What goes out: the curves of configurations that hold the
tool at them. A joint may lock at θ, and the pose is kept, if and only if a curve passes θ.
Curves are followed from random configurations; a curve that none leads to is missed.
"""

from __future__ import annotations

import numpy as np

from lockedjoint.kinematics.geometry import IntArray
from lockedjoint.kinematics.inverse import arcs
from lockedjoint.kinematics.serial_chain import Bits
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.workspaces.held_poses import HeldPoses

# Number of random configurations from which the curves of a point are looked for: fewer miss
# more curves.
_MOST_ROUNDS = 8
#: Number of random configurations after which a point that none reached is not tried further.
MOST_FAILED_STARTS = 4
# A tangent of a curve has this length: a shorter one is more exact and takes longer.
_STEP_M_OR_RAD = 0.1
# A configuration is on a curve if it is this near to one of its points. It has to be more than
# half a tangent, or curves are followed twice.
_NEAR_M_OR_RAD = 0.8 * _STEP_M_OR_RAD
# A curve has at most so many tangents in each direction: what is beyond them is missed.
_MOST_TANGENTS = 120
# A slice counts as passed if a curve misses it by less than this share of a slice.
_ROUNDING_SLICES = 1e-6
# A turn has this angle.
_TURN_RAD = 2 * np.pi


def curves_of(
    held: HeldPoses, points: FloatArray, rng: np.random.Generator
) -> list[tuple[IntArray, FloatArray]]:
    """Return the curves of points (k, 3), metres, in the frame of joint 1.

    `held` has the arm, the orientation that its tool keeps, and as `ends` the physical limits,
    two arrays (n,), infinite for a joint that makes a full turn.

    Returns
    -------
    list of (IntArray, FloatArray)
        Which points the curves are of, shape (c,), and the curves, shape (c, steps, n), NaN
        before their beginning and after their end.
    """
    known: list[tuple[IntArray, FloatArray]] = []
    reached_once = np.zeros(len(points), dtype=bool)
    endless = np.isinf(held.ends[0])
    for round_number in range(_MOST_ROUNDS):
        own = np.arange(len(points))
        if round_number >= MOST_FAILED_STARTS:
            own = np.flatnonzero(reached_once)
        if not len(own):
            break
        start = held.random_starts(len(own), rng)
        q, reached = held.solved(points[own], start, *held.ends)
        own, q = own[reached], q[reached]
        reached_once[own] = True
        new = ~_on_known(own, q, known, endless, len(points))
        own, q = own[new], q[new]
        if len(own):
            curves, _, _ = arcs(
                held.at(points[own]), q, *held.ends, _STEP_M_OR_RAD, _MOST_TANGENTS
            )
            known.append((own, curves))
    return known


def _on_known(
    own: IntArray,
    q: FloatArray,
    known: list[tuple[IntArray, FloatArray]],
    endless: Bits,
    point_count: int,
) -> Bits:
    """Return which configurations (k, n) are on a known curve of their point, `own` (k,)."""
    on_known = np.zeros(len(own), dtype=bool)
    for points, curves in known:
        curve_of_point = np.full(point_count, -1)
        curve_of_point[points] = np.arange(len(points))
        has_curve = np.flatnonzero(curve_of_point[own] >= 0)
        away = curves[curve_of_point[own[has_curve]]] - q[has_curve, None]
        away -= np.where(endless, _TURN_RAD * np.round(away / _TURN_RAD), 0.0)
        beyond_end = np.where(np.isnan(away[:, :, 0]), np.inf, 0.0)
        squared_distance = np.nansum(away**2, axis=2) + beyond_end
        on_known[has_curve] |= squared_distance.min(axis=1) < _NEAR_M_OR_RAD**2
    return on_known


def mark_passed(
    marks: dict[int, Bits],
    slices: dict[int, FloatArray],
    held: HeldPoses,
    own: IntArray,
    curves: FloatArray,
) -> None:
    """Mark the slices that curves pass, for the voxels that they are of.

    Parameters
    ----------
    marks
        Which slices are passed in each voxel, by joint, shape (voxels, slices), True or False.
        They are changed in place.
    slices
        Positions of a joint at equal distances, by joint, shape (slices,), radians or metres.
    held
        The arm, whose joints may be continuous.
    own
        The voxel of each curve, shape (c,).
    curves
        Configurations along each curve, shape (c, steps, n), NaN beyond its end.
    """
    for joint, places in slices.items():
        along = (curves[:, :, joint] - places[0]) / (places[1] - places[0])
        ends = along[:, :-1], along[:, 1:]
        next_slice = np.ceil(np.minimum(*ends) - _ROUNDING_SLICES)
        last_slice = np.floor(np.maximum(*ends) + _ROUNDING_SLICES)
        while (passes := next_slice <= last_slice).any():
            curve, step = np.nonzero(passes)
            place = next_slice[curve, step].astype(int)
            if held.arm.joints[joint].continuous:
                place %= len(places)
            marks[joint][own[curve], np.clip(place, 0, len(places) - 1)] = True
            next_slice += 1
