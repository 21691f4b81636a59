"""``lockedjoint view``: a robot in a web page, with joints that lock.

Docstrings of commands are help texts: `options` makes the options from them, in the words of
`vocabulary`, which says what an option means in every command.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from lockedjoint.commands.output import INTERRUPTED, Answer, shown, warn
from lockedjoint.commands.shared import FieldsOfRobot, robot_at

# Seconds between two looks at whether the user interrupts: more answers Ctrl-C later.
_PULSE_SECONDS = 0.2


def view(
    robot: FieldsOfRobot,
    q: str | None = None,
    beside: list[Path] | None = None,
    address: str = "127.0.0.1:8080",
) -> Answer:
    """Show a robot in a web page until Ctrl-C.

    The page has a slider and a lock for each joint, and shows the velocity ellipsoid before
    (blue) and after a failure (orange): that of the locked joints or, as long as none is
    locked, the worst one. The arrows are the direction that suffers most. 'Best posture' looks
    for the most failure-tolerant posture of the joints that are not locked. Where a path is
    played, a slider is the time, a joint may be locked at any moment, and the page says and
    shows whether the rest can be finished.

    Parameters
    ----------
    q
        By default midway between the limits.
    beside
        What is shown beside the robot: the path.json that `path --out-dir` writes, for the same
        tip and base, which is played; or a mesh about the base, such as the surface that
        `workspace --out` writes, in .ply, .stl or .obj. May be repeated.
    address
        Host and port of this machine to listen on; port 0 for any free one.
    """
    from lockedjoint.viewer.view import view as served

    fields = {name: value for name, value in robot.items() if name != "source"}
    made, point, notes = robot_at(robot["source"], fields, q)
    page = served(made, None if q is None else point, beside=beside or (), address=address)
    try:
        chain, url = made.chain, page.address.url
        notes = (*notes, *page.notes)
        if not page.address.local:
            allowed = f"whoever can reach {url} can use this page"
            notes = (*notes, f"there is no password: {allowed}.")
        plain = {"robot": chain.robot, "tip": chain.tip, "url": url}
        text = f"{shown(made.arm.description)}: {url} (Ctrl-C ends it)"
        return Answer(plain, text, notes=notes, until=_wait)
    except KeyboardInterrupt:
        _end()
        raise


def _wait() -> None:
    """Wait until the user interrupts."""
    try:
        sys.stdout.flush()
        while True:
            time.sleep(_PULSE_SECONDS)
    except KeyboardInterrupt:
        _end()


def _end() -> None:
    """End the process at once, with the status of an interruption."""
    warn("Interrupted.")
    # The process ends without waiting for a search inside of a solver, or for threads.
    os._exit(INTERRUPTED)
