"""``lockedjoint reproduce``: every numbered example and claim of the paper, computed anew."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from formulations.commands.arguments import Json, Out, Seed, Starts

if TYPE_CHECKING:
    from formulations.reproduction import Row

INTERRUPTED = 130
MISMATCH = 1


def reproduce(
    starts: Starts = 100,
    seed: Seed = 0,
    out: Out = Path("reproduction"),
    as_json: Json = False,
) -> None:
    """Recompute every numbered example and claim of the paper.

    One row each: equation, quantity, the paper's value, ours, and a verdict computed from the
    two: agrees, misprint, rounded or improved, with the reason. Writes reproduction.csv and
    reproduction.md after every row. Exit status 1 if any row is an unexplained mismatch.
    """
    from formulations.reproduction import has_mismatch, iterate
    from formulations.studies.reproduction_report import write
    from nlp.files import prepare_folder

    prepare_folder(out)
    rows: list[Row] = []
    complete = False
    try:
        for row in iterate(seed, starts):
            rows.append(row)
            write(rows, out, seed, complete=False)
            if not as_json:
                typer.echo(f"{row.verdict:<9} {row.equation:<14} {row.quantity}")
                typer.echo(f"{'':<10}paper {row.paper}   ours {row.ours}")
        complete = True
    except KeyboardInterrupt:
        typer.echo("Interrupted: what was done is kept, the rest is missing.", err=True)
    write(rows, out, seed, complete)
    if as_json:
        listed = [row.to_dict() for row in rows]
        typer.echo(json.dumps({"complete": complete, "rows": listed}, indent=1))
    else:
        typer.echo(f"\nWritten to {out}: reproduction.csv, reproduction.md")
    if not complete:
        raise typer.Exit(INTERRUPTED)
    if has_mismatch(rows):
        raise typer.Exit(MISMATCH)
