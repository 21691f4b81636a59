"""How a command runs one study: the rows as they come, the table, and the exit status."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from formulations.commands.arguments import progress

if TYPE_CHECKING:
    from formulations.studies.study import Effort, Part, Study

INTERRUPTED, QUESTIONED = 130, 1


def run_study(
    study: Study,
    out: Path,
    effort: Effort,
    as_json: bool,
    text: Callable[[Sequence[Any]], str] | None = None,
    note: str = "",
    each: Callable[[Part], object] = lambda _: None,
) -> None:
    """Run a study into a folder and print what was found.

    Parameters
    ----------
    study
        What is run.
    out
        The folder, made if missing.
    effort
        How it is run.
    as_json
        Whether JSON is printed, and nothing else.
    text
        What is printed of the rows in the end; by default their table for the terminal.
    note
        A sentence below that.
    each
        Is called with every part as soon as it is written.

    Raises
    ------
    typer.Exit
        With status 130 if the user interrupted, 1 if something is wrong with what was found.
    """
    from formulations.files.table import Table

    result = study.run(out, effort, (lambda _: None) if as_json else each)
    progress("")
    table: Table[Any] = Table(next(iter(study.tables.values())), result.rows)
    if as_json:
        found = {"complete": result.complete, "rows": table.plain()}
        typer.echo(json.dumps(found, indent=1))
    elif result.rows:
        typer.echo(table.terminal() if text is None else text(result.rows))
        typer.echo(f"\n{note}" if note else "")
        typer.echo(f"Written to {out}: {', '.join(study.files)}")
    if not result.complete:
        typer.echo("Interrupted: what was done is kept, the rest is missing.", err=True)
        raise typer.Exit(INTERRUPTED)
    if result.complaint:
        typer.echo(f"Wrong: {result.complaint}.", err=True)
        raise typer.Exit(QUESTIONED)
