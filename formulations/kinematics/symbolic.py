"""Forward kinematics and the Jacobian of a chain in CasADi, for nonlinear programs.

The twin in NumPy, for many configurations at once, is `formulations.kinematics.forward`.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from formulations.kinematics.chain import Chain, Motion, Transform


def tip_jacobian(chain: Chain, positions: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Jacobian of the tip's point, and the orientation of its link.

    Parameters
    ----------
    chain
        The joints.
    positions
        Symbols of the free joints' positions, radians or metres, shape (n, 1).

    Returns
    -------
    casadi.SX
        Columns (v; ω) as in eq. (21), along the axes of the base, shape (6, n): metres
        or radians per radian or metre.
    casadi.SX
        Rotation from the tip's axes to those of the base, shape (3, 3).
    """
    turn, origin = ca.SX.eye(3), ca.SX.zeros(3)
    screws = []
    for motion in chain.motions:
        turn, start = _moved(turn, origin, motion.placement)
        screws.append((motion, turn @ ca.DM(motion.axis), start))
        turn, origin = _displaced(turn, start, motion, positions)
    turn, origin = _moved(turn, origin, chain.end)
    matrix = ca.SX.zeros(6, len(chain.joints))
    for motion, axis, start in screws:
        if motion.prismatic:
            column = ca.vertcat(axis, ca.SX.zeros(3))
        else:
            column = ca.vertcat(ca.cross(axis, origin - start), axis)
        matrix[:, motion.variable] += motion.multiplier * column
    return matrix, turn


def tip_pose(chain: Chain, positions: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Position (3, 1) and rotation (3, 3) of the tip, symbolically."""
    turn, origin = ca.SX.eye(3), ca.SX.zeros(3)
    for motion in chain.motions:
        turn, origin = displaced(turn, origin, motion, positions)
    turn, origin = _moved(turn, origin, chain.end)
    return origin, turn


def displaced(
    turn: ca.SX, origin: ca.SX, motion: Motion, positions: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Rotation (3, 3) and origin (3, 1) of a frame after a motion, from those before it."""
    return _displaced(*_moved(turn, origin, motion.placement), motion, positions)


def _displaced(
    turn: ca.SX, origin: ca.SX, motion: Motion, positions: ca.SX
) -> tuple[ca.SX, ca.SX]:
    value = motion.multiplier * positions[motion.variable] + motion.offset
    if motion.prismatic:
        return turn, origin + turn @ ca.DM(motion.axis) * value
    return turn @ _rotation(motion.axis, value), origin


def _moved(turn: ca.SX, origin: ca.SX, placement: Transform) -> tuple[ca.SX, ca.SX]:
    pose = np.array(placement)
    return turn @ ca.DM(pose[:3, :3]), origin + turn @ ca.DM(pose[:3, 3])


def _rotation(axis: Sequence[float], angle: ca.SX) -> ca.SX:
    """Rotation by an angle in radians about a unit vector, shape (3, 3)."""
    cross = ca.skew(ca.DM(axis))
    return ca.SX.eye(3) + ca.sin(angle) * cross + (1 - ca.cos(angle)) * (cross @ cross)
