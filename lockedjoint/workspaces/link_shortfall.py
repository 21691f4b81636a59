"""How much the links of an arm with a locked joint are too short, or too long, for a point.

Two neighbours of a chain's points, one on the axis of each revolute joint and the tip, stay as
far apart as they are. If a joint locks, the points before and after it do so as well. Distances
that are given allow the tip to be in a ring, or a shell, about the first point that moves
nothing: what is beyond it needs no inverse kinematics to be out of reach.
"""

from __future__ import annotations

import numpy as np

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import rotation
from lockedjoint.kinematics.serial_chain import Bits, at_zero, is_planar, link_lengths
from lockedjoint.nlp.arrays import FloatArray

# Points that links are too short for by at most this share of their sum are looked at by
# inverse kinematics: it is more than what that calls reached.
_SPARE_SHARE = 1e-3


def links_suffice(arm: Chain, points: FloatArray, lower: FloatArray, upper: FloatArray) -> Bits:
    """Return for which points links may be long and short enough, shape (k,).

    Points are (k, 3), in the frame of joint 1, and limits those of each point, (k, n): equal
    ones are a locked joint.
    """
    suffice = np.ones(len(points), dtype=bool)
    most = _SPARE_SHARE * float(np.sum(link_lengths(arm)))
    for joint in range(len(arm.joints)):
        locked = np.flatnonzero(lower[:, joint] == upper[:, joint])
        if locked.size:
            places = lower[locked, joint]
            suffice[locked] &= link_shortfall(arm, points[locked], joint, places) <= most
    return suffice


def link_shortfall(
    arm: Chain, points: FloatArray, joint: int, places: FloatArray
) -> FloatArray:
    """Return how far points are from where the tip can be with a joint locked, at least, (k,).

    Parameters
    ----------
    arm
        Of revolute joints: of an arm with others all results are 0.
    points
        Points in the frame of joint 1, shape (k, 3), in metres.
    joint
        The number of the joint that is locked.
    places
        Where it is locked for each point, shape (k,), in radians.
    """
    if any(arm.prismatic):
        return np.zeros(len(points))
    axes = at_zero(arm)
    # Heights of the links of a planar arm do not matter.
    wide = 2 if is_planar(arm) else 3
    stations = np.concatenate([axes.points[0], axes.end_effector[None]])
    links = np.diff(stations, axis=0)
    turned = rotation(np.broadcast_to(axes.directions[0, joint], (len(points), 3)), places)
    after = turned @ links[joint]
    lengths = np.linalg.norm(links[:, :wide], axis=1)
    if joint == 0:
        base, rest = (stations[0] + after)[:, :wide], lengths[1:]
        sides = [np.broadcast_to(rest, (len(points), len(rest)))]
    else:
        base, rest = stations[0, :wide], np.delete(lengths, [joint - 1, joint])
        bridge = np.linalg.norm((links[joint - 1] + after)[:, :wide], axis=1)
        sides = [np.broadcast_to(rest, (len(points), len(rest))), bridge[:, None]]
    free = np.concatenate(sides, axis=1)
    longest, total = free.max(axis=1), free.sum(axis=1)
    distance = np.linalg.norm(points[:, :wide] - base, axis=1)
    return np.asarray(np.maximum(distance - total, 2 * longest - total - distance))
