"""What a campaign keeps: the text that identifies a case, and the columns of a record.

The Jacobian is kept as little-endian eight-byte floats, row after row: exact, in a third of the
space that exact decimal digits would take. Its shape is in the cell.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from lockedjoint.formulations.campaign.store import ColumnType, Store, Value
from lockedjoint.formulations.io.table import provenance
from lockedjoint.formulations.solving.case import Case
from lockedjoint.formulations.solving.outcome import Record, judge
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError, StoreError, as_path, of_kind
from lockedjoint.nlp.problem import Solution, Status
from lockedjoint.nlp.starts import Run, Task

# Each value of a record: its kind, and where it comes from.
_VALUES: Mapping[str, tuple[ColumnType, Callable[[Record, Solution], Value]]] = {
    "status": ("TEXT", lambda record, _: record.status.return_status),
    "iterations": ("INTEGER", lambda record, _: record.status.iterations),
    "primal_infeasibility": ("REAL", lambda record, _: record.status.primal_infeasibility),
    "dual_infeasibility": ("REAL", lambda record, _: record.status.dual_infeasibility),
    "barrier": ("REAL", lambda record, _: record.status.barrier),
    "objective": ("REAL", lambda _, solution: solution.objective),
    "violation": ("REAL", lambda record, _: record.violation),
    "valid": ("INTEGER", lambda record, _: int(record.valid)),
    "score": ("REAL", lambda record, _: record.score),
    "worst_case_sigma": ("REAL", lambda record, _: record.worst_case_sigma),
    "condition_number": ("REAL", lambda record, _: record.condition_number),
    "isotropy_defect": ("REAL", lambda record, _: record.isotropy_defect),
    "jacobian": ("BLOB", lambda record, _: record.jacobian.astype("<f8").tobytes()),
    "solver_cpu_seconds": ("REAL", lambda record, _: record.status.cpu_seconds),
    "solver_wall_seconds": ("REAL", lambda record, _: record.status.wall_seconds),
    "cpu_seconds": ("REAL", lambda record, _: record.cpu_seconds),
    "earlier": ("TEXT", lambda record, _: json.dumps([*map(_account, record.earlier)])),
}
#: The columns of a store, and their kinds.
COLUMNS: Mapping[str, ColumnType] = {name: kind for name, (kind, _) in _VALUES.items()}
#: Columns of times, and of accounts that have times in them: they differ from run to run.
TIMES = ("solver_cpu_seconds", "solver_wall_seconds", "cpu_seconds", "earlier")
#: Settings that every table has, also of formulations without them.
ALWAYS: Mapping[str, Value] = {"failures": 1, "encoding": "", "from_residual_minima": False}
# Number of bytes of a floating-point number in a record.
_BYTES_PER_NUMBER = 8
# What identifies a problem in a cell, and its kinds.
_PROBLEM = {"formulation": str, "model": str, "joints": int, "task_dimension": int}


def open_store(path: Path | str, *, writable: bool = False) -> Store:
    """Open the store of a campaign; use it in a ``with`` block, or close it.

    Parameters
    ----------
    path
        The file.
    writable
        Whether records can be added. A writable store is made if there is none.

    Raises
    ------
    FileError
        If the file cannot be opened, or is no SQLite file.
    StoreError
        If it has other tables, or if its structure or a record is damaged.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> try:
    ...     lj.open_store("nowhere.db")
    ... except lj.InputError as error:
    ...     print(error)
    store is nowhere.db; allowed: the file of a campaign (no such file).
    """
    of_kind("writable", writable, bool, "true or false")
    return Store(as_path("store", path), COLUMNS, writable=writable)


def cell_of(case: Case, seed: int) -> str:
    """Return the text that identifies a case and a random seed: JSON, keys in one order.

    The keys are formulation, model, joints, task_dimension, the settings that are not at their
    default and those of `ALWAYS`, solver, options and seed. If they or their order change,
    records on disk are no longer found. InputError if the case has a setting that it cannot
    hold, such as a failure model.
    """
    m, n = case.arm.shape
    settings = {}
    for name, value in case.settings.items():
        if value is not None and not isinstance(value, str | int | float):
            raise InputError(name.replace("_", " "), "given", "left out in a campaign")
        if name in ALWAYS or value != case.formulation.SETTINGS[name]:
            settings[name] = value
    identity = {
        "formulation": case.formulation.NAME,
        "model": case.model,
        "joints": n,
        "task_dimension": m,
        **ALWAYS,
        **settings,
        "solver": case.solver,
        "options": json.dumps(case.all_options, sort_keys=True),
        "seed": seed,
    }
    return json.dumps(identity)


def settings_of(cell: str) -> dict[str, object]:
    """Return the settings that a cell's text names; StoreError if it is none of `cell_of`.

    The digest of a record does not prove who made it.
    """
    try:
        settings = json.loads(cell)
        known = all(type(settings[name]) is kind for name, kind in _PROBLEM.items())
        kinds = str | int | float | None
        plain = all(isinstance(value, kinds) for value in settings.values())
        if known and plain and type(settings["failures"]) is int:
            return dict(settings)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        pass
    raise StoreError("case of a record", cell, "the settings of a case, as JSON")


def task_of(case: Case) -> Task[dict[str, Value]]:
    """Return what workers do at each start of a case."""
    return Task(case.build, case.sample, case.options, partial(_judged, case), case.solver)


def _judged(case: Case, run: Run) -> dict[str, Value]:
    """Judge a run in the process that ran it; return a record's values by column.

    The key ``environment`` has the versions of packages.
    """
    record = judge(case, run)
    values = {name: read(record, run.solution) for name, (_, read) in _VALUES.items()}
    return {**values, "environment": _environment()}


def _account(status: Status) -> dict[str, object]:
    """Return the solver's account as JSON has it: None, for null, in place of NaN."""
    plain = status.to_dict().items()
    return {name: None if value != value else value for name, value in plain}


def jacobian_of(raw: bytes, task_dimension: int, joints: int) -> FloatArray:
    """Return the Jacobian that a record keeps, shape (m, n); StoreError if it has another size.

    The digest of a record does not prove who made it.
    """
    m, n = task_dimension, joints
    size = _BYTES_PER_NUMBER * m * n
    if not (isinstance(raw, bytes) and m >= 1 and n >= 1 and len(raw) == size):
        found = f"{len(raw)} bytes" if isinstance(raw, bytes) else "missing"
        raise StoreError("Jacobian of a record", found, f"{m} x {n} numbers of 8 bytes")
    return np.frombuffer(raw, "<f8").reshape(m, n).astype(np.float64)


@lru_cache(maxsize=1)
def _environment() -> str:
    """Return the versions of packages in this process, as text."""
    return provenance()["versions"]
