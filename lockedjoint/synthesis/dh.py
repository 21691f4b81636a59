"""Denavit–Hartenberg parameters, standard and modified, from the common normals of the axes.

A chain of n joints has axes: unit directions and points, shape (n, 3), and an end effector,
(3,); see `JointAxes`. The common normal of two axes is the segment between their nearest
points. Then, for axis i with the direction z_i and the normal x_i from it to the next axis:

* a_i is the length of the normal, and α_i the angle from z_i to z_{i+1} about x_i;
* θ_i is the angle from x_{i−1} to x_i about z_i, and d_i the distance along z_i from the end of
  the normal before to the start of this one.

Lengths are in the manipulator's unit, angles in radians. Functions that say "(…, n, 3)" take
many chains at once, along leading dimensions.
"""

from dataclasses import dataclass
from enum import StrEnum
from itertools import count

import numpy as np

from lockedjoint.kinematics.geometry import BoolArray, homogeneous
from lockedjoint.kinematics.joint_axes import JointAxes
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.synthesis.manipulator import Manipulator, kind_names

# Sine of the angle up to which two axes count as parallel, so that their common normal is not
# unique. It is also the share of the largest distance from the end effector up to which two
# points count as one.
_PARALLEL = 1e-9
# Largest |x| of a direction beside which the x-axis is far from parallel; else y is taken.
_FAR_FROM_X = 0.9


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
    prismatic one.
    """

    convention: Convention
    theta: FloatArray  #: θ, radians, shape (n,).
    d: FloatArray  #: Lengths along the axes, shape (n,).
    a: FloatArray  #: Lengths of the normals, shape (n,).
    alpha: FloatArray  #: α, radians, shape (n,).
    prismatic: BoolArray  #: Whether each joint is prismatic, shape (n,).
    base: FloatArray  #: Pose before the first row, (4, 4).
    tool: FloatArray  #: Pose after the last row, (4, 4).

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
    """Return two rows of fixed joints whose product is a pose, (4, 4).

    A row has the kind, θ, d, a and α. The pose is Rz(θ₁) Tz(d₁) Tx(a) Rx(α) Rz(θ₂) Tz(d₂): x is
    the common normal of the z-axes of both frames, d₁, a and d₂ are the pose's position along
    z, x and the pose's z-axis.
    """
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
    """Common normals of each axis with the next; of the last axis with the end effector."""

    start: FloatArray  #: Feet on the axes, (…, n, 3).
    end: FloatArray  #: Feet on the next axes, at last the end effector, (…, n, 3).
    direction: FloatArray  #: Unit vectors x, orthogonal to both axes, (…, n, 3).

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

    Parallel axes get the normal through the end of the previous one (the first axis, through
    its point), so that the offset d is 0. Intersecting axes get a normal of length 0, with the
    direction of the vector product of the axes. For coincident axes the normal keeps the
    direction of the previous one.
    """
    axes, points, tip = chain.directions, chain.points, chain.end_effector
    # A distance up to `slack` is 0.
    slack = _PARALLEL * (float(np.max(np.linalg.norm(points - tip, axis=-1))) or 1.0)
    # Two axes z and z' through p and p', not parallel, with c = z × z' and b = p' − p: the foot
    # on z is at p + ((b × z')·c/c²) z, that on z' at p' + ((b × z)·c/c²) z'. The normal is
    # along c, with the sign that makes its length positive.
    this, other, between = axes[..., :-1, :], axes[..., 1:, :], np.diff(points, axis=-2)
    cross = np.cross(this, other)
    skewed = np.linalg.norm(cross, axis=-1, keepdims=True) > _PARALLEL
    square = np.maximum(_dot(cross, cross), _PARALLEL**2)
    feet = points[..., :-1, :] + _dot(np.cross(between, other), cross) / square * this
    heads = points[..., 1:, :] + _dot(np.cross(between, this), cross) / square * other
    along = cross / np.sqrt(square)
    along = np.where(_dot(between, along) < -slack, -1.0, 1.0) * along

    # The others follow from the end of the normal before them. The first has none: `before` is
    # then any direction across the first axis.
    here, first = points[..., 0, :], axes[..., 0, :]
    flat = np.where(np.abs(first[..., :1]) < _FAR_FROM_X, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
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
    """Return the point of an axis, along a unit vector through a point, nearest to a target."""
    return np.asarray(point + _dot(target - point, axis) * axis)


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return inner products along the last dimension, which becomes 1."""
    return np.asarray(np.sum(a * b, axis=-1, keepdims=True))


def _angles(start: FloatArray, end: FloatArray, about: FloatArray) -> FloatArray:
    """Return angles, (n,), from one unit vector to another about a third, (n, 3) each."""
    sine = np.sum(np.cross(start, end) * about, axis=1)
    return np.asarray(np.arctan2(sine, np.sum(start * end, axis=1)) + 0.0)  # 0, not -0


def _frame(x: FloatArray, z: FloatArray, origin: FloatArray) -> FloatArray:
    """Return the frame with these axes x and z and this origin, (4, 4)."""
    return homogeneous(np.column_stack([x, np.cross(z, x), z]), origin)
