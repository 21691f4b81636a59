"""Simple bodies around the geometry of a link: a capsule, or a box.

What comes in: shapes of a link. What goes out: a `Capsule` or a box, in metres, that all of
them are inside. They are larger than the geometry, and quick to compare.

Every shape becomes points, shape (k, 3), and one radius: the shape is inside the convex hull of
the spheres of that radius about the points. A sphere is one point, a capsule two; other shapes
have their corners, and radius 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from lockedjoint.clearance.shapes import Shape, solid
from lockedjoint.nlp.arrays import FloatArray

# Number of points that a cylinder's rim becomes, on a circle so much larger that the polygon
# is around the rim. With more points the body is tighter.
_RIM_POINTS = 32
# Length in metres that is added to a capsule's radius: rounding.
_ROUNDING_M = 1e-6
# Number of steps in which the smallest circle around points is approached, and never crossed:
# with more steps the capsule is tighter.
_CIRCLE_STEPS = 200


@dataclass(frozen=True, eq=False)
class Capsule:
    """Points within a radius of a segment, in metres, in a body's frame."""

    start: FloatArray  #: One end of the segment, shape (3,).
    end: FloatArray  #: The other end, shape (3,).
    radius: float

    @property
    def volume(self) -> float:
        """Volume over π, m³."""
        length = float(np.linalg.norm(self.end - self.start))
        return self.radius**2 * (length + 4 / 3 * self.radius)


def capsule_around(shapes: Sequence[Shape], pose: FloatArray) -> Capsule:
    """Return a capsule around a link's geometry, in the frame of the link's body.

    It is the smallest of those along the axes of the link's frame and along the principal axes
    of the points. The pose is that of the link in the body's frame, 4×4.
    """
    clouds = [_points(shape) for shape in shapes]
    points = np.concatenate([cloud for cloud, _ in clouds])
    radii = np.concatenate([np.full(len(cloud), radius) for cloud, radius in clouds])
    principal = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    fits = [_along(axis, points, radii) for axis in (*np.eye(3), *principal)]
    best = min(fits, key=lambda fit: fit.volume)
    rotation, origin = pose[:3, :3], pose[:3, 3]
    start, end = (rotation @ point + origin for point in (best.start, best.end))
    return Capsule(start, end, best.radius + _ROUNDING_M)


def box_around(shapes: Sequence[Shape]) -> tuple[FloatArray, FloatArray]:
    """Return the least and the largest coordinates of a link's geometry, shape (3,) each.

    They are in metres, in the link's own frame.
    """
    clouds = [_points(shape) for shape in shapes]
    return (
        np.min([cloud.min(axis=0) - radius for cloud, radius in clouds], axis=0),
        np.max([cloud.max(axis=0) + radius for cloud, radius in clouds], axis=0),
    )


def _points(shape: Shape) -> tuple[FloatArray, float]:
    """Return points, (k, 3), in the link's frame, and the radius of spheres about them."""
    radius = 0.0
    if shape.kind == "sphere":
        points, radius = np.zeros((1, 3)), shape.size[0]
    elif shape.kind == "capsule":
        radius, end = shape.size[0], shape.size[1] / 2
        points = np.array([[0.0, 0.0, -end], [0.0, 0.0, end]])
    elif shape.kind == "box":
        corners = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5])).reshape(3, -1)
        points = corners.T * np.array(shape.size)
    elif shape.kind == "cylinder":
        points = _rims(*shape.size)
    else:
        from scipy.spatial import ConvexHull, QhullError  # takes long to load

        points = np.asarray(solid(shape).vertices(), dtype=float).reshape(-1, 3)
        with suppress(QhullError):  # where all are in one plane, all are taken
            points = points[ConvexHull(points).vertices]
    return points @ shape.pose[:3, :3].T + shape.pose[:3, 3], radius


def _rims(radius: float, length: float) -> FloatArray:
    """Return corners, shape (2·rim points, 3), of a prism about a cylinder along z."""
    angle = 2 * np.pi * np.arange(_RIM_POINTS) / _RIM_POINTS
    corner_radius = radius / np.cos(np.pi / _RIM_POINTS)
    half = np.full(_RIM_POINTS, length / 2)
    x, y = corner_radius * np.cos(angle), corner_radius * np.sin(angle)
    return np.concatenate([np.stack([x, y, z], axis=1) for z in (half, -half)])


def _along(axis: FloatArray, points: FloatArray, radii: FloatArray) -> Capsule:
    """Return a capsule along a unit vector, (3,), around spheres about points, (k, 3).

    Across the axis it is a circle around the discs of the radii, (k,). Along the axis, a disc
    of radius r at a distance `off` from the circle's centre is inside the round end of the
    capsule up to √((radius − r)² − off²) beyond the segment's end.
    """
    across = np.linalg.svd(axis[None])[2][1:]  # two unit vectors, (2, 3)
    plane, height = points @ across.T, points @ axis
    centre = plane.mean(axis=0)
    # Badoiu and Clarkson's method moves towards the farthest point by ever smaller steps.
    for step in range(1, _CIRCLE_STEPS):
        far = plane[np.argmax(np.linalg.norm(plane - centre, axis=1) + radii)]
        centre = centre + (far - centre) / (step + 1)
    off = np.linalg.norm(plane - centre, axis=1)
    radius = float(np.max(off + radii))
    reach = np.sqrt(np.maximum((radius - radii) ** 2 - off**2, 0.0))
    low, high = float(np.min(height + reach)), float(np.max(height - reach))
    # Round ends that overlap need no segment between them: one point is enough.
    low, high = (low, high) if low < high else ((low + high) / 2,) * 2
    middle = centre @ across
    return Capsule(middle + low * axis, middle + high * axis, radius)
