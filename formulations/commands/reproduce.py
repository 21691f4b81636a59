"""``lockedjoint reproduce``: every numbered example and claim of the paper, computed anew."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from formulations.commands.arguments import Json, Out, Seed, Starts
from formulations.commands.output import run_study

if TYPE_CHECKING:
    from formulations.reproduction import ReproductionRow


def reproduce(
    starts: Starts = 100,
    seed: Seed = 0,
    out: Out = Path("reproduction"),
    as_json: Json = False,
) -> None:
    """Recompute every numbered example and claim of the paper.

    One row each: equation, quantity, the paper's value, ours, and a verdict computed from the
    two: agrees, misprint, rounded or improved, with the reason. Writes reproduction.csv and
    reproduction.md into the output folder; until all rows are there they are in its subfolder
    incomplete. Exit status 1 if any row is an unexplained mismatch.
    """
    from formulations.io.study import Effort
    from formulations.reproduction import study

    run_study(study(), out, as_json, effort=Effort(seed, starts), each=_print)


def _print(row: ReproductionRow) -> None:
    typer.echo(f"{row.verdict:<9} {row.equation:<14} {row.quantity}")
    typer.echo(f"{'':<10}paper {row.paper}   ours {row.ours}")
