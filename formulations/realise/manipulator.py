"""A manipulator: joints in order, each with an axis, and an end effector."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from formulations.realise.motion import BoolArray, Motion, jacobians, move
from formulations.realise.task import Task
from nlp.arrays import FloatArray, as_floats
from nlp.errors import InputError

# Largest departure of a direction's norm from 1.
DIGITS = 1e-9


def kind_names(prismatic: BoolArray) -> list[str]:
    """Return ``revolute`` or ``prismatic`` for each joint, shape (n,)."""
    return ["prismatic" if one else "revolute" for one in prismatic]


@dataclass(frozen=True, eq=False)
class Manipulator:
    """A serial manipulator in the configuration q = 0 in which it was designed.

    The frame is that of the Jacobian. Joint i moves all that follows it.

    Parameters
    ----------
    directions
        Unit directions of the axes, shape (n, 3), the joint at the base first.
    points
        The point of each axis where the joint sits, shape (n, 3).
    prismatic
        Which joints are prismatic, shape (n,).
    end_effector
        Its position p, shape (3,).
    task
        Which rows of (v; ω) the manipulator is for.
    columns
        The column of the Jacobian that each joint contributes, counted from 0.

    Raises
    ------
    InputError
        If shapes do not agree, an entry is not finite, or a direction has not norm 1.
    """

    directions: FloatArray
    points: FloatArray
    prismatic: BoolArray
    end_effector: FloatArray
    task: Task = Task.SPATIAL
    columns: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.directions)
        shapes = {"directions": (n, 3), "points": (n, 3), "end_effector": (3,)}
        for name, shape in shapes.items():
            value = as_floats(name, getattr(self, name)).copy()
            if n == 0 or value.shape != shape:
                raise InputError(name, f"of shape {value.shape}", "one row of 3 per joint")
            if not np.all(np.isfinite(value)):
                raise InputError(name, "with NaN or infinity", "finite numbers only")
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        norms = np.linalg.norm(self.directions, axis=1)
        if np.max(np.abs(norms - 1)) > DIGITS:
            raise InputError("norms of the directions", norms.tolist(), "1")
        slide = np.array(self.prismatic, dtype=bool)
        if slide.shape != (n,):
            raise InputError("prismatic", f"of shape {slide.shape}", f"shape ({n},)")
        slide.setflags(write=False)
        object.__setattr__(self, "prismatic", slide)
        columns = tuple(int(c) for c in self.columns) or tuple(range(n))
        if sorted(columns) != list(range(n)):
            raise InputError("columns", columns, f"each of 0 to {n - 1} once")
        object.__setattr__(self, "columns", columns)

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return len(self.directions)

    @property
    def kinds(self) -> list[str]:
        """``revolute`` or ``prismatic``, for each joint."""
        return kind_names(self.prismatic)

    @property
    def size(self) -> float:
        """Largest distance between two of the joints and the end effector."""
        places = np.vstack([self.points, self.end_effector])
        span = np.linalg.norm(places[:, None] - places[None], axis=-1)
        return float(np.max(span)) or 1.0

    def arranged(
        self, order: Sequence[int], flips: Sequence[bool] | None = None
    ) -> Manipulator:
        """Return the manipulator with its joints in another order, some of them flipped.

        A flip turns the direction of the axis, so that the column changes its sign. Where the
        task leaves the direction of a revolute axis open (planar, positional) the axis is
        reflected through the end effector besides: another place, the same column.

        Parameters
        ----------
        order
            Which joint of this manipulator comes first, second, …, counted from 0.
        flips
            Whether each joint of the new order is flipped, shape (n,); none if left out.

        Raises
        ------
        InputError
            If the order does not name every joint once, or flips are not one per joint.
        """
        chosen = [int(i) for i in order]
        if sorted(chosen) != list(range(self.joints)):
            allowed = f"each of 0 to {self.joints - 1} once"
            raise InputError("order", ",".join(map(str, order)), allowed)
        flipped = np.zeros(self.joints, dtype=bool) if flips is None else np.asarray(flips)
        if flipped.shape != (self.joints,):
            raise InputError("flips", f"of shape {flipped.shape}", f"shape ({self.joints},)")
        directions, points, prismatic = self.rearranged(np.array(chosen), flipped)
        columns = tuple(self.columns[i] for i in chosen)
        return replace(
            self, directions=directions, points=points, prismatic=prismatic, columns=columns
        )

    def rearranged(
        self, orders: npt.NDArray[np.int64], flips: BoolArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Return directions, points and `prismatic` of many arrangements, unchecked.

        Orders and flips of shape (…, n), as in `arranged`; shapes (…, n, 3) twice, (…, n).
        """
        prismatic, points = self.prismatic[orders], self.points[orders]
        reflected = flips & ~prismatic & self.task.free_directions
        points = np.where(reflected[..., None], 2 * self.end_effector - points, points)
        directions = np.where(flips[..., None], -1.0, 1.0) * self.directions[orders]
        return directions, points, prismatic

    def move(self, displacements: npt.ArrayLike | None = None) -> Motion:
        """Return axes and end effector at q, shape (…, n); at q = 0 if left out."""
        q = np.zeros(self.joints) if displacements is None else self._checked(displacements)
        return move(self.directions, self.points, self.prismatic, self.end_effector, q)

    def pose(self, displacements: npt.ArrayLike | None = None) -> FloatArray:
        """Return the pose of the end effector at q, (…, 4, 4); no rotation at q = 0."""
        moved = self.move(displacements)
        pose = np.zeros((*moved.end_effector.shape[:-1], 4, 4))
        pose[..., :3, :3] = moved.rotations[..., -1, :, :]
        pose[..., :3, 3], pose[..., 3, 3] = moved.end_effector, 1.0
        return pose

    def full_jacobian(self, displacements: npt.ArrayLike | None = None) -> FloatArray:
        """Return (v; ω) at q, shape (…, 6, n), in the frame of the base."""
        return jacobians(self.move(displacements), self.prismatic)

    def jacobian(self, displacements: npt.ArrayLike | None = None) -> FloatArray:
        """Return the rows of `full_jacobian` that the task needs, shape (…, m, n)."""
        return self.full_jacobian(displacements)[..., list(self.task.rows), :]

    def to_dict(self) -> dict[str, object]:
        """Return the axes joint by joint, and the end effector, as plain values."""
        joints = [
            {
                "joint": i,
                "column": self.columns[i],
                "kind": self.kinds[i],
                "direction": self.directions[i].tolist(),
                "point": self.points[i].tolist(),
            }
            for i in range(self.joints)
        ]
        tip = self.end_effector.tolist()
        return {"task": self.task.value, "end_effector": tip, "joints": joints}

    def _checked(self, displacements: npt.ArrayLike) -> FloatArray:
        q = as_floats("displacements", displacements)
        if not q.shape or q.shape[-1] != self.joints or not np.all(np.isfinite(q)):
            allowed = f"finite numbers, {self.joints} per configuration"
            raise InputError("displacements", f"an array of shape {q.shape}", allowed)
        return q
