"""Axes of joints, moved by the product of exponentials in NumPy.

Arrays broadcast over leading dimensions, so that many different arms move at once through many
displacements; one robot's chain moves faster by `Chain.frames`. Displacements q are radians for
revolute joints, the unit of length for prismatic ones; q = 0 is the configuration in which axes
are given.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lockedjoint.kinematics.geometry import BoolArray, IntArray, rotation
from lockedjoint.nlp.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class JointAxes:
    """Axes of joints in order, the one at the base first, and an end effector.

    Dimensions in front, …, are those of many arms or displacements; there may be none.
    """

    directions: FloatArray  #: Unit vectors along the axes, shape (…, n, 3).
    points: FloatArray  #: The point of each axis where the joint sits, shape (…, n, 3).
    prismatic: BoolArray  #: Which joints are prismatic, shape (…, n).
    end_effector: FloatArray  #: Its position p, shape (…, 3).

    def moved(self, displacements: FloatArray) -> tuple[JointAxes, FloatArray]:
        """Return the chain at q, shape (…, n), and how its last link has turned, (…, 3, 3)."""
        # A point x of the link after joint i is now at orientation · x + shift.
        shape = np.broadcast_shapes(self.prismatic.shape, displacements.shape)
        orientation = np.broadcast_to(np.eye(3), (*shape[:-1], 3, 3))
        shift = np.zeros((*shape[:-1], 3))
        directions, points = np.empty((*shape, 3)), np.empty((*shape, 3))
        # The turns of all joints are computed at once: one call for each joint takes longer.
        turns = rotation(self.directions, np.where(self.prismatic, 0.0, displacements))
        for i in range(shape[-1]):
            axis, point = self.directions[..., i, :], self.points[..., i, :]
            prismatic, q = self.prismatic[..., i], displacements[..., i]
            here, away = _rotated(orientation, axis), _rotated(orientation, point)
            directions[..., i, :], points[..., i, :] = here, away + shift
            orientation = orientation @ turns[..., i, :, :]
            # A revolute joint leaves its own point where it is, a prismatic one shifts it.
            travel = np.where(prismatic, q, 0.0)[..., None] * here
            shift = points[..., i, :] - _rotated(orientation, point) + travel
        tip = _rotated(orientation, self.end_effector) + shift
        return JointAxes(directions, points, self.prismatic, tip), orientation

    def chosen(self, which: BoolArray | IntArray) -> JointAxes:
        """Return some of many chains, by a mask or numbers of the first dimension.

        They share one end effector, of shape (3,).
        """
        directions, points = self.directions[which], self.points[which]
        return JointAxes(directions, points, self.prismatic[which], self.end_effector)

    def velocities(self) -> FloatArray:
        """Return the Jacobian (v; ω), reference point the end effector, shape (…, 6, n)."""
        # Columns are (a × (p − x); a) of revolute joints, (a; 0) of prismatic ones.
        prismatic = self.prismatic[..., None]
        lever = self.end_effector[..., None, :] - self.points
        linear = np.where(prismatic, self.directions, np.cross(self.directions, lever))
        angular = np.where(prismatic, 0.0, self.directions)
        return np.moveaxis(np.concatenate([linear, angular], axis=-1), -2, -1)


def _rotated(orientation: FloatArray, vector: FloatArray) -> FloatArray:
    """Return vectors (…, 3) turned by rotations (…, 3, 3)."""
    return np.asarray((orientation @ vector[..., None])[..., 0])
