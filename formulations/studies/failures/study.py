"""Several and unequal failures as a study."""

from __future__ import annotations

from pathlib import Path

from formulations.files.rows import read_rows
from formulations.studies.failures.cases import several, unequal
from formulations.studies.failures.finding import finding
from formulations.studies.failures.report import write
from formulations.studies.failures.row import Row, solve
from formulations.studies.study import Effort, Study

TABLE = "failures.csv"
STARTS = 100


def study() -> Study:
    """Return the study of failures."""
    return Study(
        name="failures",
        title="several joints locked at once, joints that never fail, unequal probabilities",
        page="failures.md",
        table=TABLE,
        command="lockedjoint failures --out results/failures",
        takes="three minutes",
        long=False,
        run=_run,
        finding=lambda folder: finding(read_rows(folder / TABLE, Row)),
    )


def _run(folder: Path, effort: Effort) -> str:
    found = []
    for case in (*several(), *unequal()):
        arm = f"{case.setup.model} {case.task_dimension}×{case.joints}"
        effort.progress(f"{arm}, {case.setup.locked} locked, {case.failing}")
        one = solve(
            case,
            starts=effort.starts_or(STARTS),
            seed=effort.seed,
            workers=effort.workers,
            progress=False,
        )
        if one is None or not one.complete:
            raise KeyboardInterrupt
        found.append(one)
    write(found, folder, effort.seed, complete=True)
    return ""
