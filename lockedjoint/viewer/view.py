"""A robot in a web page, which is served until it is closed."""

from __future__ import annotations

import logging
import os
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

from lockedjoint.nlp.errors import InputError, MissingLibraryError
from lockedjoint.robot import Robot, with_settings
from lockedjoint.robots.search import Search
from lockedjoint.viewer.page import Address, Page
from lockedjoint.viewer.planned_path import PlannedPath

# Random starts of the button that looks for the best posture.
_STARTS = 20


def view(
    robot: object,
    q: Any = None,
    *,
    trajectory: str | os.PathLike[str] | None = None,
    mesh: str | os.PathLike[str] | None = None,
    host: str = "127.0.0.1",
    port: int = 8080,
    **settings: Any,
) -> Page:
    """Show a robot in a web page, with a slider and a lock for each joint.

    Parameters
    ----------
    robot
        A `Robot`, or what makes one.
    q
        The configuration at which the sliders begin, see `Robot.configuration`; by default
        midway between the limits, or the beginning of a trajectory.
    trajectory
        A path that is played: the path.json that `path --out-dir` writes, for the same tip and
        base.
    mesh
        A mesh that is drawn about the base, such as the surface of a workspace.
    host, port
        Address of this machine to listen on; port 0 for any free one.
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
    """
    try:
        import viser  # noqa: F401
    except ImportError:
        raise MissingLibraryError("viser", "viser yourdfpy") from None
    given = Robot.of(robot)
    search = with_settings(Search, Search(starts=_STARTS), settings)
    path = None if trajectory is None else PlannedPath.read(Path(trajectory), given.arm)
    if path is not None and q is not None:
        raise InputError("q", q, "none with a trajectory, which has its own")
    point, notes = given.configuration(q) if path is None else (path.at(0.0), ())
    address = Address(host, port).free()
    logging.getLogger("yourdfpy").setLevel(logging.ERROR)  # a note says it
    with redirect_stdout(StringIO()):  # viser's own greeting
        page = Page(given, point, address, search, path, None if mesh is None else Path(mesh))
    page.notes = [*given.chain.notes, *notes, *page.notes]
    return page
