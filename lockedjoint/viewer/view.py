"""A robot in a web page, which is served until it is closed.

`view` reads its arguments and starts a `Page`; it returns at once.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

from lockedjoint.nlp.errors import InputError, MissingLibraryError
from lockedjoint.robot import Robot, with_settings
from lockedjoint.robots.search import Search
from lockedjoint.viewer.address import Address
from lockedjoint.viewer.page import Page
from lockedjoint.viewer.planned_path import PlannedPath

#: What names a file.
File = str | os.PathLike[str]
# Random starts of the button that looks for the best posture.
_STARTS = 20


def view(
    robot: object,
    q: Any = None,
    *,
    beside: File | Sequence[File] = (),
    address: str = "127.0.0.1:8080",
    **settings: Any,
) -> Page:
    """Show a robot in a web page, with a slider and a lock for each joint.

    Parameters
    ----------
    robot
        A `Robot`, or what makes one.
    q
        The configuration at which the sliders begin, see `Robot.configuration`; by default
        midway between the limits, or the beginning of a path.
    beside
        What is shown beside the robot: the path.json that `path --out-dir` writes, for the same
        tip and base, which is played; or a mesh about the base, such as the surface that
        `workspace --out` writes, in .ply, .stl or .obj; or one of each.
    address
        Host and port of this machine to listen on, as HOST:PORT; port 0 for any free one.
    **settings
        Fields of `Search`: how the best posture is looked for.

    Returns
    -------
    Page
        What is served; ``close()`` ends it.

    Raises
    ------
    InputError
        If the address cannot be listened on, or a file is not what it has to be.
    MissingLibraryError
        If viser is not installed.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> page = lj.view("example", address="127.0.0.1:8093")
    >>> page.close()
    (viser) Server stopped
    """
    try:
        import viser  # noqa: F401
    except ImportError:
        raise MissingLibraryError("viser", "viser yourdfpy") from None
    given = Robot.of(robot)
    search = with_settings(Search, Search(starts=_STARTS), settings)
    trajectory, mesh = _kinds(beside)
    if trajectory is not None and q is not None:
        raise InputError("q", q, "none with a path that is played")
    where = Address.parse(address)
    path = None if trajectory is None else PlannedPath.read(trajectory, given.arm)
    point, notes = given.configuration(q) if path is None else (path.at(0.0), ())
    where = where.free()
    logging.getLogger("yourdfpy").setLevel(logging.ERROR)  # a note says it
    with redirect_stdout(StringIO()):  # viser's own greeting
        page = Page(given, point, where, search, path, mesh)
    page.notes = [*given.chain.notes, *notes, *page.notes]
    return page


def _kinds(beside: File | Sequence[File]) -> tuple[Path | None, Path | None]:
    """Return which of some files is a path, by its ending .json, and which a mesh; or None.

    InputError if there are two of one kind.
    """
    given = [beside] if isinstance(beside, str | os.PathLike) else list(beside)
    files = [Path(file) for file in given]
    paths = [file for file in files if file.suffix.lower() == ".json"]
    meshes = [file for file in files if file not in paths]
    for some in (paths, meshes):
        if len(some) > 1:
            raise InputError("beside", f"{some[0]} and {some[1]}", "one path and one mesh")
    return next(iter(paths), None), next(iter(meshes), None)
