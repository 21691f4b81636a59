"""The distance of two shapes, and their nearest points, by coal.

What comes in: two shapes, each with its place as coal's Transform3s. What goes out: the
distance in metres, zero or below in contact, and a point on each in the axes of the base.

Distances of convex hulls take microseconds, those of meshes up to milliseconds. A pair of
meshes is measured itself only where its hulls are too near. A mesh is a surface for coal:
whether one lies wholly inside another is told by how often this winds about a point of it.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import product
from typing import Any, TypeAlias

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from lockedjoint.clearance.shapes import Shape, solid
from lockedjoint.formulations.io.objects import library
from lockedjoint.nlp.arrays import FloatArray

# A point this far outside a half space, in metres, still counts as inside: rounding.
_ROUNDING_M = 1e-6
# Geometry of so many shapes is kept.
_SHAPES_KEPT = 256
#: A shape, and where it is, as coal's Transform3s.
Placed: TypeAlias = tuple[Shape, Any]
#: Two points in the axes of the base, in metres.
Ends: TypeAlias = tuple[FloatArray, FloatArray]


def distance(
    first: Placed, second: Placed, enough: float = np.inf
) -> tuple[float, Ends | None]:
    """Return the distance of two solids and their nearest points, a common one in contact.

    Zero or below in contact. Where the hulls are farther apart than what is enough, their
    distance, which is no larger, without points.
    """
    gap, ends = _measured((_hull(first[0]), first[1]), (_hull(second[0]), second[1]))
    if gap >= enough:
        return gap, None
    apart = gap > 0
    if "mesh" in (first[0].kind, second[0].kind):
        gap, ends = _measured((solid(first[0]), first[1]), (solid(second[0]), second[1]))
        if gap > 0 and not apart:
            for outer, inner in ((first, second), (second, first)):
                if (
                    outer[0].kind == "mesh"
                    and (point := _point_inside(outer, inner)) is not None
                ):
                    # Minus the distance of the surfaces: it is not the depth.
                    return -gap, (point, point)
    return gap, ends


def _measured(first: tuple[Any, Any], second: tuple[Any, Any]) -> tuple[float, Ends]:
    """Return coal's distance of two geometries at their places, and the nearest points.

    In contact the nearest points of the distance need not be common to both, so a point of
    contact is asked for in a second call.
    """
    coal = library("coal")
    found = coal.DistanceResult()
    gap = float(coal.distance(*first, *second, coal.DistanceRequest(), found))
    ends = found.getNearestPoint1().copy(), found.getNearestPoint2().copy()
    if gap <= 0:
        common = coal.CollisionResult()
        contact = coal.CollisionRequest(coal.CollisionRequestFlag.CONTACT, 1)
        coal.collide(*first, *second, contact, common)
        if common.isCollision():
            ends = (common.getContact(0).pos.copy(),) * 2
    return gap, ends


@lru_cache(maxsize=_SHAPES_KEPT)
def _hull(shape: Shape) -> Any:
    """Return the convex hull of a mesh; what is convex, or flat, itself."""
    geometry = solid(shape)
    if shape.kind != "mesh":
        return geometry
    try:
        geometry.buildConvexHull(True, "Qt")
    except (ValueError, RuntimeError):  # all points in one plane
        return geometry
    return geometry.convex or geometry


def _point_inside(outer: Placed, inner: Placed) -> FloatArray | None:
    """Return a point of `inner`, in the base's axes, if it lies within the mesh `outer`.

    Their surfaces are known not to touch. If `inner` lies within, the hull of the mesh contains
    its points, and the mesh winds about each of them: the solid angles of its triangles (van
    Oosterom and Strackee) do not add up to 0. `own` has the points in the mesh's frame.
    """
    shape, place = outer
    points = inner[1].getRotation() @ _outermost(inner[0]) + inner[1].getTranslation()[:, None]
    own = place.getRotation().T @ (points - place.getTranslation()[:, None])
    normals, offsets = _half_spaces(shape)
    if not len(normals) or np.any(normals @ own + offsets > _ROUNDING_M):
        return None
    a, b, c = np.moveaxis(_triangles(shape) - own[:, 0], 1, 0)
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    volume = np.einsum("ki,ki->k", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ki,ki->k", *pair) for pair in ((a, b), (b, c), (c, a)))
    angles = 2 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return np.asarray(points[:, 0]) if abs(np.sum(angles)) > 2 * np.pi else None


@lru_cache(maxsize=_SHAPES_KEPT)
def _outermost(shape: Shape) -> FloatArray:
    """Return points of a solid that are outermost along its axes, (3, points).

    Of a mesh it is its first corner only: its surface does not touch that of the other, so a
    part of it is wholly inside or outside. If the mesh has several parts, of which another one
    is inside, this is not seen. All points of a convex solid together let the hull exclude more
    before angles are added up.
    """
    if shape.kind == "mesh":
        return np.asarray(_triangles(shape)[0, :1].T)
    if shape.kind == "sphere":
        return np.asarray(shape.size[0] * np.hstack([np.eye(3), -np.eye(3)]))
    if shape.kind == "box":
        corners = np.array(list(product((-0.5, 0.5), repeat=3))).T
        return np.asarray(corners * np.array(shape.size)[:, None])
    radius, half = shape.size[0], shape.size[1] / 2
    if shape.kind == "capsule":
        half += radius
        return np.array([(0.0, 0.0, half), (0.0, 0.0, -half)]).T
    rim = [(radius, 0.0), (-radius, 0.0), (0.0, radius), (0.0, -radius)]
    return np.asarray(np.array([(*point, z) for point in rim for z in (half, -half)]).T)


@lru_cache(maxsize=_SHAPES_KEPT)
def _half_spaces(shape: Shape) -> tuple[FloatArray, FloatArray]:
    """Return n (k, 3) and b (k, 1): n·x + b ≤ 0 in a mesh's hull; none if it is flat."""
    try:
        planes = ConvexHull(_triangles(shape).reshape(-1, 3)).equations
    except QhullError:
        planes = np.zeros((0, 4))
    return planes[:, :3], planes[:, 3:]


@lru_cache(maxsize=_SHAPES_KEPT)
def _triangles(shape: Shape) -> FloatArray:
    """Return the corners of a mesh's triangles, shape (k, 3, 3), in its own frame."""
    mesh = solid(shape)
    corners = np.asarray(mesh.vertices(), dtype=float).reshape(-1, 3)
    faces = [mesh.tri_indices(k) for k in range(mesh.num_tris)]
    return np.asarray(corners[np.array([[face[k] for k in range(3)] for face in faces])])
