"""``README.md`` in front of the results, made from the tables in their folders."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import isnan
from pathlib import Path
from types import MappingProxyType
from typing import Any

from formulations import isotropy, max_min, residual
from formulations.files.provenance import read_header
from formulations.files.table import Table, column
from formulations.studies import pages
from formulations.studies.bounds import sharpest
from formulations.studies.comparison import Row
from formulations.studies.running import STUDIES
from formulations.studies.study import Rows, Study
from nlp.errors import FileError
from nlp.files import write_text

PAGE = "README.md"
_TEMPLATE = "results.md.j2"
_ARMS = {
    (7, "unit-revolute"): "7R, unit lever arms",
    (7, "lever-revolute"): "7R, free lever arms",
    (8, "unit-revolute"): "8R, unit lever arms",
    (8, "lever-revolute"): "8R, free lever arms",
}
# Figures that show what a study found, by the study's name.
_PICTURES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "reproduction": ("figure-1", "figure-3"),
        "comparison": ("trade-off", "optima"),
        "bounds": ("singular-values",),
        "figures": ("seven-axes",),
    }
)
_DASH = "–"


@dataclass(frozen=True)
class Line:
    """A line of the table in front, as text: the best of a formulation on an arm."""

    arm: str
    formulation: str
    best_value: str = _DASH
    certified_bound: str = _DASH
    gap_percent: str = field(default=_DASH, metadata=column("gap %"))
    worst_case_sigma: str = field(default=_DASH, metadata=column("worst-case σ"))
    isotropy_defect: str = _DASH
    success: str = _DASH
    cost: str = field(default=_DASH, metadata=column("CPU ms per success"))


def write_front_page(
    out: Path, seed: int, made: Collection[str], failed: Mapping[str, str]
) -> None:
    """Write the front page of the results into their folder.

    Parameters
    ----------
    out
        The folder of the studies' folders.
    seed
        That this run was given.
    made
        Names of the studies that this run computed.
    failed
        Names of those that it could not compute, and why.

    Raises
    ------
    FileError
        If the page cannot be written.
    """
    write_text(out / PAGE, front_page(out, seed, made, failed))


def front_page(out: Path, seed: int, made: Collection[str], failed: Mapping[str, str]) -> str:
    """Return the front page as Markdown; see `write_front_page`."""
    values = {
        **_values(read_all(out)),
        "seed": seed,
        "made": made,
        "failed": failed,
        "studies": STUDIES.values(),
        "dates": {name: _date(study, out) for name, study in STUDIES.items()},
        "findings": {name: finding_in(study, out) for name, study in STUDIES.items()},
        "pictures": {
            name: [one for one in files if (out / "figures" / f"{one}.svg").exists()]
            for name, files in _PICTURES.items()
        },
    }
    return pages.page(_TEMPLATE, values)


def read_all(out: Path) -> Rows:
    """Return the rows of all studies in a folder, by the name of the table.

    Tables of one name are joined. A table that is not there, or not of this version, has no
    rows.
    """
    found: dict[str, list[Any]] = {stem: [] for one in STUDIES.values() for stem in one.tables}
    for study in STUDIES.values():
        try:
            tables = study.read(out / study.name)
        except FileError:
            continue
        for stem, rows in tables.items():
            found[stem] += rows
    return found


def learned(tables: Rows) -> str:
    """Return what was learned that the paper did not know, as a Markdown list."""
    return pages.bullets(pages.block(_TEMPLATE, "learned", _values(tables)))


def formulation_table(rows: Sequence[Row]) -> str:
    """Return the formulations on 7R and 8R as a Markdown table; what is missing is dashes."""
    lines = []
    for (joints, model), arm in _ARMS.items():
        for formulation in (residual.NAME, max_min.NAME, isotropy.NAME):
            row = plain(rows, formulation, model, joints)
            lines.append(Line(arm, formulation) if row is None else line_of(arm, row))
    return Table(Line, lines).markdown()


def line_of(arm: str, row: Row) -> Line:
    """Return a row of the comparison as a line of the table in front."""
    success = f"{row.reached_best} of {row.starts}"
    if row.verdict != "solved":
        proof = row.certificate if row.verdict == "proved infeasible" else _DASH
        return Line(arm, row.formulation, row.verdict, proof, success=success)
    small = row.merit < pages.NOTHING or isnan(row.certified_gap_percent)
    return Line(
        arm,
        row.formulation,
        best_value=_value(row.merit),
        certified_bound=f"{_value(row.certified_bound)}, {row.certificate}",
        gap_percent=_DASH if small else f"{row.certified_gap_percent:z.2f}",
        worst_case_sigma=f"{row.worst_case_sigma:.6f}",
        isotropy_defect=_value(row.isotropy_defect),
        success=success,
        cost=f"{1e3 * row.cpu_seconds_per_success:.3g}",
    )


def plain(rows: Sequence[Row], formulation: str, model: str, joints: int) -> Row | None:
    """Return the comparison's row without a variant, if it is there."""
    wanted = (formulation, model, joints, "")
    found = (r for r in rows if (r.formulation, r.model, r.joints, r.variant) == wanted)
    return next(found, None)


def finding_in(study: Study, out: Path) -> str:
    """Return what a study in a folder shows, or why that cannot be said."""
    if not (out / study.name / study.table).exists():
        return f"Not there; `{study.command}` makes it."
    try:
        return study.finding(study.read(out / study.name))
    except FileError:
        return f"Its table is not of this version; `{study.command}` makes it anew."


def _values(tables: Rows) -> dict[str, Any]:
    return {
        **tables,
        "plain": partial(plain, tables["comparison"]),
        "sharpest": sharpest,
        "formulation_table": formulation_table,
    }


def _date(study: Study, out: Path) -> str:
    page = out / study.name / study.page
    if not page.is_file():
        return ""
    return read_header(page.read_text(encoding="utf-8")).get("date", "unknown date")


def _value(number: float) -> str:
    if isnan(number):
        return _DASH
    small = f"< {pages.NOTHING:g}"
    return "0" if number == 0 else small if number < pages.NOTHING else f"{number:.6f}"
