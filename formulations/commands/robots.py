"""``lockedjoint robots``: the best postures of arms that ship in Python packages."""

from pathlib import Path
from typing import Annotated

import typer

from formulations.commands.arguments import Json, Out, Seed, Starts, Workers
from formulations.commands.output import run_study


def robots(
    starts: Starts = 200,
    seed: Seed = 0,
    workers: Workers = None,
    only: Annotated[
        str | None,
        typer.Option(
            metavar="TEXT", help="Only arms with this in their name.", show_default="all"
        ),
    ] = None,
    out: Out = Path("robots"),
    as_json: Json = False,
) -> None:
    """Find the best posture of each of a list of arms that ship in Python packages.

    Needs the packages mujoco, example-robot-data, rtb-data and robosuite. Writes
    robots.csv, robots.md and postures.json into the output folder; until all arms are done
    they are in its subfolder incomplete, where Ctrl-C leaves what is done.
    """
    from formulations.studies.robots import study

    run_study(study(only), out, as_json, seed=seed, starts=starts, workers=workers, bars=True)
