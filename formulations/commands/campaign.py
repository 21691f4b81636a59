"""``lockedjoint campaign``: a declared grid of many starts, kept in a store, resumable."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from formulations.commands.arguments import (
    Json,
    Workers,
    positive_option,
    refuse_unused,
    whole_option,
)
from formulations.commands.output import INTERRUPTED, refuse_damage, show

if TYPE_CHECKING:
    from nlp.spread import Pool

INCOMPLETE = 1


def campaign(
    context: typer.Context,
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="The campaign in TOML, see docs/campaigns.md."),
    ],
    store: Annotated[
        Path, typer.Option(metavar="DB", help="Store of the records; made if missing.")
    ],
    workers: Workers = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="Run on the Dask cluster with this scheduler instead."
        ),
    ] = None,
    time_limit: Annotated[
        float,
        positive_option(
            "SECONDS",
            "Time for a start, from when it begins, after which its worker is killed.",
        ),
    ] = 600.0,
    chunk: Annotated[
        int,
        whole_option(
            10, "K", "Starts that a worker is sent at once; more of them on a large cluster."
        ),
    ] = 20,
    as_json: Json = False,
) -> None:
    """Run a declared grid of formulations, models and sizes from many random starts.

    Every start becomes one record in the store as it ends. Run the same command again after
    Ctrl-C, a crash or a full disk: it goes on with what is missing, and more starts or cells
    may be declared meanwhile. Damaged records are solved again. Exit status 1 if starts were
    lost because they raised an exception, ended their process or exceeded the time limit, if
    damaged records of other problems remain, or if another process is writing the store.
    """
    from formulations.campaign.campaign import read, run
    from formulations.campaign.records import SCHEMA
    from nlp.store import Store

    if scheduler is not None:
        refuse_unused(context, ("workers",), "--scheduler")
    declared = read(file)
    with (
        closing(_pool(workers, scheduler)) as pool,
        Store(store, SCHEMA, writable=True, salvage=True) as study,
    ):
        report = run(declared, study, pool, time_limit, chunk, progress=True)
        damaged = study.damaged
    found = {
        "store": str(store),
        "cells": len(declared.cells),
        "records_asked_for": report.asked,
        "added": report.added,
        "missing": report.missing,
        "lost": [
            {**cell.settings(), "start": start, "why": why} for cell, start, why in report.lost
        ],
    }
    text = (
        f"{report.asked - report.missing} of {report.asked} records of "
        f"{len(declared.cells)} cells are in {store}, {report.added} of them new."
    )
    show(found, as_json, lambda _: text)
    if report.lost:
        for cell, start, why in report.lost:
            name = f"{cell.setup.formulation} {cell.setup.model} n={cell.joints}"
            typer.echo(f"Lost: start {start} of {name} {why}.", err=True)
        raise typer.Exit(INCOMPLETE)
    if report.missing:
        typer.echo("Interrupted: run the same command again to go on.", err=True)
        raise typer.Exit(INTERRUPTED)
    refuse_damage({store: damaged})


def _pool(workers: int | None, scheduler: str | None) -> Pool:
    if scheduler is not None:
        from nlp.cluster import DaskCluster

        return DaskCluster(scheduler)
    from nlp.multistart import default_workers
    from nlp.processes import Processes

    return Processes(workers or default_workers())
