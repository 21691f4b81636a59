"""``lockedjoint benchmark``: this library beside its peers, in one run."""

from pathlib import Path
from typing import Annotated

import typer

from formulations.commands.arguments import (
    Json,
    Out,
    Seed,
    Starts,
    positive_option,
    progress,
    whole,
)
from formulations.commands.output import run_study


def benchmark(
    starts: Starts = 99,
    joints: Annotated[
        str, typer.Option(metavar="N,...", help="Numbers of joints, from 7 to 20.")
    ] = "7,8,9,12,16,20",
    seed: Seed = 0,
    time_limit: Annotated[
        float,
        positive_option("SECONDS", "Processor time for each solver on one statement and size."),
    ] = 20.0,
    out: Out = Path("benchmark"),
    as_json: Json = False,
) -> None:
    """Measure processor time per start and per checked success, beside the peers.

    Residual minimisation and max-min on unit revolute joints. Peers are the extra
    `peers`; one that is missing says so in its row. The starts are run in three
    rounds; a peer that uses up the time limit stops there. Writes benchmark.csv, benchmark.md
    and cost.svg into the output folder; until all rounds are done they are in its subfolder
    incomplete, where Ctrl-C leaves what is done.
    """
    from formulations.studies.benchmark.study import growth, study, targets

    run_study(
        study(_sizes(joints), time_limit),
        out,
        as_json,
        seed=seed,
        starts=starts,
        progress=progress,
        text=lambda rows: f"{growth(rows)}\n\n{targets(rows)}",
    )


def _sizes(text: str) -> list[int]:
    parse = whole(7)
    sizes = [parse(part.strip()) for part in text.split(",")]
    if max(sizes) > 20:
        raise typer.BadParameter(f"{max(sizes)} given; allowed: numbers from 7 to 20.")
    return sorted(set(sizes))
