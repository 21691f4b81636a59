"""The geometry of a robot's links, as a URDF file states it and as coal has it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeAlias
from xml.etree.ElementTree import Element

import numpy as np

from formulations.kinematics.chain import LARGEST
from formulations.kinematics.read_urdf import pose_of
from formulations.kinematics.read_xml import attribute, numbers
from nlp.arrays import FloatArray
from nlp.errors import FileError, InputError, MissingLibraryError

# The attributes with the sizes of each kind of geometry: as many numbers as here.
_SIZES = {
    "box": {"size": "0 0 0"},
    "sphere": {"radius": "0"},
    "cylinder": {"radius": "0", "length": "0"},
}


@dataclass(frozen=True, eq=False)
class Shape:
    """A geometry of a link.

    Attributes
    ----------
    kind
        ``box``, ``sphere``, ``cylinder`` or ``mesh``.
    size
        Edges; radius; radius and length; scale: in metres, as URDF has them.
    file
        Of a mesh.
    pose
        In the link's frame, 4×4.
    """

    kind: str
    size: tuple[float, ...]
    file: Path | None
    pose: FloatArray


#: By a link's name: its shapes, and whether they are its ``collision`` geometry or, where it
#: has none, its ``visual`` one.
Geometry: TypeAlias = Mapping[str, tuple[tuple[Shape, ...], str]]


def read_shapes(root: Element, path: Path) -> Geometry:
    """Read the geometry of each link.

    Parameters
    ----------
    root
        Of the URDF.
    path
        Of its file, beside which meshes are.

    Returns
    -------
    Geometry
        By the link's name.

    Raises
    ------
    InputError
        If geometry is malformed, or there is no such mesh.
    """
    geometry = {}
    for link in root.findall("link"):
        name = link.get("name", "")
        source = "collision" if link.find("collision/geometry") is not None else "visual"
        geometry[name] = (
            tuple(_shape(element, name, path) for element in link.findall(source)),
            source,
        )
    return geometry


def _shape(element: Element, link: str, path: Path) -> Shape:
    where = f"<{element.tag}> of link {link}"
    pose = pose_of(element, where)
    kinds = list(element.find("geometry") or ())
    if len(kinds) != 1 or kinds[0].tag not in (*_SIZES, "mesh"):
        shown = ", ".join(f"<{kind.tag}>" for kind in kinds) or "without geometry"
        raise InputError(where, shown, "one box, cylinder, sphere or mesh")
    (kind,) = kinds
    if kind.tag == "mesh":
        scale = numbers(kind, "scale", "1 1 1", where, LARGEST)
        file = _mesh_file(kind.get("filename", ""), link, path)
        return Shape("mesh", tuple(scale), file, pose)
    size: list[float] = []
    for name, default in _SIZES[kind.tag].items():
        attribute(kind, name, where)
        size += numbers(kind, name, default, where, LARGEST)
    if not min(size) > 0:
        raise InputError(where, " ".join(f"{x:g}" for x in size), "sizes above 0, in metres")
    return Shape(kind.tag, tuple(size), None, pose)


def _mesh_file(name: str, link: str, path: Path) -> Path:
    """Return where a mesh is: beside the URDF, or in the package that a folder above holds."""
    kind, _, rest = name.rpartition("://")
    places = [path.resolve().parent / rest]
    if kind == "package":
        above = path.resolve().parents
        places = [folder / rest for folder in above]
        places += [folder / rest.partition("/")[2] for folder in above]
    for place in places:
        if rest and place.is_file():
            return place
    allowed = "a file beside the URDF file, or in a package in one of the folders above"
    raise FileError(f"mesh of link {link}", name, allowed)


@lru_cache(maxsize=256)
def solid(shape: Shape) -> Any:
    """Return the geometry as coal has it; FileError if a mesh cannot be read."""
    coal = coal_library()
    if shape.kind == "mesh":
        try:
            return coal.MeshLoader().load(str(shape.file), np.array(shape.size))
        except (ValueError, RuntimeError) as error:
            allowed = f"a mesh that can be read ({error})"
            raise FileError("mesh", str(shape.file), allowed) from None
    makers = {"box": coal.Box, "sphere": coal.Sphere, "cylinder": coal.Cylinder}
    return makers[shape.kind](*shape.size)


def coal_library() -> Any:
    """Return the module coal; MissingLibraryError if it is not installed."""
    try:
        import coal
    except ModuleNotFoundError:
        raise MissingLibraryError("coal") from None
    return coal
