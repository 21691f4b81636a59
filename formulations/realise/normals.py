"""Common normals of consecutive axes: the skeleton of the Denavit–Hartenberg conventions.

Arrays broadcast over leading dimensions, so that many orders are measured at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nlp.arrays import FloatArray

# Axes whose directions differ by less count as parallel: their common normal is not unique.
PARALLEL = 1e-9


@dataclass(frozen=True, eq=False)
class Normals:
    """Common normal of each axis with the next; of the last axis with the end effector.

    Attributes
    ----------
    start, end
        Its foot on the axis and its foot on the next (at last the end effector), (…, n, 3).
    direction
        Its unit direction x, orthogonal to both axes, from start to end; (…, n, 3).
    """

    start: FloatArray
    end: FloatArray
    direction: FloatArray

    @property
    def lengths(self) -> FloatArray:
        """Lengths a of the normals, at least 0 up to rounding, (…, n)."""
        return np.asarray(np.sum((self.end - self.start) * self.direction, axis=-1))

    def offsets(self, directions: FloatArray) -> FloatArray:
        """Signed ways d along each axis from one normal to the next, (…, n); the first is 0."""
        before = np.concatenate([self.start[..., :1, :], self.end[..., :-1, :]], axis=-2)
        return np.asarray(np.sum((self.start - before) * directions, axis=-1))


def common_normals(
    directions: FloatArray, points: FloatArray, end_effector: FloatArray
) -> Normals:
    """Return the common normals along a chain.

    Of parallel axes, the normal through the end of the previous one is taken (for the first
    axis, through its point), so that the offset is 0. Of intersecting axes, the normal has
    length 0 and the direction of the vector product of the axes. Of coincident axes, it
    keeps the direction of the previous one.

    Parameters
    ----------
    directions, points
        Axes in order, shape (…, n, 3).
    end_effector
        Shape (3,).
    """
    n = directions.shape[-2]
    scale = float(np.max(np.linalg.norm(points - end_effector, axis=-1))) or 1.0
    start, end, across = (np.empty(directions.shape) for _ in range(3))
    here = points[..., 0, :]
    before = _any_orthogonal(directions[..., 0, :])
    for k in range(n):
        axis, point = directions[..., k, :], points[..., k, :]
        if k == n - 1:
            foot = _nearest(end_effector, axis, point)
            feet = [*_through(foot, end_effector, before, scale)]
        else:
            other, place = directions[..., k + 1, :], points[..., k + 1, :]
            parallel = _through(here, _nearest(here, other, place), before, scale)
            skew = _skew(axis, point, other, place, scale)
            turned = np.linalg.norm(np.cross(axis, other), axis=-1)[..., None] > PARALLEL
            feet = [np.where(turned, a, b) for a, b in zip(skew, parallel, strict=True)]
        start[..., k, :], end[..., k, :], across[..., k, :] = feet
        here, before = end[..., k, :], across[..., k, :]
    return Normals(start, end, across)


def _skew(
    axis: FloatArray, point: FloatArray, other: FloatArray, place: FloatArray, scale: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Feet and direction of the common normal of axes that are not parallel."""
    cross = np.cross(axis, other)
    square = np.maximum(np.sum(cross**2, axis=-1, keepdims=True), PARALLEL**2)
    way = place - point
    first = np.sum(np.cross(way, other) * cross, axis=-1, keepdims=True) / square
    second = np.sum(np.cross(way, axis) * cross, axis=-1, keepdims=True) / square
    along = cross / np.sqrt(square)
    length = np.sum(way * along, axis=-1, keepdims=True)
    forward = np.where(length < -PARALLEL * scale, -1.0, 1.0)
    return point + first * axis, place + second * other, forward * along


def _through(
    start: FloatArray, end: FloatArray, otherwise: FloatArray, scale: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Feet and direction of a normal whose feet are known."""
    way = end - start
    length = np.linalg.norm(way, axis=-1, keepdims=True)
    apart = length > PARALLEL * scale
    return start, end, np.where(apart, way / np.where(apart, length, 1.0), otherwise)


def _nearest(target: FloatArray, axis: FloatArray, point: FloatArray) -> FloatArray:
    """Point of the axis nearest to a target."""
    return np.asarray(point + np.sum((target - point) * axis, axis=-1, keepdims=True) * axis)


def _any_orthogonal(axis: FloatArray) -> FloatArray:
    flat = np.where(np.abs(axis[..., :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    across = flat - np.sum(flat * axis, axis=-1, keepdims=True) * axis
    return np.asarray(across / np.linalg.norm(across, axis=-1, keepdims=True))
