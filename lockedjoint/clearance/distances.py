"""The distance of two shapes, and their nearest points, by coal.

What comes in: two shapes, each with its place as coal's Transform3s: rotation and translation,
in metres, from the shape's frame to the base's axes. What goes out: the distance in metres,
zero or below in contact, and a point on each in the base's axes, shape (3,).

Distances of convex hulls take microseconds, those of meshes up to milliseconds. So the hulls of
two meshes are measured first, and the meshes themselves only if the hulls are too near. For
coal a mesh is a surface: if one solid is wholly inside another, their surfaces are apart. This
is told by how often the outer surface winds about a point of the inner solid, see
`_point_inside`.

Geometry that belongs to a shape (hulls, corners, planes) is computed once and kept. Nobody may
change the arrays.
"""

from __future__ import annotations

from functools import cache, lru_cache
from itertools import product
from typing import Any, TypeAlias

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from lockedjoint.clearance.shapes import Shape, solid
from lockedjoint.formulations.io.objects import library
from lockedjoint.nlp.arrays import FloatArray

# Distance in metres outside a half space up to which a point counts as inside: rounding.
_ROUNDING_M = 1e-6
# Number of shapes whose geometry is kept: robots have fewer. With less, it is computed again.
_SHAPES_KEPT = 256
# Half of 4π, the solid angle of a closed surface about a point inside it; outside it is 0.
_HALF_WINDING = 2 * np.pi
#: A shape, and where it is, as coal's Transform3s.
Placed: TypeAlias = tuple[Shape, Any]
#: Two points in the axes of the base, in metres.
Ends: TypeAlias = tuple[FloatArray, FloatArray]


def distance(
    first: Placed, second: Placed, enough: float = np.inf
) -> tuple[float, Ends | None]:
    """Return the distance of two solids, and their nearest points.

    Parameters
    ----------
    first, second
        The solids, and where they are.
    enough
        Distance in metres from which on it need not be exact.

    Returns
    -------
    float
        Distance in metres, zero or below in contact. At least `enough`, and no larger than the
        distance, if the hulls are that far apart.
    tuple, optional
        A point of each solid, shape (3,), in metres; in contact twice a common one. None if the
        distance is that of the hulls.
    """
    gap, ends = _measured((_hull(first[0]), first[1]), (_hull(second[0]), second[1]))
    if gap >= enough:
        return gap, None
    hulls_apart = gap > 0
    if "mesh" in (first[0].kind, second[0].kind):
        gap, ends = _measured((solid(first[0]), first[1]), (solid(second[0]), second[1]))
        if gap > 0 and not hulls_apart:
            for outer, inner in ((first, second), (second, first)):
                point = _point_inside(outer, inner) if outer[0].kind == "mesh" else None
                if point is not None:
                    # Minus the distance of the surfaces: it is not the depth.
                    return -gap, (point, point)
    return gap, ends


def gap_of(first: Placed, second: Placed, enough: float, found: Any) -> float:
    """Return the distance that `distance` returns, sooner: without points.

    `found` is a DistanceResult of coal, which the caller keeps for many calls.
    """
    found.clear()
    measured, request = _request()
    hulls = _hull(first[0]), _hull(second[0])
    gap = float(measured(hulls[0], first[1], hulls[1], second[1], request, found))
    if gap >= enough or "mesh" not in (first[0].kind, second[0].kind):
        return gap
    return distance(first, second, enough)[0]


@cache
def _request() -> tuple[Any, Any]:
    """Return coal's function for distances, and what is asked of it: nothing special."""
    coal = library("coal")
    return coal.distance, coal.DistanceRequest()


def _measured(first: tuple[Any, Any], second: tuple[Any, Any]) -> tuple[float, Ends]:
    """Return coal's distance of two geometries at their places, and the nearest points.

    The arguments are pairs of a geometry of coal and a Transform3s. In contact the nearest
    points of the distance need not be common to both, so a point of contact is asked for in a
    second call.
    """
    coal = library("coal")
    measured, request = _request()
    found = coal.DistanceResult()
    gap = float(measured(*first, *second, request, found))
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
    """Return coal's geometry of the convex hull of a mesh; a shape of another kind is convex.

    A mesh in one plane has no hull in coal: its own surface is returned.
    """
    geometry = solid(shape)
    if shape.kind != "mesh":
        return geometry
    try:
        geometry.buildConvexHull(True, "Qt")
    except (ValueError, RuntimeError):  # all points in one plane
        return geometry
    return geometry.convex or geometry


def _point_inside(outer: Placed, inner: Placed) -> FloatArray | None:
    """Return a point of `inner`, (3,), in the base's axes, if it lies within the mesh `outer`.

    Their surfaces are known not to touch. If `inner` lies within, the hull of the mesh contains
    its points, and the mesh winds about each of them.
    """
    shape, place = outer
    points = inner[1].getRotation() @ _outermost(inner[0]) + inner[1].getTranslation()[:, None]
    in_mesh = place.getRotation().T @ (points - place.getTranslation()[:, None])
    normals, offsets = _half_spaces(shape)
    if not len(normals) or np.any(normals @ in_mesh + offsets > _ROUNDING_M):
        return None
    angle = _solid_angle(_triangles(shape) - in_mesh[:, 0])
    return np.asarray(points[:, 0]) if abs(angle) > _HALF_WINDING else None


def _solid_angle(triangles: FloatArray) -> float:
    """Return the sum of the solid angles of triangles, shape (k, 3, 3), seen from the origin.

    For corners a, b, c of one triangle (van Oosterom and Strackee, 1983)::

        tan(Ω/2) = a·(b × c) / (|a||b||c| + (a·b)|c| + (b·c)|a| + (c·a)|b|)
    """
    a, b, c = np.moveaxis(triangles, 1, 0)
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    volume = np.einsum("ki,ki->k", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ki,ki->k", *pair) for pair in ((a, b), (b, c), (c, a)))
    angles = 2 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return float(np.sum(angles))


@lru_cache(maxsize=_SHAPES_KEPT)
def _outermost(shape: Shape) -> FloatArray:
    """Return some points of a solid, shape (3, points), in its own frame.

    The first corner of a mesh is enough: its surface does not touch that of the other, so a
    connected part of it is wholly inside or outside. If the mesh has several parts, and only
    another one is inside, this is not seen. A convex solid has the outermost points along its
    axes, so that the hull of the other excludes more of them before angles are added up.
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
    """Return normals, (k, 3), and offsets, (k, 1), of the planes of a mesh's hull.

    A point x, in metres in the mesh's frame, is inside if normal·x + offset ≤ 0 for all of
    them. A flat mesh has no planes: k = 0.
    """
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
