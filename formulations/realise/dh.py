"""Denavit–Hartenberg parameters, standard and modified, and the way back."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from formulations.realise.manipulator import Manipulator
from formulations.realise.normals import common_normals
from formulations.realise.task import Task
from nlp.arrays import FloatArray


class Convention(Enum):
    """Order of the elementary motions of a joint.

    STANDARD: Rz(θ) Tz(d) Tx(a) Rx(α), distal frames (Denavit and Hartenberg, 1955).
    MODIFIED: Rx(α) Tx(a) Rz(θ) Tz(d), proximal frames (Craig); a and α of a row are those
    of the link before the joint.
    """

    STANDARD = "standard"
    MODIFIED = "modified"


@dataclass(frozen=True, eq=False)
class DenavitHartenberg:
    """A manipulator as a table, between a base and a tool transform.

    At joint displacement q, θ + q stands for θ of a revolute joint and d + q for d of a
    prismatic one. Angles in radians, lengths in the unit of the manipulator.

    Attributes
    ----------
    convention
        See `Convention`.
    theta, d, a, alpha
        One entry per joint, shape (n,).
    prismatic
        Which joints are prismatic, shape (n,).
    base, tool
        Poses before the first row and after the last, shape (4, 4).
    """

    convention: Convention
    theta: FloatArray
    d: FloatArray
    a: FloatArray
    alpha: FloatArray
    prismatic: np.ndarray[tuple[int], np.dtype[np.bool_]]
    base: FloatArray
    tool: FloatArray

    def to_dict(self) -> dict[str, object]:
        """Return the table row by row, and both transforms, as plain values."""
        rows = [
            {
                "joint": i,
                "kind": "prismatic" if self.prismatic[i] else "revolute",
                "theta": float(self.theta[i]),
                "d": float(self.d[i]),
                "a": float(self.a[i]),
                "alpha": float(self.alpha[i]),
            }
            for i in range(len(self.theta))
        ]
        base, tool = self.base.tolist(), self.tool.tolist()
        return {"convention": self.convention.value, "rows": rows, "base": base, "tool": tool}


def denavit_hartenberg(
    manipulator: Manipulator, convention: Convention = Convention.STANDARD
) -> DenavitHartenberg:
    """Return the parameters of a manipulator.

    The frame before the first joint is at its first common normal, so that θ, d (and in the
    modified convention a, α) of the first row are 0; the last normal ends at the end
    effector. Lengths a are at least 0. Of parallel axes the normals are chosen so that d = 0.
    Axes that are almost, but not quite, parallel have their common normal far away: digits
    of the end effector are lost as that distance grows, as in any such table.
    """
    axes, n = manipulator.directions, manipulator.joints
    normals = common_normals(axes, manipulator.points, manipulator.end_effector)
    across = normals.direction
    before = np.vstack([across[:1], across[:-1]])
    after = np.vstack([axes[1:], axes[-1:]])
    theta = _angles(before, across, axes)
    d = normals.offsets(axes)
    a, alpha = normals.lengths, _angles(axes, after, across)
    tip = np.eye(4)
    tip[:3, 3] = manipulator.end_effector
    if convention is Convention.STANDARD:
        last = _frame(across[-1], axes[-1], manipulator.end_effector)
    else:
        last = _frame(across[-1], axes[-1], normals.start[-1])
        a, alpha = np.append(0.0, a[: n - 1]), np.append(0.0, alpha[: n - 1])
    base = _frame(across[0], axes[0], normals.start[0])
    tool = _inverse(last) @ tip
    return DenavitHartenberg(convention, theta, d, a, alpha, manipulator.prismatic, base, tool)


def manipulator_of(table: DenavitHartenberg, task: Task = Task.SPATIAL) -> Manipulator:
    """Return the manipulator that a table describes; the inverse of `denavit_hartenberg`.

    The end effector's own rotation at zero displacement is left out.
    """
    n = len(table.theta)
    pose = table.base
    directions, points = np.empty((n, 3)), np.empty((n, 3))
    for i in range(n):
        turn = _screw(2, table.theta[i], table.d[i])
        link = _screw(0, table.alpha[i], table.a[i])
        if table.convention is Convention.MODIFIED:
            pose = pose @ link
        directions[i], points[i] = pose[:3, 2], pose[:3, 3]
        pose = pose @ turn
        if table.convention is Convention.STANDARD:
            pose = pose @ link
    tip = (pose @ table.tool)[:3, 3]
    norms = np.linalg.norm(directions, axis=1, keepdims=True)
    return Manipulator(directions / norms, points, table.prismatic, tip, task)


def _angles(start: FloatArray, end: FloatArray, about: FloatArray) -> FloatArray:
    """Angles from one direction to another about a third, each row by itself."""
    sine = np.sum(np.cross(start, end) * about, axis=1)
    angle = np.arctan2(sine, np.sum(start * end, axis=1))
    return np.asarray(np.where(np.abs(angle) == 0, 0.0, angle))


def _frame(x: FloatArray, z: FloatArray, origin: FloatArray) -> FloatArray:
    pose = np.eye(4)
    pose[:3] = np.column_stack([x, np.cross(z, x), z, origin])
    return pose


def _inverse(pose: FloatArray) -> FloatArray:
    inverse = np.eye(4)
    inverse[:3, :3] = pose[:3, :3].T
    inverse[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return inverse


def _screw(axis: int, angle: float, way: float) -> FloatArray:
    """Rotate about a coordinate axis and move along it."""
    pose = np.eye(4)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    pose[i, i] = pose[j, j] = np.cos(angle)
    pose[i, j], pose[j, i] = -np.sin(angle), np.sin(angle)
    pose[axis, 3] = way
    return pose
