"""The distance of two solids by coal, and whether one is inside the other.

Distances of convex hulls take microseconds, those of meshes up to milliseconds. A pair of
meshes is measured itself only where its hulls are too near. A mesh is a surface for coal:
whether one lies wholly inside another is told by how often this winds about a point of it.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np

from formulations.clearance.shapes import Shape, coal_library, solid
from nlp.arrays import FloatArray

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
    coal = coal_library()
    hulls = (_hull(first[0]), first[1]), (_hull(second[0]), second[1])
    gap, ends = _measured(coal, *hulls)
    meshes = [shape.kind == "mesh" for shape, _ in (first, second)]
    if gap >= enough:
        return gap, None
    apart = gap > 0
    if any(meshes):
        placed = (solid(first[0]), first[1]), (solid(second[0]), second[1])
        gap, ends = _measured(coal, *placed)
        if gap > 0 and not apart:
            for outer, inner in ((first, second), (second, first)):
                point = _own_point(inner)
                if outer[0].kind == "mesh" and _winds_about(outer, point):
                    return -gap, (point, point)
    return gap, ends


def _measured(coal: Any, first: tuple[Any, Any], second: tuple[Any, Any]) -> tuple[float, Ends]:
    found = coal.DistanceResult()
    gap = float(coal.distance(*first, *second, coal.DistanceRequest(), found))
    ends = found.getNearestPoint1().copy(), found.getNearestPoint2().copy()
    if gap <= 0:
        common = coal.CollisionResult()
        coal.collide(
            *(*first, *second),
            *(coal.CollisionRequest(coal.CollisionRequestFlag.CONTACT, 1), common),
        )
        if common.isCollision():
            ends = (common.getContact(0).pos.copy(),) * 2
    return gap, ends


@lru_cache(maxsize=256)
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


def _own_point(placed: Placed) -> FloatArray:
    """Return a point of a solid, in the axes of the base."""
    shape, place = placed
    own = _triangles(shape)[0, 0] if shape.kind == "mesh" else np.zeros(3)
    return np.asarray(place.getRotation() @ own + place.getTranslation())


def _winds_about(placed: Placed, point: FloatArray) -> bool:
    """Whether a closed mesh winds about a point: solid angles (van Oosterom and Strackee)."""
    shape, place = placed
    own = place.getRotation().T @ (point - place.getTranslation())
    a, b, c = np.moveaxis(_triangles(shape) - own, 1, 0)
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    volume = np.einsum("ki,ki->k", a, np.cross(b, c))
    dots = (np.einsum("ki,ki->k", *pair) for pair in ((a, b), (b, c), (c, a)))
    ab, bc, ca = dots
    angles = 2 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return bool(abs(np.sum(angles)) > 2 * np.pi)


@lru_cache(maxsize=256)
def _triangles(shape: Shape) -> FloatArray:
    """Return the corners of a mesh's triangles, shape (k, 3, 3), in its own frame."""
    mesh = solid(shape)
    corners = np.asarray(mesh.vertices(), dtype=float).reshape(-1, 3)
    faces = [mesh.tri_indices(k) for k in range(mesh.num_tris)]
    return np.asarray(corners[np.array([[face[k] for k in range(3)] for face in faces])])
