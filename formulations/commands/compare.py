"""``lockedjoint compare``: all formulations from common starts, in one table."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from formulations.commands.arguments import (
    Compiled,
    Ipopt,
    Joints,
    Json,
    Out,
    Seed,
    Starts,
    TaskDimension,
    Workers,
    ipopt_options,
)

if TYPE_CHECKING:
    from formulations.studies.comparison.row import Summary

INTERRUPTED = 130


def compare(
    joints: Joints = 7,
    task_dimension: TaskDimension = 6,
    starts: Starts = 100,
    seed: Seed = 0,
    workers: Workers = None,
    out: Out = Path("comparison"),
    ipopt: Ipopt = None,
    compiled: Compiled = False,
    as_json: Json = False,
) -> None:
    """Compare the three formulations from common random starts.

    Solves residual minimisation, max-min and isotropy on two column models (for six task
    dimensions: unit revolute joints, and revolute joints with free lever arms of mean square
    at most 1), with variants of max-min beside them, and measures every answer again from
    its Jacobian alone. Writes comparison.csv, comparison.md and jacobians.json into the
    output folder after every row; Ctrl-C keeps what is done.
    """
    from formulations.catalogue import arm, models_of
    from formulations.solving.setup import setups
    from formulations.solving.solve import run
    from formulations.studies.comparison.report import write
    from formulations.studies.comparison.row import summarise
    from nlp.files import prepare_folder
    from nlp.multistart import default_workers
    from nlp.native import deferred_interrupt
    from nlp.options import check_options

    options = check_options(ipopt_options(ipopt))
    for model in models_of(task_dimension):
        arm(model, joints, task_dimension)
    prepare_folder(out)

    summaries: list[Summary] = []
    complete = True
    try:
        for setup in setups(task_dimension):
            outcome = run(
                setup,
                joints=joints,
                task_dimension=task_dimension,
                starts=starts,
                seed=seed,
                workers=workers or default_workers(),
                options=options,
                compiled=compiled,
                progress=True,
            )
            complete = outcome.complete
            if outcome.records:
                with deferred_interrupt():
                    summaries.append(summarise(outcome))
                    write(summaries, out, seed, complete)
            if not complete:
                break
    except KeyboardInterrupt:
        complete = False
    _show(summaries, out, complete, as_json)


def _show(summaries: list[Summary], out: Path, complete: bool, as_json: bool) -> None:
    from formulations.studies.comparison.report import brief, table

    rows = [one.row for one in summaries]
    if as_json:
        found = json.loads(table(rows).to_json(orient="records"))
        for one in found:
            one["status_counts"] = json.loads(one["status_counts"])
        typer.echo(json.dumps({"complete": complete, "rows": found}, indent=1))
    elif rows:
        typer.echo(brief(rows).to_markdown(index=False, disable_numparse=True))
        typer.echo(
            "\nobjective: ½‖JJᵀ − (T/m)I‖² for residual, worst-case σ for the others; bound: "
            "proved for every such arm."
        )
        typer.echo(f"Written to {out}: comparison.csv, comparison.md, jacobians.json")
    if not complete:
        typer.echo("Interrupted: what was done is kept, the rest is missing.", err=True)
        raise typer.Exit(INTERRUPTED)
