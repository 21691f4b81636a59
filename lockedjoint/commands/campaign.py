"""``lockedjoint campaign``, ``show`` and ``join``: many starts in a store, and its tables.

A campaign file declares cases (formulation, model, size) and numbers of starts. `campaign` runs
what the store does not have yet: one record for each start, in an SQLite file. `show` makes
tables of a store, and `join` merges stores. The work is done in `formulations.campaign`; this
file chooses the processes that solve, and puts tables into their form.

Docstrings of commands are help texts: `options` makes the options from them, in the words of
`vocabulary`, which says what an option means in every command.
"""

from __future__ import annotations

import gc
import json
import logging
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from lockedjoint.commands.output import INTERRUPTED, Answer, chosen_columns, say, shown
from lockedjoint.formulations.io.escaping import latex, markdown_cell, rows_csv
from lockedjoint.nlp.errors import (
    InputError,
    MissingLibraryError,
    StoreError,
    WorkerError,
    one_of,
)

if TYPE_CHECKING:
    import pandas as pd

# Number of chunks of starts that a Dask scheduler has at once: enough for some hundred workers
# that come and go.
_AT_THE_SCHEDULER = 1000
# Seconds after which a cluster that does not answer is given up.
_CONNECT_SECONDS = 12.0
# Seconds that a scheduler has to answer when we leave the cluster.
_LEAVE_SECONDS = 1.0
# Least number of starts that a worker is sent at once: with fewer, sending takes much of the
# time.
_LEAST_CHUNK = 10
# Address that stands for the ranks of MPI in place of a scheduler.
_MPI = "mpi"
# Kinds of rows that `show` can make; `tables.read_campaign` makes them.
_ROWS = ("groups", "records", "optima")
# Columns that hold JSON as text.
_NESTED = ("jacobian", "canonical_form", "options", "earlier")
# Columns that are matrices: only CSV and JSON have them.
_MATRICES = ["jacobian", "canonical_form"]
# Columns that are shown with more digits than others.
_PRECISE = ("score", "worst_case_sigma")
# Number of digits of these columns; optima that differ should look different.
_PRECISE_DIGITS = 8
# Number of digits of all other columns.
_DIGITS = 4


def campaign(
    file: Path,
    store: Path,
    workers: int | None = None,
    scheduler: str | None = None,
    time_limit: float = 600.0,
    chunk: int = 20,
) -> Answer:
    """Run a declared grid of formulations, models and sizes from many random starts.

    Every start becomes one record in the store as it ends. Run the same command again after
    Ctrl-C, a crash or a full disk: it goes on with what is missing, and more starts or cases
    may be declared meanwhile. Exit status 1 if starts failed because they raised an exception,
    ended their process or exceeded the time limit, if the store has a damaged record, or if it
    was removed meanwhile.

    Parameters
    ----------
    file
        The campaign, in TOML: see docs/campaigns.md.
    store
        Store of the records; made if missing.
    scheduler
        The word mpi in its place: the other ranks of `mpirun -n RANKS python -m mpi4py.futures
        -m lockedjoint campaign …` do the work.
    time_limit
        Time in seconds after which the worker of a start is ended.
    chunk
        Number of starts that a worker is sent at once, at least 10; more on a large cluster.
    """
    from lockedjoint.formulations.campaign.campaign import read, run
    from lockedjoint.formulations.campaign.records import cell_of, open_store

    if workers is not None and scheduler is not None:
        raise InputError("--workers", workers, "none with --scheduler")
    if chunk < _LEAST_CHUNK:
        raise InputError("--chunk", chunk, f"a whole number of at least {_LEAST_CHUNK}")
    declared = read(file)
    with (
        _executor(workers, scheduler) as executor,
        open_store(store, writable=True) as study,
    ):
        capacity = _AT_THE_SCHEDULER if scheduler not in (None, _MPI) else None
        report = run(declared, study, executor, time_limit, chunk, capacity, progress=True)
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
    failure = [
        f"Failed: start {start} of {case.name} n={case.arm.shape[1]} {reason}."
        for case, start, reason in report.failed
    ]
    if report.missing and not failure:
        again = "Interrupted: run the same command again to go on."
        return Answer(values, text, failure=[again], status=INTERRUPTED)
    return Answer(values, text, failure=failure)


@contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """Yield the executor of a running Dask cluster, and leave the cluster at the end.

    The address is that of its scheduler, such as ``tcp://host:8786``. Start workers with one
    thread each: MUMPS is not safe with several. Whoever reaches the scheduler can run code on
    the scheduler and on the workers. WorkerError if none answers at the address.
    """
    from lockedjoint.formulations.io.objects import library

    distributed = library("distributed", package="dask distributed")
    for part in ("distributed", "distributed.client", "tornado"):
        logging.getLogger(part).setLevel(logging.CRITICAL)  # our own errors say what ended
    failure = ""
    try:
        client = distributed.Client(address, timeout=_CONNECT_SECONDS, set_as_default=False)
    except (OSError, TypeError, ValueError) as reason:
        failure = f"No Dask scheduler answers at {address} ({reason})."
    if failure:
        gc.collect()  # the half-made client ends now: while another begins it would wait for it
        raise WorkerError(failure)
    try:
        yield client.get_executor(pure=False)
    finally:
        with suppress(Exception):  # a scheduler that has ended does not answer
            client.close(timeout=_LEAVE_SECONDS)


def _executor(workers: int | None, scheduler: str | None) -> AbstractContextManager[Executor]:
    """Return what solves: processes of this machine, a Dask cluster, or the ranks of MPI.

    `workers` is the number of processes, None for one per core; `scheduler` is the address of a
    Dask scheduler, "mpi", or None. MissingLibraryError if mpi4py is not installed.
    """
    from lockedjoint.nlp.executors import LocalExecutor, default_workers

    if scheduler not in (None, _MPI):
        return dask_executor(scheduler)
    if scheduler == _MPI:
        try:
            from mpi4py.futures import MPIPoolExecutor
        except ImportError:
            raise MissingLibraryError("mpi4py") from None
        executor: Executor = MPIPoolExecutor()
        return executor
    return LocalExecutor(workers or default_workers())


def show(
    store: Path,
    where: list[str] | None = None,
    group_by: list[str] | None = None,
    rows: str = "groups",
    columns: list[str] | None = None,
    to: str | None = None,
    out: Path | None = None,
    as_json: bool = False,
) -> None:
    """Show what a campaign's store holds, also while the campaign runs.

    By default one row per group of records: starts, how many the solver solved, how many pass
    the independent check, how many reached the best known answer of their problem, its score,
    the proved bound and the gap, and the processor time of a start and of a success. Matrices
    are in CSV and JSON only, with every digit. The whole store is verified first: one with a
    damaged record is refused, and the exit status is 1.

    Parameters
    ----------
    store
        Store of a campaign.
    where
        By default all records.
    group_by
        Settings that make groups, such as joints,model; by default all that differ.
    rows
        What the rows are: groups of records; single records; or optima, with their canonical
        form and how many starts reached each.
    to
        The form of what is printed: csv with every digit, markdown or latex; by default for a
        terminal.
    out
        The file that is written: the table, in place of printing it.
    """
    from lockedjoint.formulations.campaign import tables
    from lockedjoint.formulations.campaign.records import open_store
    from lockedjoint.formulations.io.files import prepare_file, write_text

    one_of("--rows", rows, _ROWS)
    if to is not None:
        one_of("--to", to, tuple(_FORMATS))
    if group_by and rows != "groups":
        raise InputError("--group-by", ",".join(group_by), f"none with --rows {rows}")
    if as_json and to is not None:
        raise InputError("--to", to, "none with --json")
    chosen = " and ".join(f"({text})" for text in where or ())
    prepare_file(out, inputs=[store])
    some = None if columns is None or "all" in columns else columns
    in_full = as_json or to == "csv"
    if some and not in_full and (matrices := [name for name in _MATRICES if name in some]):
        raise InputError("--columns", matrices[0], "no matrix without --json or --to csv")
    with open_store(store) as study:
        table = tables.read_campaign(study, rows, chosen, group_by, some)
        form = to or ("markdown" if out is not None else "terminal")
        content = _as_json(table) if as_json else _written(table, form, columns)
        if out is not None:
            write_text(out, content)
        else:
            say(content, nl=as_json)


def _written(table: pd.DataFrame, form: str, columns: list[str] | None) -> str:
    """Return the table in a form of `_FORMATS`, or for a terminal with the columns that fit."""
    if form != "terminal":
        return _FORMATS[form](table)
    brief = _brief(table)
    cells = {str(name): list(brief[name]) for name in brief}
    heads = {name: name.replace("_", " ") for name in cells}
    return f"{chosen_columns(cells, heads, None if columns is None else ['all'])}\n"


def _as_json(table: pd.DataFrame) -> str:
    """Return the rows as JSON: every digit, matrices as lists, null for what is missing."""
    rows = table.astype(object).where(table.notna(), None).to_dict(orient="records")
    for row in rows:
        row |= {name: _parsed(name, row[name]) for name in _NESTED if row.get(name)}
        if "start" in row and row.get("valid") in (0, 1):  # in groups a number of starts
            row["valid"] = bool(row["valid"])
    return json.dumps(rows, indent=1)


def _parsed(name: str, text: str) -> object:
    """Return the JSON in a column of a store, which may be anybody's; StoreError if none."""
    try:
        return json.loads(text)
    except (ValueError, TypeError, RecursionError):
        raise StoreError(f"{name} of a record", text, "JSON") from None


def _rows(table: pd.DataFrame) -> list[dict[str, object]]:
    """Return the rows of a table, columns by their names as text."""
    rows = table.to_dict("records")
    return [{str(name): value for name, value in row.items()} for row in rows]


def _brief(table: pd.DataFrame) -> pd.DataFrame:
    """Return the table as text with few digits, without the matrices."""
    brief = table.drop(columns=_MATRICES, errors="ignore").astype(object)
    for name in brief:
        digits = _PRECISE_DIGITS if name in _PRECISE else _DIGITS
        brief[name] = [shown(value, digits) for value in brief[name]]
    return brief


def _to_read(
    table: pd.DataFrame, style: str, escape: Callable[[str], str], underscore: str = "_"
) -> str:
    """Return the table as text for a page, with few digits and without the matrices.

    `style` is a table format of tabulate, `escape` makes a cell safe in it, and `underscore`
    stands for the underscores of the columns' names.
    """
    from lockedjoint.formulations.io.table import written

    brief = _brief(table).map(escape)
    heads = [escape(str(name).replace("_", underscore)) for name in brief]
    return f"{written(brief.to_numpy().tolist(), heads, style)}\n"


# Functions that write a table, by the forms of `show --to`. CSV has every digit.
_FORMATS: Mapping[str, Callable[[pd.DataFrame], str]] = {
    "csv": lambda table: rows_csv(_rows(table), [str(name) for name in table]),
    "markdown": lambda table: _to_read(table, "pipe", markdown_cell),
    "latex": lambda table: latex(_to_read(table, "latex_booktabs", str, underscore=" ")),
}


def join(store: Path, others: list[Path], as_json: bool = False) -> None:
    """Bring the records of other stores into one, which is made if missing.

    With a new store and one other it is the way to copy a store. The others stay as they are.
    Where two stores have the same start of the same problem, the records must be equal, apart
    from the time they took; if one is not, nothing of that store is joined. A store with a
    damaged record is refused, and the exit status is 1.

    Parameters
    ----------
    store
        Store that takes the records in.
    others
        Stores to join to it.
    """
    from lockedjoint.formulations.campaign.records import TIMES, open_store

    joined: list[dict[str, object]] = []
    with ExitStack() as stack:
        sources = [stack.enter_context(open_store(other)) for other in others]
        study = stack.enter_context(open_store(store, writable=True))
        for source in sources:
            added, known = study.join(source, TIMES)
            row = {"store": str(source.path), "added": added, "already_there": known}
            joined.append(row)
            if not as_json:
                text = f"{added} records of {source.path} are new, {known} were there already."
                say(text)
    if as_json:
        Answer({"store": str(store), "joined": joined}).show(as_json)
