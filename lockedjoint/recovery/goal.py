"""Where the tool is to be, and which directions of that count."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import (
    BoolArray,
    IntArray,
    rotation_vector_rates,
    rotation_vectors,
)
from lockedjoint.kinematics.hanging import HangingJoint
from lockedjoint.kinematics.inverse import damped_least_squares
from lockedjoint.kinematics.pose import Pose
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError, of_kind

#: A goal counts as reached this near to it or to its tolerance: metres and radians.
REACHED = 1e-6


@dataclass(frozen=True)
class ToolGoal:
    """A pose of the tool, with tolerances, and the directions that count.

    Parameters
    ----------
    pose
        Position, orientation if it is not free, and tolerances; along the axes of the base.
    directions
        The directions that count: along the axes of the base, or, with frame ``"tip"``, along
        those of the tool at the pose; by default all that the pose states.

    Raises
    ------
    InputError
        If rotations are to count and the pose has no orientation.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> above = lj.ToolGoal(lj.Pose((0.45, 0.2, 0.4)), lj.TaskSpace(("vx", "vy")))
    >>> above.directions.directions
    ('vx', 'vy')
    """

    pose: Pose
    directions: TaskSpace | None = None
    rows: list[int] = field(init=False)

    def __post_init__(self) -> None:
        of_kind("pose", self.pose, Pose, "a Pose")
        of_kind("directions", self.directions, (TaskSpace, type(None)), "a TaskSpace")
        rows = list(self.pose.rows)
        if self.directions is not None:
            rows = self.directions.rows
            if max(rows) > 2 and self.pose.quaternion is None:
                allowed = "linear directions only, where the goal is a position"
                raise InputError("task", ",".join(self.directions.directions), allowed)
        object.__setattr__(self, "rows", rows)

    @property
    def position(self) -> FloatArray:
        """Metres, shape (3,)."""
        return np.array(self.pose.position)

    @property
    def axes(self) -> FloatArray:
        """Columns are the axes along which directions count, shape (3, 3)."""
        along_tip = self.directions is not None and self.directions.frame == "tip"
        return self.pose.rotation if along_tip else np.eye(3)

    @property
    def linear(self) -> list[int]:
        """Linear directions that count, 0 to 2."""
        return [row for row in self.rows if row < 3]

    @property
    def angular(self) -> list[int]:
        """Rotations that count, 0 to 2."""
        return [row - 3 for row in self.rows if row > 2]

    def missing(self, position: FloatArray, rotation: FloatArray) -> FloatArray:
        """Return what is missing from poses (3, B) and (3, 3, B), tolerances not regarded.

        Shape (6, B), metres and rotation vectors along `axes`; zero in directions that do not
        count.
        """
        off = np.zeros((6, position.shape[1]))
        off[:3] = self.axes.T @ (self.position[:, None] - position)
        if self.angular:
            turn = np.einsum("ik,jkb->ijb", self.pose.rotation, rotation)
            off[3:] = self.axes.T @ rotation_vectors(turn)
        off[[row for row in range(6) if row not in self.rows]] = 0.0
        return off

    def distances(self, off: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return by how much tolerances are missed, in metres and radians, shape (B,) each."""
        return (
            np.maximum(np.linalg.norm(off[:3], axis=0) - self.pose.tolerance, 0.0),
            np.maximum(np.linalg.norm(off[3:], axis=0) - self.pose.angle, 0.0),
        )


@dataclass(frozen=True, eq=False)
class GoalResidual:
    """What is missing to a goal, and how it depends on the joints: for least squares."""

    goal: ToolGoal
    chain: Chain
    hanging: HangingJoint | None = None  #: The joint that has to hang, if any.

    def __call__(self, which: IntArray, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what is missing at configurations (n, B), (m, B), and Jacobians (m, n, B)."""
        del which
        goal = self.goal
        position, rotation, matrix = self.chain.forward(q)
        off = goal.missing(position, rotation)
        matrix = np.einsum("ji,jnb->inb", np.kron(np.eye(2), goal.axes), matrix)
        if 0 < len(goal.angular) < 3:
            turn = np.einsum("ik,jkb->ijb", goal.pose.rotation, rotation)
            rates = rotation_vector_rates(goal.axes.T @ rotation_vectors(turn))
            matrix[3:] = np.einsum("bij,jnb->inb", rates, matrix[3:])
        for part, tolerance in ((off[:3], goal.pose.tolerance), (off[3:], goal.pose.angle)):
            if tolerance:  # to the nearest that is good enough, a little inside
                size = np.linalg.norm(part, axis=0)
                inside = np.maximum(tolerance - REACHED / 2, 0.0)
                part *= np.maximum(1 - inside / np.maximum(size, 1e-300), 0.0)
        off, matrix = off[goal.rows], matrix[goal.rows]
        if self.hanging is not None:
            angle, slopes = self.hanging.off(q)
            off, matrix = np.vstack([off, -angle]), np.concatenate([matrix, slopes[None]])
        return off, matrix

    def solved(
        self,
        start: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        steps: int = 60,
        damping: float = 1e-10,
        largest: float = 1.0,
    ) -> tuple[FloatArray, BoolArray]:
        """Return configurations (n, B) towards the goal from starts, and which are there."""
        limits = {"reached": REACHED, "damping": damping, "largest": largest}
        return damped_least_squares(self, start, lower, upper, steps=steps, **limits)
