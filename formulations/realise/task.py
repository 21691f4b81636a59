"""Which motions of the end effector the rows of a Jacobian are."""

from __future__ import annotations

from enum import Enum

import numpy as np

from nlp.arrays import FloatArray
from nlp.errors import InputError


class Task(Enum):
    """Rows of the full Jacobian (v; ω) that a task needs.

    PLANAR: (vx, vy). POSITIONAL: (vx, vy, vz). PLANAR_POSE: (vx, vy, ωz).
    ROTATIONAL: (ωx, ωy, ωz). SPATIAL: all six. Of tasks with as many rows, the first one is
    the default.

    Attributes
    ----------
    rows
        Rows of the 6×n Jacobian, counted from 0.
    """

    rows: tuple[int, ...]

    PLANAR = "planar", (0, 1)
    POSITIONAL = "positional", (0, 1, 2)
    PLANAR_POSE = "planar-pose", (0, 1, 5)
    ROTATIONAL = "rotational", (3, 4, 5)
    SPATIAL = "spatial", (0, 1, 2, 3, 4, 5)

    def __new__(cls, name: str, rows: tuple[int, ...]) -> Task:
        """Make a member whose value is its name."""
        member = object.__new__(cls)
        member._value_ = name
        member.rows = rows
        return member

    @property
    def in_plane(self) -> bool:
        """Whether all joints move the end effector in the xy-plane."""
        return self in (Task.PLANAR, Task.PLANAR_POSE)

    @property
    def free_directions(self) -> bool:
        """Whether a column leaves the direction of a revolute axis open, or its sign."""
        return self in (Task.PLANAR, Task.POSITIONAL)

    def embed(self, jacobian: FloatArray) -> FloatArray:
        """Return the six rows (v; ω) of the columns, zero where the task has no row."""
        full = np.zeros((6, jacobian.shape[1]))
        full[list(self.rows)] = jacobian
        return full

    @classmethod
    def of(cls, rows: int, name: str | None = None) -> Task:
        """Return the task of a Jacobian with so many rows, by its name or the default one.

        Raises
        ------
        InputError
            If there is no such task, or it has another number of rows.
        """
        fitting = {task.value: task for task in cls if len(task.rows) == rows}
        if not fitting:
            raise InputError("jacobian", f"of {rows} rows", "2, 3 or 6 rows")
        if name is None:
            return next(iter(fitting.values()))
        if name not in fitting:
            allowed = f"{' or '.join(fitting)} for a Jacobian of {rows} rows"
            raise InputError("task", name, allowed)
        return fitting[name]
