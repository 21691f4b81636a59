"""A manipulator: joints in order, each with an axis, and an end effector with a task.

n joints, m task rows. A column (v; ω) is the linear velocity of the end effector, in units of
length per unit of the joint, and its angular velocity. Axes are unit vectors, shape (n, 3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from html import escape
from typing import Any

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations.io.table import written
from lockedjoint.kinematics.geometry import BoolArray, IntArray, homogeneous
from lockedjoint.kinematics.joint_axes import JointAxes
from lockedjoint.nlp.arrays import FloatArray, as_floats
from lockedjoint.nlp.errors import InputError


def kind_names(prismatic: BoolArray) -> list[str]:
    """Return ``revolute`` or ``prismatic`` for each joint, shape (n,)."""
    return ["prismatic" if slides else "revolute" for slides in prismatic]


class TaskRows(StrEnum):
    """Rows of the full Jacobian (v; ω) that a task needs.

    PLANAR: (vx, vy). POSITIONAL: (vx, vy, vz). PLANAR_POSE: (vx, vy, ωz).
    ROTATIONAL: (ωx, ωy, ωz). SPATIAL: all six. Of tasks with as many rows, the first one is
    the default.
    """

    PLANAR = "planar"
    POSITIONAL = "positional"
    PLANAR_POSE = "planar-pose"
    ROTATIONAL = "rotational"
    SPATIAL = "spatial"

    @property
    def rows(self) -> list[int]:
        """Rows of the 6×n Jacobian, counted from 0."""
        return {
            TaskRows.PLANAR: [0, 1],
            TaskRows.POSITIONAL: [0, 1, 2],
            TaskRows.PLANAR_POSE: [0, 1, 5],
            TaskRows.ROTATIONAL: [3, 4, 5],
            TaskRows.SPATIAL: [0, 1, 2, 3, 4, 5],
        }[self]

    @property
    def in_plane(self) -> bool:
        """Whether all joints move the end effector in the xy-plane."""
        return self in (TaskRows.PLANAR, TaskRows.PLANAR_POSE)

    @property
    def free_directions(self) -> bool:
        """Whether a column leaves the direction of a revolute axis open, or its sign."""
        return self in (TaskRows.PLANAR, TaskRows.POSITIONAL)

    def embed(self, jacobian: FloatArray) -> FloatArray:
        """Return the six rows (v; ω) of the columns, zero where the task has no row."""
        full = np.zeros((6, jacobian.shape[1]))
        full[self.rows] = jacobian
        return full

    @classmethod
    def of(cls, rows: int, name: str | None = None) -> TaskRows:
        """Return the task of a Jacobian with so many rows, by its name or the default one.

        Raises
        ------
        InputError
            If there is no such task, or it has another number of rows.
        """
        fitting = [task for task in cls if len(task.rows) == rows]
        if not fitting:
            raise InputError("jacobian", f"of {rows} rows", "2, 3 or 6 rows")
        if name is None:
            return fitting[0]
        if not isinstance(name, str) or name not in fitting:
            allowed = f"{' or '.join(fitting)} for a Jacobian of {rows} rows"
            raise InputError("space", name, allowed)
        return cls(name)


@dataclass(frozen=True, eq=False, repr=False)
class Manipulator(JointAxes):
    """A serial manipulator in the configuration q = 0 in which it was designed.

    The frame is that of the Jacobian. Joint i moves all that follows it.

    Parameters
    ----------
    directions, points, prismatic, end_effector
        See `JointAxes`; without leading dimensions.
    task
        Which rows of (v; ω) the manipulator is for.
    columns
        The column of the Jacobian that each joint contributes, counted from 0.
    speeds
        By what a joint's column is multiplied in `jacobian`, shape (n,): of a prismatic joint
        the norm of v of its column, 1 of a revolute one.
    """

    task: TaskRows = TaskRows.SPATIAL
    columns: tuple[int, ...] = ()
    speeds: FloatArray = field(default_factory=lambda: np.ones(0))

    def __post_init__(self) -> None:
        """Make arrays that nobody can change, and columns and speeds where left out."""
        n = len(self.directions)
        object.__setattr__(self, "columns", tuple(map(int, self.columns)) or tuple(range(n)))
        speeds = self.speeds if len(self.speeds) else np.ones(n)
        arrays = {"speeds": np.array(speeds), "prismatic": np.array(self.prismatic, bool)}
        for name in ("directions", "points", "end_effector"):
            arrays[name] = np.array(getattr(self, name), dtype=float)
        for name, value in arrays.items():
            value.setflags(write=False)
            object.__setattr__(self, name, value)

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
        """Largest distance between two of the points and the end effector; 1 if it is 0."""
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
            If the order does not name every joint once.
        """
        chosen = [int(i) for i in order]
        if sorted(chosen) != list(range(self.joints)):
            allowed = f"each of 0 to {self.joints - 1} once"
            raise InputError("order", ",".join(map(str, order)), allowed)
        flipped = np.zeros(self.joints, dtype=bool) if flips is None else np.asarray(flips)
        columns = tuple(self.columns[i] for i in chosen)
        chain = self.rearranged(np.array(chosen), flipped)
        return replace(self, **vars(chain), columns=columns, speeds=self.speeds[chosen])

    def rearranged(self, orders: IntArray, flips: BoolArray) -> JointAxes:
        """Return many arrangements, unchecked; orders and flips as in `arranged`, (…, n)."""
        prismatic, points = self.prismatic[orders], self.points[orders]
        reflected = flips & ~prismatic & self.task.free_directions
        points = np.where(reflected[..., None], 2 * self.end_effector - points, points)
        directions = np.where(flips[..., None], -1.0, 1.0) * self.directions[orders]
        return JointAxes(directions, points, prismatic, self.end_effector)

    def pose(self, displacements: npt.ArrayLike | None = None) -> FloatArray:
        """Return the pose of the end effector at q, (…, 4, 4); no rotation at q = 0."""
        chain, rotation = self.moved(self._checked(displacements))
        return homogeneous(rotation, chain.end_effector)

    def full_jacobian(self, displacements: npt.ArrayLike | None = None) -> FloatArray:
        """Return (v; ω) at q, shape (…, 6, n), in the frame of the base; q = 0 if left out.

        Every prismatic joint moves at unit speed.
        """
        return self.moved(self._checked(displacements))[0].velocities()

    def jacobian(self, displacements: npt.ArrayLike | None = None) -> FloatArray:
        """Return the rows that the task needs, (…, m, n): of `full_jacobian` times `speeds`."""
        return self.full_jacobian(displacements)[..., self.task.rows, :] * self.speeds

    def to_dict(self) -> dict[str, Any]:
        """Return the axes joint by joint, and the end effector, as plain values."""
        names = ("joint", "column", "kind", "speed", "direction", "point")
        values = (self.speeds.tolist(), self.directions.tolist(), self.points.tolist())
        joints = zip(range(self.joints), self.columns, self.kinds, *values, strict=True)
        return {
            "task": self.task.value,
            "end_effector": self.end_effector.tolist(),
            "joints": [dict(zip(names, joint, strict=True)) for joint in joints],
        }

    def __repr__(self) -> str:
        """Say in one line the joints from base to tip, the task and the order of columns."""
        kinds = "".join(kind[0].upper() for kind in self.kinds)
        order = " ".join(map(str, self.columns))
        return f"<Manipulator: {kinds}, {self.task.value}, columns {order} from base to tip>"

    def _repr_html_(self) -> str:
        """Return the line and the axes, for notebooks."""
        heads = ["joint", "column", "kind", *(f"axis {c}" for c in "xyz"), *"xyz"]
        numbers = np.hstack([self.directions, self.points])
        rows = zip(range(self.joints), self.columns, self.kinds, numbers, strict=True)
        cells = [
            [str(joint), str(column), kind, *(f"{number:.6f}" for number in row)]
            for joint, column, kind, row in rows
        ]
        return f"<p>{escape(repr(self))}</p>{written(cells, heads, 'html')}"

    def _checked(self, displacements: npt.ArrayLike | None) -> FloatArray:
        """Return q, shape (…, n); 0 if left out. InputError if it is no such array."""
        if displacements is None:
            return np.zeros(self.joints)
        q = as_floats("displacements", displacements)
        if not q.shape or q.shape[-1] != self.joints or not np.all(np.isfinite(q)):
            allowed = f"finite numbers, {self.joints} per configuration"
            raise InputError("displacements", f"an array of shape {q.shape}", allowed)
        return q
