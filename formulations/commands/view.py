"""``lockedjoint view``: a robot in a web page, with joints that lock."""

import os
import sys
import time
from importlib.util import find_spec
from typing import Annotated

import typer

from formulations.commands import robot_arguments as robot
from formulations.commands.arguments import Json, Seed, Starts, whole_option
from formulations.commands.output import INTERRUPTED, show
from nlp.errors import MissingLibraryError


def view(
    file: robot.File,
    tip: robot.Tip = None,
    configuration: robot.Configuration = None,
    host: Annotated[
        str, typer.Option(metavar="HOST", help="Address of this machine to listen on.")
    ] = "127.0.0.1",
    port: Annotated[
        int, whole_option(0, "PORT", "Port to listen on; 0 for any free one.", 65535)
    ] = 8080,
    length: robot.Length = None,
    task: robot.TaskDirections = "all",
    frame: robot.Frame = "base",
    held: robot.Held = None,
    base: robot.Base = None,
    point: robot.Point = None,
    starts: Starts = 20,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Show a robot in a web page until Ctrl-C.

    A slider and a lock for each joint; the velocity ellipsoid before (blue) and after a failure
    (orange): that of the locked joints or, as long as none is locked, the worst one. The arrows
    are the direction that suffers most. 'Best posture' looks for the most failure-tolerant
    posture of the joints that are not locked.
    """
    if find_spec("viser") is None:  # before reading, whose extra is another one
        raise MissingLibraryError("viser", "viser yourdfpy")
    from formulations.robots.posture_search import Search
    from formulations.viewer.page import Address, Page

    arm = robot.arm(file, tip, base, point, task, frame, length, held)
    where = robot.read_configuration(configuration, arm.chain)
    address = Address(host, port).free()
    page = Page(
        arm,
        lambda locked: robot.arm(
            *(file, tip, base, point, task, frame, length),
            [*(held or []), *(f"{name}={value!r}" for name, value in locked.items())],
        ),
        file,
        where,
        address,
        Search(starts=starts, seed=seed),
    )
    try:
        for note in (*arm.chain.notes, *page.notes):
            typer.echo(f"Note: {note}", err=True)
        if not address.local:
            allowed = f"whoever can reach {address.url} can use this page"
            typer.echo(f"Note: there is no password: {allowed}.", err=True)
        found = {"robot": arm.chain.robot, "tip": arm.chain.tip, "url": address.url}
        show(found, as_json, lambda _: f"{arm.description}: {address.url} (Ctrl-C ends it)")
        sys.stdout.flush()
        while True:
            time.sleep(0.2)
    except KeyboardInterrupt:
        page.close()
        typer.echo("Interrupted.", err=True)
        # Without waiting for a search inside of a solver, or for the end of threads.
        os._exit(INTERRUPTED)
