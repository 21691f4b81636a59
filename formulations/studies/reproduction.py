"""The reproduction of the paper as a study."""

from __future__ import annotations

from pathlib import Path

from formulations.files.rows import read_rows
from formulations.reproduction import Row, has_mismatch, iterate
from formulations.studies.reproduction_finding import finding
from formulations.studies.reproduction_report import write
from formulations.studies.study import Effort, Study

TABLE = "reproduction.csv"
STARTS = 100


def study() -> Study:
    """Return the reproduction."""
    return Study(
        name="reproduction",
        title="every numbered example and claim of the paper, computed anew",
        page="reproduction.md",
        table=TABLE,
        command="lockedjoint reproduce --out results/reproduction",
        takes="ten seconds",
        long=False,
        run=_run,
        finding=lambda folder: finding(read_rows(folder / TABLE, Row)),
    )


def _run(folder: Path, effort: Effort) -> str:
    rows = []
    for row in iterate(effort.seed, effort.starts_or(STARTS)):
        effort.progress(f"{row.equation} {row.quantity}")
        rows.append(row)
    write(rows, folder, effort.seed, complete=True)
    return "a row is an unexplained mismatch" if has_mismatch(rows) else ""
