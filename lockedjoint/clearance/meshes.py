"""The files of meshes that a robot's file names: where they may be, and what their units are.

A robot's file may come from anybody. It has meshes opened beside itself or below a folder of
its package, with endings of meshes, and nowhere else. COLLADA states a unit of length; files of
the other formats are in metres. The axes of every file are those of the link. COLLADA states an
axis that is up, too, but RViz, MoveIt and coal do not heed it, and most robots are made for
them: meshes of TIAGo state ``Y_UP`` and have the axes of their links.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any
from xml.parsers import expat

from lockedjoint.formulations.io.files import real_in
from lockedjoint.nlp.errors import FileError

#: Endings of files of meshes.
MESHES = (".stl", ".obj", ".dae", ".ply")
_COLLADA = ".dae"
# The shortest unit of length that a file may state, in metres.
_SHORTEST_UNIT_M = 1e-12
# The longest unit of length that a file may state, in metres.
_LONGEST_UNIT_M = 1e12
# Number of bytes of a file that are read at once: its beginning states what is looked for.
_PART_BYTES = 65_536


def mesh_file(name: str, path: Path) -> Path | None:
    """Return where a mesh is that the URDF file at a path names; None if it is nowhere allowed.

    Without ``package://`` the name is relative to the folder of the URDF file, and the mesh has
    to be below the folder of its package: the nearest one above that has a package.xml, or else
    the one above. With ``package://`` the name is tried below each folder above, such as the
    workspace of the package, but never below the root of the file system. Some robots have
    ``package:///`` before the name of the package.
    """
    kind, _, rest = name.rpartition("://")
    named = rest.startswith("/") and kind == "package"
    rest = rest[1:] if named else rest
    if kind not in ("", "package") or not rest or Path(rest).is_absolute():
        return None
    folder = path.resolve().parent
    for root, place in _package(rest, folder, named) if kind else _beside(rest, folder):
        with suppress(OSError, ValueError, RuntimeError):  # of names that no file can have
            found = place.resolve()
            allowed = found.is_relative_to(root) and found.suffix.lower() in MESHES
            if allowed and found.is_file():
                return place
    return None


def _beside(rest: str, folder: Path) -> Iterator[tuple[Path, Path]]:
    """Yield the package's folder, which the mesh has to be below, and where the mesh may be."""
    above = (one for one in (folder, *folder.parents) if (one / "package.xml").is_file())
    yield next(above, folder.parent), folder / rest


def _package(rest: str, folder: Path, named: bool) -> Iterator[tuple[Path, Path]]:
    """Yield each folder above, and where the mesh may be below it.

    The folder of a package may have another name than the package, unless it is `named`.
    """
    for part in (rest,) if named else (rest, rest.partition("/")[2]):
        for above in (folder, *folder.parents):
            if part and above != Path(above.anchor):
                yield above, above / part


def stated_unit(file: Path) -> float:
    """Return the unit of a mesh's file in metres.

    Raises
    ------
    FileError
        If it is COLLADA and no well-formed XML, or states a unit that is none.
    """
    if file.suffix.lower() != _COLLADA:
        return 1.0
    unit = _unit(file)
    try:
        metres = real_in(unit)
    except ValueError:
        metres = math.nan
    if not _SHORTEST_UNIT_M <= metres <= _LONGEST_UNIT_M:
        allowed = f"a number of metres from {_SHORTEST_UNIT_M:g} to {_LONGEST_UNIT_M:g}"
        raise FileError(f"unit of {file}", unit, allowed)
    return metres


class _Ended(Exception):
    """What is looked for has been read."""


def _unit(file: Path) -> str:
    """Return the unit that the ``<asset>`` of a COLLADA file states, as a text.

    By default it is "1" (metre). FileError if the file cannot be read, is no
    well-formed XML up to there, or declares entities.
    """
    parser = expat.ParserCreate(namespace_separator=" ")
    path: list[str] = []
    unit = "1"

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal unit
        path.append(tag.rpartition(" ")[2])
        if path[1:] == ["asset", "unit"]:
            unit = attributes.get("meter", "1")

    def end(_: str) -> None:
        if path[1:] == ["asset"]:
            raise _Ended
        path.pop()

    def entity(*_: Any) -> None:
        raise FileError("mesh", str(file), "XML without entities")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.EntityDeclHandler = entity
    try:
        with file.open("rb") as content:
            while part := content.read(_PART_BYTES):
                parser.Parse(part)
    except _Ended:
        pass
    except OSError as error:
        raise FileError("mesh", str(file), f"a file that can be read ({error})") from None
    except (expat.ExpatError, ValueError, LookupError) as error:
        if isinstance(error, FileError):
            raise
        raise FileError("mesh", str(file), f"well-formed COLLADA ({error})") from None
    return unit
