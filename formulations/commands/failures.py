"""``lockedjoint failures``: several and unequal failures, the best found beside the bound."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from formulations.commands.arguments import Json, Out, Seed, Starts, Workers

if TYPE_CHECKING:
    from formulations.studies.failures.row import Summary

INTERRUPTED = 130


def failures(
    starts: Starts = 100,
    seed: Seed = 0,
    workers: Workers = None,
    out: Out = Path("failures"),
    as_json: Json = False,
) -> None:
    """Maximise what several or unequal failures leave, over a list of cases.

    Two and three joints locked at once on planar, positional and revolute arms; joints that
    never fail; joints that fail with unequal probabilities, by the expected and by the
    probability-weighted worst dexterity. Each beside a proved bound. Writes failures.csv,
    failures.md and jacobians.json after every row; Ctrl-C keeps what is done.
    """
    from formulations.studies.failures.cases import several, unequal
    from formulations.studies.failures.report import summary, table, write
    from formulations.studies.failures.row import solve
    from nlp.files import prepare_folder
    from nlp.multistart import default_workers
    from nlp.native import deferred_interrupt

    prepare_folder(out)
    used = workers or default_workers()
    found: list[Summary] = []
    complete = False
    try:
        for case in (*several(), *unequal()):
            one = solve(case, starts=starts, seed=seed, workers=used)
            if one is not None:
                with deferred_interrupt():
                    found.append(one)
                    write(found, out, seed, complete=False)
            if one is None or not one.complete:
                break
        else:
            complete = True
    except KeyboardInterrupt:
        pass  # what is done is kept, and the files say that it is not all
    write(found, out, seed, complete)
    rows = [one.row for one in found]
    if as_json:
        listed = json.loads(table(rows).to_json(orient="records"))
        typer.echo(json.dumps({"complete": complete, "rows": listed}, indent=1))
    else:
        typer.echo(summary(rows).to_markdown(index=False, disable_numparse=True))
        typer.echo(f"\nWritten to {out}: failures.csv, failures.md, jacobians.json")
    if not complete:
        typer.echo("Interrupted: what was done is kept, the rest is missing.", err=True)
        raise typer.Exit(INTERRUPTED)
