"""The comparison of the formulations as a study."""

from __future__ import annotations

from pathlib import Path

from formulations.files.rows import read_rows
from formulations.solving.setup import setups
from formulations.solving.solve import run
from formulations.studies.comparison.finding import finding
from formulations.studies.comparison.report import write
from formulations.studies.comparison.row import Row, summarise
from formulations.studies.study import Effort, Study

TABLE = "comparison.csv"
STARTS = 100
_TASK_DIMENSION = 6


def study(joints: int, name: str) -> Study:
    """Return the comparison for a number of joints."""
    option = "" if joints == 7 else f"--joints {joints} "
    return Study(
        name=name,
        title=f"the three formulations on {joints}R, from common starts",
        page="comparison.md",
        table=TABLE,
        command=f"lockedjoint compare {option}--out results/{name}",
        takes="under a minute",
        long=False,
        run=lambda folder, effort: _run(joints, folder, effort),
        finding=lambda folder: finding(read_rows(folder / TABLE, Row)),
    )


def _run(joints: int, folder: Path, effort: Effort) -> str:
    summaries = []
    for setup in setups(_TASK_DIMENSION):
        effort.progress(" ".join((setup.formulation, setup.model, setup.variant)))
        outcome = run(
            setup,
            joints=joints,
            task_dimension=_TASK_DIMENSION,
            starts=effort.starts_or(STARTS),
            seed=effort.seed,
            workers=effort.workers,
        )
        if not outcome.complete:
            raise KeyboardInterrupt
        summaries.append(summarise(outcome))
    write(summaries, folder, effort.seed, complete=True)
    return ""
