"""Denavit–Hartenberg parameters, standard and modified, from the common normals of the axes."""

from dataclasses import dataclass
from enum import StrEnum
from itertools import count

import numpy as np

from lockedjoint.kinematics.geometry import BoolArray, homogeneous
from lockedjoint.kinematics.joint_axes import JointAxes
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.synthesis.manipulator import Manipulator, kind_names

# Axes whose directions differ by less count as parallel: their common normal is not unique.
_PARALLEL = 1e-9


class Convention(StrEnum):
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
    prismatic one. Angles in radians, lengths in the unit of the manipulator: one entry per
    joint, shape (n,). Base and tool are poses before the first row and after the last, (4, 4).
    """

    convention: Convention
    theta: FloatArray
    d: FloatArray
    a: FloatArray
    alpha: FloatArray
    prismatic: BoolArray
    base: FloatArray
    tool: FloatArray

    def rows(self) -> list[dict[str, object]]:
        """Return the rows as plain values: number and kind of the joint, θ, d, a, α."""
        columns = self.theta.tolist(), self.d.tolist(), self.a.tolist(), self.alpha.tolist()
        names = ("joint", "kind", "theta", "d", "a", "alpha")
        joints = zip(count(), kind_names(self.prismatic), *columns)
        return [dict(zip(names, joint, strict=True)) for joint in joints]

    def csv(self) -> str:
        """Return the table as `lockedjoint.kinematics.read_robot` reads it, with every digit.

        The base and the tool are two fixed rows each.
        """
        own = [list(row.values())[1:] for row in self.rows()]
        base, tool = (_fixed_rows(pose, self.convention) for pose in (self.base, self.tool))
        lines = [",".join(map(str, row)) for row in (*base, *own, *tool)]
        head = f"# convention: {self.convention}", "kind,theta_rad,d,a,alpha_rad"
        return "\n".join([*head, *lines, ""])

    def to_dict(self) -> dict[str, object]:
        """Return the table row by row, and both transforms, as plain values."""
        return {
            "convention": str(self.convention),
            "rows": self.rows(),
            "base": self.base.tolist(),
            "tool": self.tool.tolist(),
        }


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
    normals = common_normals(manipulator)
    across = normals.direction
    before = np.vstack([across[:1], across[:-1]])
    after = np.vstack([axes[1:], axes[-1:]])
    theta = _angles(before, across, axes)
    d = normals.offsets(axes)
    a, alpha = normals.lengths, _angles(axes, after, across)
    if convention is Convention.STANDARD:
        last = _frame(across[-1], axes[-1], manipulator.end_effector)
    else:
        last = _frame(across[-1], axes[-1], normals.start[-1])
        a, alpha = np.append(0.0, a[: n - 1]), np.append(0.0, alpha[: n - 1])
    base = _frame(across[0], axes[0], normals.start[0])
    tool = np.linalg.inv(last) @ manipulator.pose()
    return DenavitHartenberg(convention, theta, d, a, alpha, manipulator.prismatic, base, tool)


def _fixed_rows(pose: FloatArray, convention: Convention) -> list[list[object]]:
    """Return two rows whose product is a pose: Rz(θ₁) Tz(d₁) Tx(a) Rx(α) Rz(θ₂) Tz(d₂)."""
    first, last, place = np.eye(3)[2], pose[:3, 2], pose[:3, 3]
    across = np.cross(first, last)
    parallel = np.linalg.norm(across) < _PARALLEL
    if parallel:
        across = np.array([*place[:2], 0.0]) if np.any(place[:2]) else np.eye(3)[0]
    x = across / np.linalg.norm(across)
    axes = np.stack([first, x, np.cross(first, x) if parallel else last], axis=1)
    d1, a, d2 = np.linalg.solve(axes, place)
    alpha = np.arctan2(x @ np.cross(first, last), first @ last)
    theta1 = np.arctan2(x[1], x[0])
    theta2 = np.arctan2(np.cross(x, pose[:3, 0]) @ last, x @ pose[:3, 0])
    if convention is Convention.STANDARD:
        parts = (theta1, d1, a, alpha), (theta2, d2, 0.0, 0.0)
    else:
        parts = (theta1, d1, 0.0, 0.0), (theta2, d2, a, alpha)
    return [["fixed", *map(float, part)] for part in parts]


@dataclass(frozen=True, eq=False)
class Normals:
    """Common normal of each axis with the next; of the last axis with the end effector.

    All (…, n, 3): its feet on the axis and on the next (at last the end effector), and its unit
    direction x, orthogonal to both axes.
    """

    start: FloatArray
    end: FloatArray
    direction: FloatArray

    @property
    def lengths(self) -> FloatArray:
        """Lengths a of the normals, at least 0 up to rounding, (…, n)."""
        return np.asarray(np.sum((self.end - self.start) * self.direction, axis=-1))

    def offsets(self, directions: FloatArray) -> FloatArray:
        """Signed distances d along each axis from one normal to the next, (…, n); first 0."""
        before = np.concatenate([self.start[..., :1, :], self.end[..., :-1, :]], axis=-2)
        return np.asarray(np.sum((self.start - before) * directions, axis=-1))


def common_normals(chain: JointAxes) -> Normals:
    """Return the common normals along a chain, or along many at once.

    Of parallel axes, the normal through the end of the previous one is taken (for the first
    axis, through its point), so that the offset is 0. Of intersecting axes, the normal has
    length 0 and the direction of the vector product of the axes. Of coincident axes, it
    keeps the direction of the previous one.
    """
    axes, points, tip = chain.directions, chain.points, chain.end_effector
    slack = _PARALLEL * (float(np.max(np.linalg.norm(points - tip, axis=-1))) or 1.0)
    # Two axes that are not parallel have feet, and a direction along their vector product.
    this, other, between = axes[..., :-1, :], axes[..., 1:, :], np.diff(points, axis=-2)
    cross = np.cross(this, other)
    skewed = np.linalg.norm(cross, axis=-1, keepdims=True) > _PARALLEL
    square = np.maximum(_dot(cross, cross), _PARALLEL**2)
    feet = points[..., :-1, :] + _dot(np.cross(between, other), cross) / square * this
    heads = points[..., 1:, :] + _dot(np.cross(between, this), cross) / square * other
    along = cross / np.sqrt(square)
    along = np.where(_dot(between, along) < -slack, -1.0, 1.0) * along

    here, first = points[..., 0, :], axes[..., 0, :]
    flat = np.where(np.abs(first[..., :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    before = flat - _dot(flat, first) * first
    before = before / np.linalg.norm(before, axis=-1, keepdims=True)
    start, end, across = (np.empty(axes.shape) for _ in range(3))
    last = axes.shape[-2] - 1
    for k in range(last + 1):
        if k == last:
            here, head = _nearest(tip, axes[..., k, :], points[..., k, :]), tip
        else:
            head = _nearest(here, axes[..., k + 1, :], points[..., k + 1, :])
        length = np.linalg.norm(head - here, axis=-1, keepdims=True)
        apart = length > slack
        way = np.where(apart, (head - here) / np.where(apart, length, 1.0), before)
        normal = [here, head, way]
        if k < last:
            skew = feet[..., k, :], heads[..., k, :], along[..., k, :]
            pairs = zip(skew, normal, strict=True)
            normal = [np.where(skewed[..., k, :], a, b) for a, b in pairs]
        start[..., k, :], end[..., k, :], across[..., k, :] = normal
        here, before = end[..., k, :], across[..., k, :]
    return Normals(start, end, across)


def _nearest(target: FloatArray, axis: FloatArray, point: FloatArray) -> FloatArray:
    """Point of the axis nearest to a target."""
    return np.asarray(point + _dot(target - point, axis) * axis)


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.sum(a * b, axis=-1, keepdims=True))


def _angles(start: FloatArray, end: FloatArray, about: FloatArray) -> FloatArray:
    """Angles from one direction to another about a third, each row by itself."""
    sine = np.sum(np.cross(start, end) * about, axis=1)
    return np.asarray(np.arctan2(sine, np.sum(start * end, axis=1)) + 0.0)  # 0, not -0


def _frame(x: FloatArray, z: FloatArray, origin: FloatArray) -> FloatArray:
    return homogeneous(np.column_stack([x, np.cross(z, x), z]), origin)
