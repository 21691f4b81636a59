"""The columns of a study on disk, and a run as one of its records.

The Jacobian is kept as little-endian eight-byte floats, row after row: exact, in a third of the
space that exact decimal digits would take. Its shape is in the settings.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from formulations.files.provenance import provenance
from formulations.joints.arm import Arm
from formulations.solving.record import Record, judge
from nlp.arrays import FloatArray
from nlp.multistart import Run
from nlp.solution import Solution
from nlp.store_schema import Kind, Schema, Value

# Each value of a record: its kind, and where it comes from.
_VALUES: Mapping[str, tuple[Kind, Callable[[Record, Solution], Value]]] = MappingProxyType(
    {
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
    }
)
TIMES = ("solver_cpu_seconds", "solver_wall_seconds", "cpu_seconds")
# Raise the version with any change of the columns, and add the statements that bring a store
# of the version before to it; a study may have cost weeks.
SCHEMA = Schema(
    application=0x6C6A7331,
    version=2,
    settings={
        "formulation": "TEXT",
        "model": "TEXT",
        "joints": "INTEGER",
        "task_dimension": "INTEGER",
        "locked": "INTEGER",
        "encoding": "TEXT",
        "from_residual_minima": "INTEGER",
        "solver": "TEXT",
        "compiled": "INTEGER",
        "options": "TEXT",
        "seed": "INTEGER",
    },
    values={name: kind for name, (kind, _) in _VALUES.items()},
    migrations={
        # Version 1 did not keep whether the functions ran compiled: it is not known.
        1: ("ALTER TABLE record ADD COLUMN ran_compiled INTEGER",),
    },
)


@dataclass(frozen=True)
class Kept:
    """The values of a record, and what it was made with."""

    values: Mapping[str, Value]
    environment: str


def keep(run: Run, arm: Arm, merit: Callable[[FloatArray], float], locked: int = 1) -> Kept:
    """Judge a run in the process that ran it, and return what the store keeps of it.

    See `formulations.solving.record.judge` for the parameters.
    """
    record = judge(run, arm, merit, locked)
    values = {name: read(record, run.solution) for name, (_, read) in _VALUES.items()}
    return Kept(values, _environment())


def jacobian_of(raw: bytes, task_dimension: int, joints: int) -> FloatArray:
    """Return the Jacobian that a record keeps, shape (m, n)."""
    return np.frombuffer(raw, "<f8").reshape(task_dimension, joints).astype(np.float64)


@lru_cache(maxsize=1)
def _environment() -> str:
    return provenance()["versions"]
