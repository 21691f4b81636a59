"""``lockedjoint benchmark``: this library beside its peers, in one run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from formulations.commands.arguments import Out, Seed, Starts, positive, progress, whole

if TYPE_CHECKING:
    from formulations.studies.benchmark.measurement import Row

INTERRUPTED = 130


def benchmark(
    starts: Starts = 100,
    joints: Annotated[
        str, typer.Option(metavar="N,...", help="Numbers of joints, from 7 to 20.")
    ] = "7,8,10,14,20",
    seed: Seed = 0,
    time_limit: Annotated[
        float,
        typer.Option(
            parser=positive,
            metavar="SECONDS",
            help="Processor time for each solver on one statement and size.",
        ),
    ] = 20.0,
    out: Out = Path("benchmark"),
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON instead of text.")
    ] = False,
) -> None:
    """Measure processor time per start and per checked success, beside the peers.

    Residual minimisation and max-min on unit revolute joints. Peers are an extra: pip install
    lockedjoint[peers]; one that is missing says so in its row. Sizes above 8 take a fifth of
    the starts, and whoever uses up the time limit stops there. Writes benchmark.csv and
    benchmark.md after every round, so that Ctrl-C keeps what is done.
    """
    import json
    from dataclasses import asdict

    from formulations.studies.benchmark.measurement import measure
    from formulations.studies.benchmark.peers import PEERS, packages
    from formulations.studies.benchmark.report import growth, targets, write
    from nlp.files import prepare_folder

    sizes = _sizes(joints)
    prepare_folder(out)
    before: list[Row] = []
    rows: list[Row] = []
    complete = False
    try:
        for size in sizes:
            for formulation in dict.fromkeys(peer.formulation for peer in PEERS):
                peers = [peer for peer in PEERS if peer.formulation == formulation]
                few = starts if size <= 8 else max(1, starts // 5)
                for found in measure(peers, size, few, seed, time_limit, progress):
                    rows = [*before, *found]
                    write(rows, out, seed, packages(), time_limit)
                before = rows
        complete = True
    except KeyboardInterrupt:
        typer.echo("Interrupted: what was done is kept, the rest is missing.", err=True)
    progress("")
    if as_json:
        typer.echo(json.dumps([asdict(row) for row in rows], indent=1))
    elif rows:
        typer.echo(f"{growth(rows)}\n\n{targets(rows)}\nWritten to {out}: benchmark.csv, .md")
    if not complete:
        raise typer.Exit(INTERRUPTED)


def _sizes(text: str) -> list[int]:
    parse = whole(7)
    sizes = [parse(part.strip()) for part in text.split(",")]
    if max(sizes) > 20:
        raise typer.BadParameter(f"{max(sizes)} given; allowed: numbers from 7 to 20.")
    return sorted(set(sizes))
