"""``lockedjoint posture``: the most failure-tolerant posture of a robot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from formulations.commands import robot_arguments as robot
from formulations.commands.arguments import (
    Ipopt,
    Json,
    Locked,
    Seed,
    Starts,
    Workers,
    ipopt_options,
)
from formulations.commands.assess import robot_text
from formulations.commands.output import INTERRUPTED, show

if TYPE_CHECKING:
    from formulations.robots.posture import Posture


def posture(
    file: robot.File,
    tip: robot.Tip = None,
    formulation: Annotated[
        str, typer.Option(metavar="NAME", help="residual, max-min or isotropy.")
    ] = "max-min",
    length: robot.Length = None,
    task: robot.TaskDirections = "all",
    frame: robot.Frame = "base",
    held: robot.Held = None,
    locked: Locked = 1,
    base: robot.Base = None,
    point: robot.Point = None,
    starts: Starts = 100,
    seed: Seed = 0,
    workers: Workers = None,
    ipopt: Ipopt = None,
    out: robot.JsonFile = None,
    as_json: Json = False,
) -> None:
    """Find the most failure-tolerant posture of a robot within its joints' limits.

    One of the three formulations over the joints' positions, from random postures; the
    answer is measured again from its Jacobian alone. With --held, the best posture after
    a failure. `assess --configuration FILE` reads what --out writes.
    """
    from formulations.robots.posture import Search, best_posture
    from nlp.files import prepare_file
    from nlp.multistart import default_workers

    arm = robot.arm(file, tip, base, point, task, frame, length, held)
    count, options = workers or default_workers(), ipopt_options(ipopt)
    search = Search(formulation, locked, starts, seed, count, options, progress=True)
    if out is not None:
        prepare_file(out, inputs=[file])
    found = best_posture(arm, search)
    robot.print_notes(found.assessment)
    how = {
        "formulation": formulation,
        "starts": f"{found.starts} (seed {seed}), best reached by {found.reached_best}",
        "status counts": found.status_counts,
        "midway sigma": found.mid_range_sigma,
    }
    if not found.starts:
        how = {"formulation": formulation, "starts": "none: every posture is as bad"}
    source = _source(found)
    text = robot_text(found.assessment, how, source)
    show(found.to_dict(), as_json, lambda _: text, out)
    if not found.complete:
        typer.echo(f"Interrupted: {found.starts} of {starts} starts ended.", err=True)
        raise typer.Exit(INTERRUPTED)


def _source(found: Posture) -> str:
    if not found.starts:
        return "midway between the limits"
    return "the best found" if found.reached_best else "the best seen; no start converged"
