"""The geometric Jacobian of a chain, symbolically."""

from __future__ import annotations

import casadi as ca
import numpy as np

from formulations.robots.chain import Chain, Motion
from nlp.arrays import FloatArray


def jacobian(chain: Chain, positions: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Jacobian of the tip's point, and the orientation of its link.

    Parameters
    ----------
    chain
        From base to tip.
    positions
        Symbols of the free joints' positions, radians or metres, shape (n, 1).

    Returns
    -------
    casadi.SX
        Columns (v; ω) as in eq. (21), along the axes of the base, shape (6, n): metres or
        radians per radian or metre.
    casadi.SX
        Rotation from the tip's axes to those of the base, shape (3, 3).
    """
    rotation, origin = ca.SX.eye(3), ca.SX.zeros(3)
    screws = []
    for motion in chain.motions:
        rotation, origin = _moved(rotation, origin, np.array(motion.placement))
        axis = rotation @ ca.DM(motion.axis)
        screws.append((motion, axis, origin))
        value = motion.multiplier * positions[motion.variable] + motion.offset
        if motion.translates:
            origin = origin + value * axis
        else:
            rotation = rotation @ _turn(motion, value)
    rotation, origin = _moved(rotation, origin, np.array(chain.end))

    matrix = ca.SX.zeros(6, len(chain.joints))
    for motion, axis, start in screws:
        if motion.translates:
            column = ca.vertcat(axis, ca.SX.zeros(3))
        else:
            column = ca.vertcat(ca.cross(axis, origin - start), axis)
        matrix[:, motion.variable] += motion.multiplier * column
    return matrix, rotation


def _moved(rotation: ca.SX, origin: ca.SX, pose: FloatArray) -> tuple[ca.SX, ca.SX]:
    return rotation @ ca.DM(pose[:3, :3]), origin + rotation @ ca.DM(pose[:3, 3])


def _turn(motion: Motion, angle: ca.SX) -> ca.SX:
    cross = ca.skew(ca.DM(motion.axis))
    return ca.SX.eye(3) + ca.sin(angle) * cross + (1 - ca.cos(angle)) * (cross @ cross)
