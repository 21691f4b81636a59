"""``lockedjoint campaign``: a declared grid of many starts, kept in a store, resumable."""

from __future__ import annotations

import logging
from concurrent.futures import Executor
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import Annotated

import typer

from formulations.commands.arguments import (
    Json,
    Workers,
    positive_option,
    refuse_unused,
    whole_option,
)
from formulations.commands.output import INTERRUPTED, refuse_damage, show

INCOMPLETE = 1
# Chunks that a Dask scheduler has at once: enough for some hundred workers that come and go.
_AT_THE_SCHEDULER = 1000


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
    mpi: Annotated[
        bool,
        typer.Option(
            "--mpi",
            help="Run on the other ranks of `mpirun -n RANKS python -m mpi4py.futures -m "
            "formulations campaign …` instead.",
        ),
    ] = False,
    time_limit: Annotated[
        float,
        positive_option(
            "SECONDS",
            "Time for a start, from when it begins, after which its worker ends itself.",
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
    Ctrl-C, a crash or a full disk: it goes on with what is missing, and more starts or cases
    may be declared meanwhile. Damaged records are solved again. Exit status 1 if starts
    failed because they raised an exception, ended their process or exceeded the time limit, if
    damaged records of other problems remain, if another process is writing the store, or if
    the store was removed meanwhile.
    """
    from formulations.campaign.campaign import run
    from formulations.campaign.declaration import read
    from formulations.campaign.records import cell_of, open_store

    if scheduler is not None or mpi:
        refuse_unused(context, ("workers",), "--scheduler or --mpi")
    declared = read(file)
    with (
        _executor(workers, scheduler, mpi) as executor,
        open_store(store, writable=True, salvage=True) as study,
    ):
        capacity = None if scheduler is None else _AT_THE_SCHEDULER
        report = run(declared, study, executor, time_limit, chunk, capacity, progress=True)
        damaged = study.damaged
    cells = [(cell_of(case, declared.seed), *rest) for case, *rest in report.failed]
    values = {
        "store": str(store),
        "cases": len(declared.cases),
        "records_asked_for": report.asked,
        "added": report.added,
        "missing": report.missing,
        "failed": [{"case": cell, "start": start, "reason": why} for cell, start, why in cells],
    }
    text = (
        f"{report.asked - report.missing} of {report.asked} records of "
        f"{len(declared.cases)} cases are in {store}, {report.added} of them new."
    )
    show(values, as_json, lambda _: text)
    if report.failed:
        for case, start, reason in report.failed:
            name = f"{case.name} n={case.arm.shape[1]}"
            typer.echo(f"Failed: start {start} of {name} {reason}.", err=True)
        raise typer.Exit(INCOMPLETE)
    if report.missing:
        typer.echo("Interrupted: run the same command again to go on.", err=True)
        raise typer.Exit(INTERRUPTED)
    refuse_damage({store: damaged})


def _executor(
    workers: int | None, scheduler: str | None, mpi: bool
) -> AbstractContextManager[Executor]:
    from nlp.errors import MissingLibraryError
    from nlp.executors import LocalExecutor, dask_executor, default_workers

    if scheduler is not None:
        with suppress(ImportError):
            import distributed  # noqa: F401  # it sets its own levels
        for part in ("distributed", "distributed.client", "tornado"):
            logging.getLogger(part).setLevel(logging.CRITICAL)  # our own errors say what ended
        return dask_executor(scheduler)
    if mpi:
        try:
            from mpi4py.futures import MPIPoolExecutor
        except ImportError:
            raise MissingLibraryError("mpi4py") from None
        executor: Executor = MPIPoolExecutor()
        return executor
    return LocalExecutor(workers or default_workers())
