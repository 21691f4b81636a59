"""The bounds as a study: JSON files as the command prints them, and tables made from them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from formulations.files.provenance import provenance, versions
from formulations.files.rows import read_rows
from formulations.studies.bounds.finding import finding
from formulations.studies.bounds.page import markdown, table
from formulations.studies.bounds.rows import (
    BoundRow,
    ExistenceRow,
    Origin,
    bound_row,
    command,
    existence_row,
    is_relaxation,
)
from formulations.studies.bounds.runs import RUNS
from formulations.studies.study import Effort, Study
from nlp.files import write_text

TABLE, RELAXATIONS, PAGE = "bounds.csv", "relaxations.csv", "README.md"
_UNKNOWN = "not recorded"


def study() -> Study:
    """Return the study of bounds."""
    return Study(
        name="bounds",
        title="how good any answer could be: eq. (6), the residual, max-min, existence",
        page=PAGE,
        table=TABLE,
        command="lockedjoint report --only bounds --out results",
        takes="eight minutes",
        long=False,
        run=_run,
        finding=lambda folder: finding(
            read_rows(folder / TABLE, BoundRow), read_rows(folder / RELAXATIONS, ExistenceRow)
        ),
    )


def _run(folder: Path, effort: Effort) -> str:
    origins = _origins(folder)
    for run in RUNS:
        effort.progress(run.file)
        plain = run.compute(effort)
        write_text(folder / run.file, json.dumps(plain, indent=1) + "\n")
        origins[run.file] = _here(command(plain))
    write_tables(folder, effort.seed, origins)
    return ""


def write_tables(folder: Path, seed: int, origins: dict[str, Origin]) -> None:
    """Write the tables and the page from the JSON files in a folder.

    Raises
    ------
    FileError
        If a file cannot be written.
    """
    bounds, relaxations = [], []
    for path in sorted(folder.glob("*.json"), key=_place):
        plain: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        unknown = Origin(command(plain), _UNKNOWN, _UNKNOWN, _UNKNOWN)
        origin = origins.get(path.name, unknown)
        if is_relaxation(plain):
            relaxations.append(existence_row(path.name, plain, origin))
        else:
            bounds.append(bound_row(path.name, plain, origin))
    write_text(folder / TABLE, table(bounds).to_csv(index=False))
    write_text(folder / RELAXATIONS, table(relaxations).to_csv(index=False))
    page = markdown(bounds, relaxations, seed, finding(bounds, relaxations))
    write_text(folder / PAGE, page + _further(folder))


def _further(folder: Path) -> str:
    """Links to pages in the folder that others wrote."""
    pages = sorted(path.name for path in folder.glob("*.md") if path.name != PAGE)
    return "".join(f"\nSee also [{name}]({name}).\n" for name in pages)


def _place(path: Path) -> tuple[int, str]:
    order = [run.file for run in RUNS]
    return (order.index(path.name) if path.name in order else len(order), path.name)


def _origins(folder: Path) -> dict[str, Origin]:
    """Where the files that are there already came from, by name."""
    rows: list[BoundRow | ExistenceRow] = []
    if (folder / TABLE).exists():
        rows += read_rows(folder / TABLE, BoundRow)
    if (folder / RELAXATIONS).exists():
        rows += read_rows(folder / RELAXATIONS, ExistenceRow)
    return {r.file: Origin(r.command, r.versions, r.machine, r.date) for r in rows}


def _here(made_by: str) -> Origin:
    now = provenance()
    all_versions = f"{now['versions']}, {versions(['cvxpy', 'clarabel'])}"
    return Origin(made_by, all_versions, now["machine"], now["date"])
