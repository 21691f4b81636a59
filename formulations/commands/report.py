"""``lockedjoint report``: the results, regenerated."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from formulations.commands.arguments import (
    MOST_STARTS,
    Json,
    Out,
    Seed,
    Workers,
    progress,
    refuse_unused,
    whole_option,
)
from formulations.commands.output import INTERRUPTED, QUESTIONED, show

if TYPE_CHECKING:
    from formulations.studies.running import StudyOutcome
    from formulations.studies.study import Study


def report(
    context: typer.Context,
    out: Out = Path("results"),
    only: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help="Only these studies, whatever time they take.",
            show_default="all under ten minutes",
        ),
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="Also what takes over ten minutes.")
    ] = False,
    starts: Annotated[
        int | None,
        whole_option(
            1,
            "K",
            "Random starts of each row.",
            MOST_STARTS,
            show_default="as many as each study's own command makes",
        ),
    ] = None,
    seed: Seed = 0,
    workers: Workers = None,
    as_json: Json = False,
) -> None:
    """Regenerate the results: one folder per study, and the page in front of them.

    Studies: reproduction, comparison, comparison_8r, existence, failures, figures and atlas;
    with --all, or by name, also bounds, robots, paths, workspaces and benchmark. A study's
    folder is replaced when the study is complete; folders of studies left out are kept, and the
    front page says which those are. After Ctrl-C finished studies are kept. Exit status 1 if a
    study failed; the others still run.
    """
    from formulations.studies.front_page import PAGE, front_page
    from formulations.studies.running import State, chosen, run_all
    from formulations.studies.study import Effort
    from nlp.executors import default_workers
    from nlp.files import prepare_file, prepare_folder, write_text

    if only is not None:
        refuse_unused(context, ("everything",), "--only")
    names = None if only is None else [part.strip() for part in only.split(",")]
    studies = chosen(names, everything)
    effort = Effort(seed, starts, workers or default_workers(), progress)
    prepare_file(prepare_folder(out) / PAGE, "front page")
    outcomes: list[StudyOutcome] = []
    written = (State.MADE, State.QUESTIONED)

    def begin(study: Study) -> None:
        typer.echo(f"{study.name}: takes {study.takes}", err=True)

    for outcome in run_all(studies, out, effort, begin):
        outcomes.append(outcome)
        progress("")
        name, reason = outcome.study.name, outcome.reason and f": {outcome.reason}"
        sentence = f"{name}: {outcome.state} in {outcome.seconds:.0f} s{reason}"
        typer.echo(sentence, err=True)
        made = {one.study.name for one in outcomes if one.state in written}
        failed = {o.study.name: o.reason for o in outcomes if o.state not in written}
        write_text(out / PAGE, front_page(out, seed, made, failed))
    _show(outcomes, out, as_json)
    if any(one.state is State.INTERRUPTED for one in outcomes):
        typer.echo("Interrupted: finished studies are kept, the rest is missing.", err=True)
        raise typer.Exit(INTERRUPTED)
    if any(one.state is not State.MADE for one in outcomes):
        raise typer.Exit(QUESTIONED)


def _show(outcomes: list[StudyOutcome], out: Path, as_json: bool) -> None:
    from formulations.studies.running import STUDIES

    ran = {one.study.name for one in outcomes}
    left = [study for study in STUDIES.values() if study.name not in ran]
    if as_json:
        found = {
            "studies": [{**vars(one), "study": one.study.name} for one in outcomes],
            "left_out": [
                {"study": study.name, "takes": study.takes, "command": study.command}
                for study in left
            ],
        }
        show(found, as_json)
        return
    typer.echo(f"Written to {out}: README.md and the folders of the studies made.")
    for study in left:
        typer.echo(f"Left out: {study.name}, takes {study.takes}: {study.command}")
