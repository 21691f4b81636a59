"""Forward kinematics and the Jacobian as symbols: of a chain, and of all bodies of a robot.

A chain has n free joints and k motions, at least n: a joint that others follow has several.
Columns are (v; ω) along the axes of the base, in metres and radians: (a × (p − o); a) of a
motion about an axis a through o, with the tip's point p, and (a; 0) of one along it.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.motion import Bodies, Transform


def tip_kinematics(chain: Chain, positions: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return the Jacobian (v; ω), as in eq. (21), shape (6, n), and where the tip is.

    Of symbols of the free joints' positions, shape (n, 1); along the axes of the base, in
    metres and radians. The position of the tip's point has shape (3, 1), the rotation from its
    axes to those of the base (3, 3).
    """
    columns, tip, orientation = motion_columns(chain, positions)
    return of_joints(chain, columns), tip, orientation


def motion_columns(chain: Chain, positions: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return the same with a column for each motion, shape (6, k): some follow a joint."""
    rotations, origins, axes = body_frames(tuple(enumerate(chain.motions)), positions)
    orientation, tip = _moved(rotations[-1], origins[-1], chain.end)
    columns = []
    for motion, axis, origin in zip(chain.motions, axes, origins[1:], strict=True):
        column = ca.vertcat(ca.cross(axis, tip - origin), axis)
        columns.append(ca.vertcat(axis, ca.SX.zeros(3)) if motion.prismatic else column)
    return ca.horzcat(*columns), tip, orientation


def of_joints(chain: Chain, columns: ca.SX) -> ca.SX:
    """Return columns of the joints, shape (6, n), from those of the motions, shape (6, k)."""
    matrix = ca.SX.zeros(6, len(chain.joints))
    for k, motion in enumerate(chain.motions):
        matrix[:, motion.variable] += motion.multiplier * columns[:, k]
    return matrix


def body_frames(
    bodies: Bodies, positions: ca.SX
) -> tuple[list[ca.SX], list[ca.SX], list[ca.SX]]:
    """Return where bodies are, from symbols of the joints' positions.

    Rotations (3, 3) and origins (3, 1), the fixed body's first, and the axes of the motions,
    (3, 1), in the frame of that body.
    """
    rotations, origins, axes = [ca.SX.eye(3)], [ca.SX.zeros(3)], []
    for parent, motion in bodies:
        rotation, origin = _moved(rotations[parent], origins[parent], motion.placement)
        axes.append(rotation @ ca.DM(motion.axis))
        value = motion.multiplier * positions[motion.variable] + motion.offset
        if motion.prismatic:
            origin = origin + axes[-1] * value
        else:
            cross = ca.skew(ca.DM(motion.axis))
            versine = (1 - ca.cos(value)) * (cross @ cross)
            rotation = rotation @ (ca.SX.eye(3) + ca.sin(value) * cross + versine)
        rotations.append(rotation)
        origins.append(origin)
    return rotations, origins, axes


def _moved(orientation: ca.SX, origin: ca.SX, placement: Transform) -> tuple[ca.SX, ca.SX]:
    """Return rotation (3, 3) and origin (3, 1) of the frame that is placed in a given one."""
    pose = np.array(placement)
    return orientation @ ca.DM(pose[:3, :3]), origin + orientation @ ca.DM(pose[:3, 3])
