"""``lockedjoint robots``: the best postures of arms that ship in Python packages."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from formulations.commands.arguments import Json, Out, Seed, Starts, Workers

if TYPE_CHECKING:
    from formulations.studies.robots.survey import Surveyed
    from formulations.studies.robots.survey_arms import SurveyArm

INTERRUPTED = 130


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

    Needs the packages yourdfpy, example-robot-data and rtb-data. Writes robots.csv,
    robots.md and postures.json into the output folder after every arm; Ctrl-C keeps what is
    done.
    """
    from formulations.robots.posture import Search
    from formulations.studies.robots.report import write
    from formulations.studies.robots.survey import survey
    from nlp.files import prepare_folder
    from nlp.multistart import default_workers
    from nlp.native import deferred_interrupt

    arms = _chosen(only)
    prepare_folder(out)
    count = workers or default_workers()
    search = Search(starts=starts, seed=seed, workers=count, progress=True)
    found: list[Surveyed] = []
    complete = True
    try:
        for one in arms:
            surveyed = survey(one, search)
            complete = surveyed.posture is None or surveyed.posture.complete
            with deferred_interrupt():
                found.append(surveyed)
                write(found, out, seed, complete)
            if not complete:
                break
    except KeyboardInterrupt:
        complete = False
    _show(found, out, complete, as_json)


def _chosen(only: str | None) -> list[SurveyArm]:
    from formulations.studies.robots.survey_arms import ARMS
    from nlp.errors import InputError

    arms = [one for one in ARMS if only is None or only.lower() in one.name.lower()]
    if not arms:
        names = ", ".join(dict.fromkeys(one.name for one in ARMS))
        raise InputError("--only", only, f"part of one of {names}")
    for one in arms:
        one.arm()  # a missing package is better known now than after an hour
    return arms


def _show(found: list[Surveyed], out: Path, complete: bool, as_json: bool) -> None:
    from formulations.studies.robots.report import summary, table

    rows = [one.row for one in found]
    if as_json:
        shown = json.loads(table(rows).to_json(orient="records"))
        for one in shown:
            for name in ("status_counts", "configuration"):
                one[name] = json.loads(one[name])
        typer.echo(json.dumps({"complete": complete, "rows": shown}, indent=1))
    elif rows:
        typer.echo(summary(rows).to_markdown(index=False, disable_numparse=True))
        typer.echo(f"\nWritten to {out}: robots.csv, robots.md, postures.json")
    if not complete:
        typer.echo("Interrupted: what was done is kept, the rest is missing.", err=True)
        raise typer.Exit(INTERRUPTED)
