"""The columns of a study on disk, and a run as one of its records.

The Jacobian is kept as little-endian eight-byte floats, row after row: exact, and a third of
the room that decimal digits enough to be exact would take. Its shape is in the settings.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np

from formulations import catalogue
from formulations.files.provenance import provenance
from formulations.joints.arm import Arm
from formulations.solving.record import judge
from nlp.arrays import FloatArray
from nlp.multistart import Run
from nlp.store_schema import Schema, Value

# Raise the version with any change below, and say how a store of the version before is
# brought to it; a study may have cost weeks.
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
    values={
        "status": "TEXT",
        "iterations": "INTEGER",
        "primal_infeasibility": "REAL",
        "dual_infeasibility": "REAL",
        "barrier": "REAL",
        "objective": "REAL",
        "violation": "REAL",
        "valid": "INTEGER",
        "merit": "REAL",
        "worst_case_sigma": "REAL",
        "condition_number": "REAL",
        "isotropy_defect": "REAL",
        "jacobian": "BLOB",
        "ran_compiled": "INTEGER",
        "solver_cpu_seconds": "REAL",
        "solver_wall_seconds": "REAL",
        "cpu_seconds": "REAL",
    },
    migrations={
        # Version 1 did not say whether what was to be compiled was: it is not known.
        1: ("ALTER TABLE record ADD COLUMN ran_compiled INTEGER",),
    },
)
TIMES = ("solver_cpu_seconds", "solver_wall_seconds", "cpu_seconds")


@dataclass(frozen=True)
class Kept:
    """The values of a record, and what it was made with."""

    values: Mapping[str, Value]
    environment: str


def keep(run: Run, arm: Arm, formulation: str, locked: int = 1) -> Kept:
    """Judge a run where it was run, and return what the store keeps of it.

    See `formulations.solving.record.judge` for the parameters.
    """
    record = judge(
        run, arm, partial(catalogue.formulation(formulation).merit, locked=locked), locked
    )
    status = record.status
    return Kept(
        {
            "status": status.return_status,
            "iterations": status.iterations,
            "primal_infeasibility": status.primal_infeasibility,
            "dual_infeasibility": status.dual_infeasibility,
            "barrier": status.barrier,
            "objective": run.solution.objective,
            "violation": record.violation,
            "valid": int(record.valid),
            "merit": record.merit,
            "worst_case_sigma": record.worst_case_sigma,
            "condition_number": record.condition_number,
            "isotropy_defect": record.isotropy_defect,
            "jacobian": record.jacobian.astype("<f8").tobytes(),
            "ran_compiled": int(run.solution.compiled),
            "solver_cpu_seconds": status.cpu_seconds,
            "solver_wall_seconds": status.wall_seconds,
            "cpu_seconds": record.cpu_seconds,
        },
        _environment(),
    )


def jacobian_of(raw: bytes, task_dimension: int, joints: int) -> FloatArray:
    """Return the Jacobian that a record keeps, shape (m, n)."""
    return np.frombuffer(raw, "<f8").reshape(task_dimension, joints).astype(np.float64)


@lru_cache(maxsize=1)
def _environment() -> str:
    return provenance()["versions"]
