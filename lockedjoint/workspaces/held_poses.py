"""Configurations of an arm that holds one orientation of its tool, by inverse kinematics.

What comes in: points, shape (k, 3), in the frame of joint 1. What goes out: configurations,
shape (k, n), whose tool is at these points in the orientation that is held. `pose_curves` and
`pose_sheets` go on from there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lockedjoint.clearance.link_clearance import LinkClearance
from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import IntArray, rotation_vectors
from lockedjoint.kinematics.inverse import SelfMotionPoses, reach_poses
from lockedjoint.kinematics.serial_chain import (
    Bits,
    at_zero,
    from_first_joint,
    is_planar,
    opened,
    physical_ranges,
)
from lockedjoint.nlp.arrays import FloatArray

# A planar arm holds x, y and the angle about z.
_PLANAR_ROWS = (0, 1, 5)


@dataclass(frozen=True, eq=False)
class HeldPoses:
    """An arm, the orientation that its tool holds, and what its links keep from each other."""

    arm: Chain
    rotation: FloatArray  #: Of the tool in the frame of joint 1, from that at q = 0; (3, 3).
    clearance: LinkClearance | None = None

    @property
    def rows(self) -> list[int]:
        """The rows of the tool's velocity that are held."""
        return list(_PLANAR_ROWS) if is_planar(self.arm) else list(range(6))

    @property
    def spare_joints(self) -> int:
        """How many joints the arm has beyond those that a pose needs."""
        return len(self.arm.joints) - len(self.rows)

    @property
    def ends(self) -> tuple[FloatArray, FloatArray]:
        """The physical limits, (n,) each, without ends where a joint makes a full turn."""
        return opened(self.arm, *np.transpose(physical_ranges(self.arm)))

    def at(self, points: FloatArray) -> SelfMotionPoses:
        """Return the poses of points, (k, 3)."""
        rotations = np.broadcast_to(self.rotation, (len(points), 3, 3))
        return SelfMotionPoses(at_zero(self.arm), self.rows, points, rotations)

    def solved(
        self, points: FloatArray, start: FloatArray, lower: FloatArray, upper: FloatArray
    ) -> tuple[FloatArray, Bits]:
        """Return configurations near starts, (k, n), and which of them reach their points."""
        chain, targets = from_first_joint(self.arm), points.T
        wanted = self.rotation @ chain.tip_at(np.zeros((len(self.arm.joints), 1)))[1][..., 0]

        # The residual is that of `at`. The chain itself computes it twice as fast.
        def residual(which: IntArray, q: FloatArray) -> tuple[FloatArray, FloatArray]:
            tip, turn, matrix = chain.forward(q, self.rows)
            turned = rotation_vectors(np.einsum("ij,kjb->ikb", wanted, turn))
            missing = np.concatenate([targets[:, which] - tip, turned])
            return missing[self.rows], matrix

        return reach_poses(residual, start, lower, upper)

    def random_starts(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Return random configurations within the physical limits, (count, n)."""
        lower, upper = np.transpose(physical_ranges(self.arm))
        return rng.uniform(lower, upper, (count, len(lower)))

    def is_clear(self, q: FloatArray) -> Bits:
        """Return in which configurations, (k, n), links keep their distance."""
        if self.clearance is None:
            return np.ones(len(q), dtype=bool)
        return np.asarray(self.clearance.is_kept(q.T))
