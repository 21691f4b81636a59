"""The geometry of links and obstacles, as URDF states it.

What comes in: the root element of a URDF file, or the file of a mesh. What goes out: a `Shape`
for each geometry, in metres, and its solid in coal. `around_shapes` encloses shapes in simpler
bodies, and `distances` measures how far they are apart. To read another kind of geometry, add
it to `_SIZES` and to both of these.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeAlias
from xml.etree.ElementTree import Element

import numpy as np

from lockedjoint.clearance.meshes import MESHES, mesh_file, stated_unit
from lockedjoint.formulations.io.objects import library
from lockedjoint.kinematics.chain import LARGEST
from lockedjoint.kinematics.read_urdf import attribute, numbers, pose_of
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import FileError, InputError

# Number of shapes whose solids are kept: robots have fewer. With less, they are made again.
_SHAPES_KEPT = 256
# Attributes with the sizes of each kind of geometry, and as many zeros as each has numbers.
_SIZES = {
    "box": {"size": "0 0 0"},
    "sphere": {"radius": "0"},
    "cylinder": {"radius": "0", "length": "0"},
    "capsule": {"radius": "0", "length": "0"},
}


@dataclass(frozen=True, eq=False)
class Shape:
    """A geometry of a link."""

    kind: str  #: ``box``, ``sphere``, ``cylinder``, ``capsule`` or ``mesh``.
    #: Metres, as URDF has it: three edges of a box; the radius of a sphere; radius and length
    #: of a cylinder, and of a capsule (between the centres of its ends). For a mesh three
    #: factors that make the numbers of its file metres.
    size: tuple[float, ...]
    file: Path | None  #: The file of a mesh; None for other kinds.
    pose: FloatArray  #: Its frame in the link's frame, 4×4.


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
    """Return the geometry of a ``collision`` or ``visual`` element; InputError if malformed."""
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
    """Return the shape of a mesh's file, with the unit that the file states.

    The pose, 4×4, is that in the link's frame, by default the same frame. FileError if the file
    states a unit that is none.
    """
    size = tuple((stated_unit(file) * np.asarray(scale, dtype=float)).tolist())
    return Shape("mesh", size, file, np.eye(4) if pose is None else np.asarray(pose))


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


@lru_cache(maxsize=_SHAPES_KEPT)
def solid(shape: Shape) -> Any:
    """Return the geometry as coal has it, in its own frame, metres.

    FileError if a mesh cannot be read. The result is shared: nobody may change it.
    """
    coal = library("coal")
    if shape.kind == "mesh":
        try:
            return coal.MeshLoader().load(str(shape.file), np.array(shape.size))
        except (ValueError, RuntimeError) as error:
            allowed = f"a mesh that can be read ({error})"
            raise FileError("mesh", str(shape.file), allowed) from None
    return getattr(coal, shape.kind.capitalize())(*shape.size)
