"""Poses that the tool is to reach, as inverse kinematics takes them.

Arrays have configurations last: B of them, or 1 where one pose is for all. Lengths are metres,
along the axes of the base; (v; ω) are three linear and three angular directions, rows 0 to 5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lockedjoint.kinematics.geometry import BoolArray, IntArray, rotation_vectors
from lockedjoint.nlp.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class ToolPoses:
    """One pose of the tool for all of B configurations, or one for each."""

    position: FloatArray  #: Metres, along the axes of the base, shape (3, 1) or (3, B).
    #: From the axes of the tool to those of the base, shape (3, 3, 1) or (3, 3, B).
    rotation: FloatArray
    rows: Sequence[int]  #: Those of (v; ω) that count.

    def chosen(self, which: BoolArray | IntArray) -> ToolPoses:
        """Return some of the poses, or the only one, which is for all."""
        if self.position.shape[-1] == 1:
            return self
        position = np.take(self.position, which, axis=1)
        return ToolPoses(position, np.take(self.rotation, which, axis=2), self.rows)

    def missing(self, position: FloatArray, orientation: FloatArray) -> FloatArray:
        """Return what is missing from the tool's position, (3, B), and orientation, (3, 3, B).

        It has the rows that count, shape (rows, B): of a shift in metres and of a rotation
        vector in radians, both along the axes of the base.
        """
        off = self.position - position
        if max(self.rows) < 3:
            return np.asarray(off[list(self.rows)])
        # The product is R·R_nowᵀ of the wanted and the present rotation.
        product = np.einsum(
            "ikb,jkb->ijb", np.broadcast_to(self.rotation, orientation.shape), orientation
        )
        return np.concatenate([off, rotation_vectors(product)])[list(self.rows)]
