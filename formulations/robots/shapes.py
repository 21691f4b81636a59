"""The geometry of a robot's links, as a URDF file states it and as coal has it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from formulations.robots.chain import LARGEST
from formulations.robots.read_urdf import check_numbers
from nlp.arrays import FloatArray
from nlp.errors import FileError, InputError, MissingLibraryError

if TYPE_CHECKING:
    from lxml.etree import _Element

# The attribute with the sizes of each kind of geometry, and how many numbers it has.
_SIZES = {"box": ("size", 3), "sphere": ("radius", 1), "cylinder": ("radius", 1)}


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


def read_shapes(root: _Element, path: Path) -> Mapping[str, tuple[tuple[Shape, ...], str]]:
    """Read the geometry of each link.

    Parameters
    ----------
    root
        Of the URDF.
    path
        Of its file, beside which meshes are.

    Returns
    -------
    Mapping
        By the link's name: its shapes, and whether they are its ``collision`` geometry or,
        where it has none, its ``visual`` one.

    Raises
    ------
    FileError
        If geometry is malformed, or there is no such mesh.
    """
    found = {}
    for link in root.findall("link"):
        name = link.get("name")
        source = "collision" if link.find("collision/geometry") is not None else "visual"
        try:
            shapes = tuple(_shape(one, name, path) for one in link.findall(source))
        except FileError:
            raise
        except InputError as error:
            where = f"{path}: {error.argument}"
            raise FileError(where, error.value, error.allowed) from None
        found[name] = (shapes, source)
    return found


def _shape(element: _Element, link: str, path: Path) -> Shape:
    pose = np.eye(4)
    origin = element.find("origin")
    where = f"<{element.tag}> of link {link}"
    if origin is not None:
        pose[:3, 3] = _numbers(origin, "xyz", 3, where, "0 0 0")
        turn = Rotation.from_euler("xyz", _numbers(origin, "rpy", 3, where, "0 0 0"))
        pose[:3, :3] = turn.as_matrix()
    geometry = element.find("geometry")
    kinds = [] if geometry is None else [one for one in geometry if isinstance(one.tag, str)]
    if len(kinds) != 1 or kinds[0].tag not in (*_SIZES, "mesh"):
        shown = ", ".join(f"<{one.tag}>" for one in kinds) or "without geometry"
        raise InputError(where, shown, "one box, cylinder, sphere or mesh")
    one = kinds[0]
    if one.tag == "mesh":
        scale = _numbers(one, "scale", 3, where, "1 1 1")
        return Shape(
            "mesh", tuple(scale), _mesh_file(one.get("filename", ""), link, path), pose
        )
    name, count = _SIZES[one.tag]
    size = _numbers(one, name, count, where)
    if one.tag == "cylinder":
        size += _numbers(one, "length", 1, where)
    if not min(size) > 0:
        raise InputError(where, " ".join(f"{x:g}" for x in size), "sizes above 0, in metres")
    return Shape(one.tag, tuple(size), None, pose)


def _numbers(
    element: _Element, name: str, count: int, where: str, default: str | None = None
) -> list[float]:
    text = element.get(name, default)
    if text is None:
        raise InputError(where, f"without the attribute '{name}'", f"<{element.tag}> with it")
    check_numbers(f"{name} in {where}", text, count, LARGEST)
    return [float(part) for part in text.split()]


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
