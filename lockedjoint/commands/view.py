"""``lockedjoint view``: a robot in a web page, with joints that lock."""

import logging
import os
import sys
import time
from collections.abc import Mapping
from contextlib import redirect_stdout
from importlib.util import find_spec
from io import StringIO
from pathlib import Path

from lockedjoint.commands.arguments import MOST_STARTS, Json, Seed, option
from lockedjoint.commands.output import INTERRUPTED, Answer, shown, warn
from lockedjoint.commands.robot_arguments import ArmOptions, Configuration, read_configuration
from lockedjoint.nlp.errors import InputError, MissingLibraryError


def view(
    robot: ArmOptions,
    configuration: Configuration = None,
    trajectory: Path | None = option(
        "FILE",
        "Play a path: the path.json that `path --out` writes, for the same tip and base.",
    ),
    mesh: Path | None = option(
        "FILE",
        "Draw a mesh about the base, such as the workspace that `workspace --mesh` writes.",
    ),
    host: str = option("HOST", "Address of this machine to listen on.", "127.0.0.1"),
    port: int = option(
        "PORT", "Port to listen on; 0 for any free one.", 8080, low=0, high=65535
    ),
    starts: int = option("K", "Random starts of 'Best posture'.", 20, low=1, high=MOST_STARTS),
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Show a robot in a web page until Ctrl-C.

    A slider and a lock for each joint; the velocity ellipsoid before (blue) and after a failure
    (orange): that of the locked joints or, as long as none is locked, the worst one. The arrows
    are the direction that suffers most. 'Best posture' looks for the most failure-tolerant
    posture of the joints that are not locked. With --trajectory a slider is the time, a joint
    may be locked at any moment, and the page says and shows whether the rest can be finished.
    """
    if find_spec("viser") is None:  # before reading, whose extra is another one
        raise MissingLibraryError("viser", "viser yourdfpy")
    from lockedjoint.robots.posture_search import Search
    from lockedjoint.robots.robot_arm import RobotArm
    from lockedjoint.viewer.page import Address, Page
    from lockedjoint.viewer.planned_path import PlannedPath

    if trajectory is not None and configuration is not None:
        raise InputError("--configuration", configuration, "none with --trajectory")
    arm = robot.arm()
    path = None if trajectory is None else PlannedPath.read(trajectory, arm)
    where = read_configuration(configuration, arm.chain) if path is None else path.at(0.0)
    address = Address(host, port).free()

    def lock(locked: Mapping[str, float]) -> RobotArm:
        return RobotArm(robot.chain(locked), arm.task, arm.length)

    search = Search(starts=starts, seed=seed)
    logging.getLogger("yourdfpy").setLevel(logging.ERROR)  # a note says it
    with redirect_stdout(StringIO()):  # viser's own greeting
        page = Page(arm, lock, robot.file, where, address, search, path, mesh)
    try:
        notes = [*arm.chain.notes, *page.notes]
        if not address.local:
            allowed = f"whoever can reach {address.url} can use this page"
            notes.append(f"there is no password: {allowed}.")
        plain = {"robot": arm.chain.robot, "tip": arm.chain.tip, "url": address.url}
        text = f"{shown(arm.description)}: {address.url} (Ctrl-C ends it)"
        Answer(plain, text, notes=notes).show(as_json)
        sys.stdout.flush()
        while True:
            time.sleep(0.2)
    except KeyboardInterrupt:
        warn("Interrupted.")
        # Without waiting for a search inside of a solver, or for the end of threads.
        os._exit(INTERRUPTED)
