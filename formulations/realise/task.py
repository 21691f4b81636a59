"""Which motions of the end effector the rows of a Jacobian are."""

from __future__ import annotations

from enum import Enum

import numpy as np

from nlp.arrays import FloatArray
from nlp.errors import InputError


class Task(Enum):
    """Rows of the full Jacobian (v; ω) that a task needs.

    PLANAR: (vx, vy). PLANAR_POSE: (vx, vy, ωz). POSITIONAL: (vx, vy, vz).
    ROTATIONAL: (ωx, ωy, ωz). SPATIAL: all six.
    """

    PLANAR = "planar"
    PLANAR_POSE = "planar-pose"
    POSITIONAL = "positional"
    ROTATIONAL = "rotational"
    SPATIAL = "spatial"

    @property
    def rows(self) -> tuple[int, ...]:
        """Rows of the 6×n Jacobian, counted from 0."""
        return _ROWS[self]

    @property
    def in_plane(self) -> bool:
        """Whether all joints move the end effector in the xy-plane."""
        return self in (Task.PLANAR, Task.PLANAR_POSE)

    @property
    def free_directions(self) -> bool:
        """Whether a column leaves the direction of a revolute axis open, or its sign."""
        return self in (Task.PLANAR, Task.POSITIONAL)

    def embed(self, jacobian: FloatArray) -> FloatArray:
        """Return the six rows (v; ω) of the columns, zero where the task says nothing."""
        full = np.zeros((6, jacobian.shape[1]))
        full[list(self.rows)] = jacobian
        return full

    @classmethod
    def of(cls, rows: int, name: str | None = None) -> Task:
        """Return the task of a Jacobian with so many rows; by default the positional of two.

        Raises
        ------
        InputError
            If there is no such task, or it has another number of rows.
        """
        fitting = [task for task in _DEFAULT_FIRST if len(task.rows) == rows]
        if not fitting:
            raise InputError("jacobian", f"of {rows} rows", "2, 3 or 6 rows")
        if name is None:
            return fitting[0]
        for task in fitting:
            if task.value == name:
                return task
        allowed = " or ".join(task.value for task in fitting)
        raise InputError("task", name, f"{allowed} for a Jacobian of {rows} rows")


_ROWS = {
    Task.PLANAR: (0, 1),
    Task.PLANAR_POSE: (0, 1, 5),
    Task.POSITIONAL: (0, 1, 2),
    Task.ROTATIONAL: (3, 4, 5),
    Task.SPATIAL: (0, 1, 2, 3, 4, 5),
}
_DEFAULT_FIRST = (
    Task.PLANAR,
    Task.POSITIONAL,
    Task.PLANAR_POSE,
    Task.ROTATIONAL,
    Task.SPATIAL,
)
