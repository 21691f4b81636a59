"""The geometry of links and obstacles: as URDF states it, in capsules, and apart by coal.

Distances of convex hulls take microseconds, those of meshes up to milliseconds. A pair of
meshes is measured itself only where its hulls are too near. A mesh is a surface for coal:
whether one lies wholly inside another is told by how often this winds about a point of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Any, TypeAlias
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from lockedjoint.clearance.meshes import MESHES, mesh_file, stated_axes
from lockedjoint.formulations.io.objects import library
from lockedjoint.kinematics.chain import LARGEST
from lockedjoint.kinematics.geometry import homogeneous
from lockedjoint.kinematics.read_urdf import attribute, numbers, pose_of
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import FileError, InputError

# The attributes with the sizes of each kind of geometry: as many numbers as here.
_SIZES = {
    "box": {"size": "0 0 0"},
    "sphere": {"radius": "0"},
    "cylinder": {"radius": "0", "length": "0"},
    "capsule": {"radius": "0", "length": "0"},
}

# A cylinder's rim as so many points, on a circle that is larger by as much as they cut off.
_RIM = 32
# Added to radii: rounding.
_MARGIN = 1e-6


@dataclass(frozen=True, eq=False)
class Shape:
    """A geometry of a link: a box, sphere, cylinder, capsule or mesh.

    Its size is in metres, as URDF has it: edges; radius; radius and length, of a capsule
    between the centres of its ends; scale. A mesh has a file. The pose, 4×4, is in the link's
    frame.
    """

    kind: str
    size: tuple[float, ...]
    file: Path | None
    pose: FloatArray


#: A shape, and where it is, as coal's Transform3s.
Placed: TypeAlias = tuple[Shape, Any]
#: Two points in the axes of the base, in metres.
Ends: TypeAlias = tuple[FloatArray, FloatArray]
#: The shapes of a link, by its name, and whether they are its ``collision`` geometry or, where
#: it has none, its ``visual`` one.
Geometry: TypeAlias = Mapping[str, tuple[tuple[Shape, ...], str]]


def read_shapes(root: Element, path: Path) -> Geometry:
    """Read the geometry of each link of a URDF, whose file has meshes beside it.

    InputError if geometry is malformed, or there is no such mesh.
    """
    geometry = {}
    for link in root.findall("link"):
        name = link.get("name", "")
        source = "collision" if link.find("collision/geometry") is not None else "visual"
        shapes = (_shape(element, name, path) for element in link.findall(source))
        geometry[name] = tuple(shapes), source
    return geometry


def _shape(element: Element, link: str, path: Path) -> Shape:
    where = f"<{element.tag}> of link {link}"
    pose = pose_of(element, where)
    kinds = element.findall("geometry/*")
    if len(kinds) != 1 or kinds[0].tag not in (*_SIZES, "mesh"):
        shown = ", ".join(f"<{kind.tag}>" for kind in kinds) or "without geometry"
        raise InputError(where, shown, "one box, cylinder, capsule, sphere or mesh")
    (kind,) = kinds
    if kind.tag == "mesh":
        scale = numbers(kind, "scale", "1 1 1", where, LARGEST)
        return mesh(_mesh_of(kind.get("filename", ""), link, path), scale, pose)
    size: list[float] = []
    for name, default in _SIZES[kind.tag].items():
        attribute(kind, name, where)
        size += numbers(kind, name, default, where, LARGEST)
    if not min(size) > 0:
        raise InputError(where, " ".join(f"{x:g}" for x in size), "sizes above 0, in metres")
    return Shape(kind.tag, tuple(size), None, pose)


def mesh(file: Path, scale: Sequence[float] = (1.0, 1.0, 1.0), pose: Any = None) -> Shape:
    """Return the shape of a mesh's file, scaled along the axes of the pose, 4×4.

    In the unit and with the axes that the file states; FileError if these are none.
    """
    metres, rotation = stated_axes(file)
    # Scales are along the axes of URDF; coal has them along those of the file.
    along = np.abs(rotation.T) @ np.asarray(scale, dtype=float)
    turned = homogeneous(rotation, np.zeros(3))
    place = turned if pose is None else np.asarray(pose) @ turned
    return Shape("mesh", tuple((metres * along).tolist()), file, place)


def _mesh_of(name: str, link: str, path: Path) -> Path:
    """Return where the mesh of a link is; FileError if it is nowhere allowed."""
    file = mesh_file(name, path)
    if file is None:
        allowed = (
            f"a file beside the URDF file, or in its package in one of the folders above, that"
            f" ends in {', '.join(MESHES)}"
        )
        raise FileError(f"mesh of link {link}", name, allowed)
    return file


@lru_cache(maxsize=256)
def solid(shape: Shape) -> Any:
    """Return the geometry as coal has it; FileError if a mesh cannot be read."""
    coal = library("coal")
    if shape.kind == "mesh":
        try:
            return coal.MeshLoader().load(str(shape.file), np.array(shape.size))
        except (ValueError, RuntimeError) as error:
            allowed = f"a mesh that can be read ({error})"
            raise FileError("mesh", str(shape.file), allowed) from None
    return getattr(coal, shape.kind.capitalize())(*shape.size)


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
    return Capsule(start, end, best.radius + _MARGIN)


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
        angle = 2 * np.pi * np.arange(_RIM) / _RIM
        radius, half = shape.size[0] / np.cos(np.pi / _RIM), np.full(_RIM, shape.size[1] / 2)
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
    for step in range(1, 200):
        far = plane[np.argmax(np.linalg.norm(plane - centre, axis=1) + extra)]
        centre = centre + (far - centre) / (step + 1)
    off = np.linalg.norm(plane - centre, axis=1)
    radius = float(np.max(off + extra))
    reach = np.sqrt(np.maximum((radius - extra) ** 2 - off**2, 0.0))
    low, high = float(np.min(height + reach)), float(np.max(height - reach))
    low, high = (low, high) if low < high else ((low + high) / 2,) * 2
    middle = centre @ across
    return Capsule(middle + low * axis, middle + high * axis, radius)


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
                    return -gap, (point, point)
    return gap, ends


def _measured(first: tuple[Any, Any], second: tuple[Any, Any]) -> tuple[float, Ends]:
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


def _point_inside(outer: Placed, inner: Placed) -> FloatArray | None:
    """Return a point of a solid, in the axes of the base, if a mesh apart from it is about it.

    Then the mesh's hull is about these points, and the mesh winds about any of them: solid
    angles (van Oosterom and Strackee).
    """
    shape, place = outer
    points = inner[1].getRotation() @ _outermost(inner[0]) + inner[1].getTranslation()[:, None]
    own = place.getRotation().T @ (points - place.getTranslation()[:, None])
    normals, offsets = _half_spaces(shape)
    if not len(normals) or np.any(normals @ own + offsets > _MARGIN):
        return None
    a, b, c = np.moveaxis(_triangles(shape) - own[:, 0], 1, 0)
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    volume = np.einsum("ki,ki->k", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("ki,ki->k", *pair) for pair in ((a, b), (b, c), (c, a)))
    angles = 2 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return np.asarray(points[:, 0]) if abs(np.sum(angles)) > 2 * np.pi else None


@lru_cache(maxsize=256)
def _outermost(shape: Shape) -> FloatArray:
    """Return points of a solid that are outermost along its axes, (3, points).

    One of a mesh, which may have several parts.
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


@lru_cache(maxsize=256)
def _half_spaces(shape: Shape) -> tuple[FloatArray, FloatArray]:
    """Return n (k, 3) and b (k, 1): n·x + b ≤ 0 in a mesh's hull; none if it is flat."""
    try:
        planes = ConvexHull(_triangles(shape).reshape(-1, 3)).equations
    except QhullError:
        planes = np.zeros((0, 4))
    return planes[:, :3], planes[:, 3:]


@lru_cache(maxsize=256)
def _triangles(shape: Shape) -> FloatArray:
    """Return the corners of a mesh's triangles, shape (k, 3, 3), in its own frame."""
    mesh = solid(shape)
    corners = np.asarray(mesh.vertices(), dtype=float).reshape(-1, 3)
    faces = [mesh.tri_indices(k) for k in range(mesh.num_tris)]
    return np.asarray(corners[np.array([[face[k] for k in range(3)] for face in faces])])
