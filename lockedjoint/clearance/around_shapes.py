"""Simple bodies around the geometry of a link: a capsule, or a box.

What comes in: shapes of a link. What goes out: a `Capsule` or a box, in metres, that all of
them are inside. They are larger than the geometry, and quick to compare.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from lockedjoint.clearance.shapes import Shape, solid
from lockedjoint.nlp.arrays import FloatArray

# A cylinder's rim becomes so many points, on a circle larger by as much as they cut off.
_RIM_POINTS = 32
# Radii are larger by this, in metres: rounding.
_ROUNDING_M = 1e-6
# Steps in which the smallest circle around points is approached.
_CIRCLE_STEPS = 200


@dataclass(frozen=True, eq=False)
class Capsule:
    """Points within a radius of a segment, in metres, in a body's frame."""

    start: FloatArray
    end: FloatArray
    radius: float

    @property
    def volume(self) -> float:
        """In m³, but for a factor."""
        length = float(np.linalg.norm(self.end - self.start))
        return self.radius**2 * (length + 4 / 3 * self.radius)


def capsule_around(shapes: Sequence[Shape], pose: FloatArray) -> Capsule:
    """Return a capsule around a link's geometry, in the frame of the link's body.

    The smallest of those along the axes of the link's frame and along the principal axes of the
    points. The pose is that of the link in the body's frame, 4×4.
    """
    clouds = [_points(shape) for shape in shapes]
    points = np.concatenate([cloud for cloud, _ in clouds])
    extra = np.concatenate([np.full(len(cloud), around) for cloud, around in clouds])
    principal = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    fits = [_along(axis, points, extra) for axis in (*np.eye(3), *principal)]
    best = min(fits, key=lambda fit: fit.volume)
    rotation, origin = pose[:3, :3], pose[:3, 3]
    start, end = (rotation @ point + origin for point in (best.start, best.end))
    return Capsule(start, end, best.radius + _ROUNDING_M)


def box_around(shapes: Sequence[Shape]) -> tuple[FloatArray, FloatArray]:
    """Return the least and the largest coordinates of a link's geometry in its own frame."""
    clouds = [_points(shape) for shape in shapes]
    return (
        np.min([cloud.min(axis=0) - around for cloud, around in clouds], axis=0),
        np.max([cloud.max(axis=0) + around for cloud, around in clouds], axis=0),
    )


def _points(shape: Shape) -> tuple[FloatArray, float]:
    """Points, shape (k, 3) in the link's frame, and how far around them the shape may reach."""
    around = 0.0
    if shape.kind == "sphere":
        points, around = np.zeros((1, 3)), shape.size[0]
    elif shape.kind == "capsule":
        around, end = shape.size[0], shape.size[1] / 2
        points = np.array([[0.0, 0.0, -end], [0.0, 0.0, end]])
    elif shape.kind == "box":
        corners = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5])).reshape(3, -1)
        points = corners.T * np.array(shape.size)
    elif shape.kind == "cylinder":
        angle = 2 * np.pi * np.arange(_RIM_POINTS) / _RIM_POINTS
        radius, half = (
            shape.size[0] / np.cos(np.pi / _RIM_POINTS),
            np.full(_RIM_POINTS, shape.size[1] / 2),
        )
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        points = np.concatenate([np.stack([x, y, z], axis=1) for z in (half, -half)])
    else:
        points = np.asarray(solid(shape).vertices(), dtype=float).reshape(-1, 3)
        with suppress(QhullError):  # where all are in one plane, all are taken
            points = points[ConvexHull(points).vertices]
    return points @ shape.pose[:3, :3].T + shape.pose[:3, 3], around


def _along(axis: FloatArray, points: FloatArray, extra: FloatArray) -> Capsule:
    """Return a capsule along an axis around points, each with a sphere about it."""
    across = np.linalg.svd(axis[None])[2][1:]
    plane, height = points @ across.T, points @ axis
    centre = plane.mean(axis=0)
    # Badoiu and Clarkson: towards the farthest point by ever smaller steps.
    for step in range(1, _CIRCLE_STEPS):
        far = plane[np.argmax(np.linalg.norm(plane - centre, axis=1) + extra)]
        centre = centre + (far - centre) / (step + 1)
    off = np.linalg.norm(plane - centre, axis=1)
    radius = float(np.max(off + extra))
    reach = np.sqrt(np.maximum((radius - extra) ** 2 - off**2, 0.0))
    low, high = float(np.min(height + reach)), float(np.max(height - reach))
    low, high = (low, high) if low < high else ((low + high) / 2,) * 2
    middle = centre @ across
    return Capsule(middle + low * axis, middle + high * axis, radius)
