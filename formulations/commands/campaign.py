"""``lockedjoint campaign`` and ``join``: many starts in a store; stores made one."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from formulations.commands.arguments import Json, Workers, flag, option
from formulations.commands.executors import chosen_executor
from formulations.commands.output import (
    INTERRUPTED,
    UNSUCCESSFUL,
    end,
    named,
    refuse_damage,
    say,
    show,
    warn,
)
from nlp.errors import InputError

# Chunks that a Dask scheduler has at once: enough for some hundred workers that come and go.
_AT_THE_SCHEDULER = 1000


def campaign(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="The campaign in TOML, see docs/campaigns.md."),
    ],
    store: Path = option("DB", "Store of the records; made if missing.", ...),
    workers: Workers = None,
    scheduler: str | None = option(
        "ADDRESS",
        "Run on the Dask cluster with this scheduler, such as tcp://host:8786, instead.",
    ),
    mpi: bool = flag(
        "--mpi",
        "Run on the other ranks of `mpirun -n RANKS python -m mpi4py.futures -m "
        "formulations campaign …` instead.",
    ),
    time_limit: float = option(
        "SECONDS",
        "Time for each start, after which its worker ends itself.",
        600.0,
        positive=True,
    ),
    chunk: int = option(
        "K",
        "Starts that a worker is sent at once, at least 10; more on a large cluster.",
        20,
        low=10,
    ),
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
    from formulations.campaign.campaign import read, run
    from formulations.campaign.records import cell_of, open_store

    if workers is not None and (scheduler is not None or mpi):
        raise InputError("--workers", workers, "none with --scheduler or --mpi")
    declared = read(file)
    with (
        chosen_executor(workers, scheduler, mpi) as executor,
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
    for case, start, reason in report.failed:
        warn(f"Failed: start {start} of {case.name} n={case.arm.shape[1]} {reason}.")
    if report.failed:
        raise typer.Exit(UNSUCCESSFUL)
    if report.missing:
        end("Interrupted: run the same command again to go on.", INTERRUPTED)
    refuse_damage({store: damaged})


def join(
    store: Annotated[
        Path, typer.Argument(metavar="DB", help="Store that takes the records in.")
    ],
    others: Annotated[
        list[Path], typer.Argument(metavar="OTHER...", help="Stores to join to it.")
    ],
    as_json: Json = False,
) -> None:
    """Bring the records of other stores into one, which is made if missing.

    With a new store and one other it is the way to copy a store. The others stay as they are.
    Where two stores have the same start of the same problem, the records must be equal, apart
    from the time they took; if one is not, nothing of that store is joined. Damaged records
    are named and not joined, and the exit status is 1; one that is damaged in the first store
    is replaced by an intact one.
    """
    from formulations.campaign.records import TIMES, open_store

    joined: list[dict[str, object]] = []
    with ExitStack() as stack:
        sources = [stack.enter_context(open_store(other, salvage=True)) for other in others]
        study = stack.enter_context(open_store(store, writable=True, salvage=True))
        for source in sources:
            added, known = study.join(source, TIMES)
            row = {"store": str(source.path), "added": added, "already_there": known}
            joined.append({**row, "damaged": [named(*record) for record in source.damaged]})
            if not as_json:
                text = f"{added} records of {source.path} are new, {known} were there already."
                say(text)
        if as_json:
            damaged = [named(*record) for record in study.damaged]
            show({"store": str(store), "joined": joined, "damaged": damaged}, as_json)
        refuse_damage({each.path: each.damaged for each in (*sources, study)})
