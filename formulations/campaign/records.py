"""The columns of a study on disk: the settings of a cell, and a run as one of its records.

The Jacobian is kept as little-endian eight-byte floats, row after row: exact, in a third of the
space that exact decimal digits would take. Its shape is in the settings.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial

import numpy as np

from formulations.catalogue import arm
from formulations.io.provenance import provenance
from formulations.joints.arm import Arm
from formulations.solving.record import Record, judge
from formulations.solving.setup import Setup, solver_options
from nlp.arrays import FloatArray
from nlp.errors import InputError, StoreError
from nlp.solution import Solution, Status
from nlp.store_schema import Kind, Schema, Value
from nlp.task import Run, Task

# Each setting of a cell and each value of a record: its kind, and where it comes from.
_SETTINGS: Mapping[str, tuple[Kind, Callable[[Cell], Value]]] = {
    "formulation": ("TEXT", lambda cell: cell.setup.formulation),
    "model": ("TEXT", lambda cell: cell.setup.model),
    "joints": ("INTEGER", lambda cell: cell.joints),
    "task_dimension": ("INTEGER", lambda cell: cell.task_dimension),
    "locked": ("INTEGER", lambda cell: cell.setup.locked),
    "encoding": ("TEXT", lambda cell: cell.encoding),
    "from_residual_minima": ("INTEGER", lambda cell: int(cell.setup.from_residual_minima)),
    "solver": ("TEXT", lambda cell: cell.solver),
    "compiled": ("INTEGER", lambda cell: int(cell.compiled)),
    "options": ("TEXT", lambda cell: json.dumps(cell.all_options, sort_keys=True)),
    "seed": ("INTEGER", lambda cell: cell.seed),
}
_VALUES: Mapping[str, tuple[Kind, Callable[[Record, Solution], Value]]] = {
    "status": ("TEXT", lambda record, _: record.status.return_status),
    "iterations": ("INTEGER", lambda record, _: record.status.iterations),
    "primal_infeasibility": ("REAL", lambda record, _: record.status.primal_infeasibility),
    "dual_infeasibility": ("REAL", lambda record, _: record.status.dual_infeasibility),
    "barrier": ("REAL", lambda record, _: record.status.barrier),
    "objective": ("REAL", lambda _, solution: solution.objective),
    "violation": ("REAL", lambda record, _: record.violation),
    "valid": ("INTEGER", lambda record, _: int(record.valid)),
    "merit": ("REAL", lambda record, _: record.merit),
    "worst_case_sigma": ("REAL", lambda record, _: record.worst_case_sigma),
    "condition_number": ("REAL", lambda record, _: record.condition_number),
    "isotropy_defect": ("REAL", lambda record, _: record.isotropy_defect),
    "jacobian": ("BLOB", lambda record, _: record.jacobian.astype("<f8").tobytes()),
    "ran_compiled": ("INTEGER", lambda _, solution: int(solution.compiled)),
    "solver_cpu_seconds": ("REAL", lambda record, _: record.status.cpu_seconds),
    "solver_wall_seconds": ("REAL", lambda record, _: record.status.wall_seconds),
    "cpu_seconds": ("REAL", lambda record, _: record.cpu_seconds),
    "earlier": ("TEXT", lambda record, _: _accounts(record.earlier)),
}
# Times, and accounts that have times in them.
TIMES = ("solver_cpu_seconds", "solver_wall_seconds", "cpu_seconds", "earlier")
# Raise the version with any change of the columns, and add the statements that bring a store
# of the version before to it; a study may have cost weeks.
SCHEMA = Schema(
    application=0x6C6A7331,
    version=3,
    settings={name: kind for name, (kind, _) in _SETTINGS.items()},
    values={name: kind for name, (kind, _) in _VALUES.items()},
    migrations={
        # Version 1 did not keep whether the functions ran compiled: it is not known.
        1: ("ALTER TABLE record ADD COLUMN ran_compiled INTEGER",),
        # Version 2 knew of one stage only; the store adds the checksums.
        2: ("ALTER TABLE record ADD COLUMN earlier TEXT DEFAULT '[]'",),
    },
)


@dataclass(frozen=True)
class Cell:
    """One problem and how it is solved: all that decides its records.

    Attributes
    ----------
    setup
        The formulation on its column model.
    joints, task_dimension
        n and m.
    seed
        Seed of the starts.
    options
        Solver options, over the formulation's own.
    solver, compiled
        See `nlp.solver.Solver`.

    Raises
    ------
    InputError
        If the setup has a failure model, which the settings of a cell do not contain.
    """

    setup: Setup
    joints: int
    task_dimension: int
    seed: int = 0
    options: Mapping[str, object] = field(default_factory=dict)
    solver: str = "ipopt"
    compiled: bool = False

    def __post_init__(self) -> None:
        if self.setup.failures is not None:
            # Cells with different failure models would have the same settings.
            raise InputError("failure model", "given", "left out in a campaign")

    def task(self) -> Task[dict[str, Value]]:
        """Return what workers do at each start.

        Raises
        ------
        InputError
            If the arm, a setting or an option is not allowed.
        """
        one = self.setup
        built = arm(one.model, self.joints, self.task_dimension)
        return Task(
            one.build(self.joints, self.task_dimension),
            one.sample(built),
            self.all_options,
            partial(keep, arm=built, merit=one.merit(), locked=one.locked),
            self.solver,
            self.compiled,
        )

    def settings(self) -> dict[str, Value]:
        """Return what identifies this cell in a store."""
        return {name: read(self) for name, (_, read) in _SETTINGS.items()}

    @property
    def encoding(self) -> str:
        """Encoding of the eigenvalue constraints; empty for a formulation without a choice."""
        return self.setup.encoding

    @property
    def all_options(self) -> Mapping[str, object]:
        """Solver options, those of the formulation included."""
        one = self.setup
        return solver_options(one.formulation, self.solver, self.options, one.encoding)


def keep(
    run: Run, arm: Arm, merit: Callable[[FloatArray], float], locked: int = 1
) -> dict[str, Value]:
    """Judge a run in the process that ran it; return its values and ``environment``.

    See `formulations.solving.record.judge` for the parameters.
    """
    record = judge(run, arm, merit, locked)
    values = {name: read(record, run.solution) for name, (_, read) in _VALUES.items()}
    return {**values, "environment": _environment()}


def _accounts(earlier: Sequence[Status]) -> str:
    """Accounts of the solver as JSON; null for what is not finite, as JSON has it."""
    plain = [
        {name: None if value != value else value for name, value in one.to_dict().items()}
        for one in earlier
    ]
    return json.dumps(plain)


def jacobian_of(raw: bytes, task_dimension: int, joints: int) -> FloatArray:
    """Return the Jacobian that a record keeps, shape (m, n).

    Raises
    ------
    StoreError
        If it has another size: the checksum of a record does not prove who made it.
    """
    m, n = task_dimension, joints
    if not (isinstance(raw, bytes) and m >= 1 and n >= 1 and len(raw) == 8 * m * n):
        found = f"{len(raw)} bytes" if isinstance(raw, bytes) else "missing"
        raise StoreError("Jacobian of a record", found, f"{m} x {n} numbers of 8 bytes")
    return np.frombuffer(raw, "<f8").reshape(task_dimension, joints).astype(np.float64)


@lru_cache(maxsize=1)
def _environment() -> str:
    return provenance()["versions"]
