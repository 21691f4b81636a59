"""Where axes and end effector are when joints move: product of exponentials in NumPy.

Arrays broadcast over leading dimensions, so that many manipulators move at once through many
displacements. Displacements q are radians for revolute joints, the unit of length for
prismatic ones; q = 0 is the configuration in which axes are given.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from nlp.arrays import FloatArray

BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Motion:
    """Axes and end effector after a displacement.

    Attributes
    ----------
    directions, points
        Direction of each axis and the point of it that its joint sits at, (…, n, 3).
    rotations
        Rotation of the link that follows each joint, (…, n, 3, 3).
    end_effector
        Position of the end effector, (…, 3).
    """

    directions: FloatArray
    points: FloatArray
    rotations: FloatArray
    end_effector: FloatArray


def move(
    directions: FloatArray,
    points: FloatArray,
    prismatic: BoolArray,
    end_effector: FloatArray,
    displacements: FloatArray,
) -> Motion:
    """Move joints along the chain, the one at the base first.

    Parameters
    ----------
    directions, points
        Axes at zero displacement, shape (…, n, 3); directions of norm 1.
    prismatic
        Which joints are prismatic, shape (…, n).
    end_effector
        Its position at zero displacement, shape (3,).
    displacements
        q, shape (…, n).
    """
    shape = np.broadcast_shapes(directions.shape[:-1], displacements.shape)
    lead, n = shape[:-1], shape[-1]
    turn = np.broadcast_to(np.eye(3), (*lead, 3, 3))
    shift = np.zeros((*lead, 3))
    moved = Motion(
        np.empty((*shape, 3)), np.empty((*shape, 3)), np.empty((*shape, 3, 3)), shift
    )
    for i in range(n):
        axis, point = directions[..., i, :], points[..., i, :]
        angle = np.where(prismatic[..., i], 0.0, displacements[..., i])
        travel = np.where(prismatic[..., i], displacements[..., i], 0.0)
        here, place = _turned(turn, axis), _turned(turn, point) + shift
        turn = turn @ rotation(axis, angle)
        # A revolute joint leaves its own point where it is, a prismatic one shifts it.
        shift = place - _turned(turn, point) + travel[..., None] * here
        moved.directions[..., i, :], moved.points[..., i, :] = here, place
        moved.rotations[..., i, :, :] = turn
    tip = _turned(turn, end_effector) + shift
    return Motion(moved.directions, moved.points, moved.rotations, tip)


def rotation(axis: FloatArray, angle: FloatArray) -> FloatArray:
    """Rotate about unit axes (…, 3) by angles (…), Rodrigues' formula; (…, 3, 3)."""
    x, y, z = np.moveaxis(axis, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1)
    cross = cross.reshape((*axis.shape[:-1], 3, 3))
    sine = np.sin(angle)[..., None, None]
    versine = 2 * (np.sin(angle / 2) ** 2)[..., None, None]  # 1 − cos, exact for small angles
    return np.asarray(np.eye(3) + sine * cross + versine * (cross @ cross))


def jacobians(moved: Motion, prismatic: BoolArray) -> FloatArray:
    """Return the Jacobians (v; ω) with the end effector as reference point, (…, 6, n)."""
    slide = prismatic[..., None]
    lever = moved.end_effector[..., None, :] - moved.points
    linear = np.where(slide, moved.directions, np.cross(moved.directions, lever))
    angular = np.where(slide, 0.0, moved.directions)
    return np.moveaxis(np.concatenate([linear, angular], axis=-1), -2, -1)


def _turned(turn: FloatArray, vector: FloatArray) -> FloatArray:
    return np.asarray((turn @ vector[..., None])[..., 0])
