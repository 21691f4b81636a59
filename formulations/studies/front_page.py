"""``README.md`` in front of the results, made from the tables in their folders."""

from collections.abc import Collection, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

from formulations.io.provenance import read_header
from formulations.studies import pages
from formulations.studies.bounds import sharpest
from formulations.studies.comparison import ComparisonRow
from formulations.studies.running import STUDIES
from formulations.studies.study import Rows, Study
from nlp.errors import FileError

PAGE = "README.md"
_TEMPLATE = "results.md.j2"
# Figures that show what a study found, by the study's name.
_PICTURES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "reproduction": ("figure-1", "figure-3"),
        "comparison": ("trade-off", "optima"),
        "bounds": ("singular-values",),
        "figures": ("seven-axes",),
    }
)


def front_page(out: Path, seed: int, made: Collection[str], failed: Mapping[str, str]) -> str:
    """Return the front page as Markdown.

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
    """
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


def formulation_table(tables: Rows) -> str:
    """Return the formulations on 7R and 8R as a Markdown table; what is missing is dashes."""
    return pages.aligned(pages.block(_TEMPLATE, "formulations", _values(tables)))


def plain(
    rows: Sequence[ComparisonRow], formulation: str, model: str, joints: int
) -> ComparisonRow | None:
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
    return {**tables, "plain": partial(plain, tables["comparison"]), "sharpest": sharpest}


def _date(study: Study, out: Path) -> str:
    page = out / study.name / study.page
    if not page.is_file():
        return ""
    return read_header(page.read_text(encoding="utf-8")).get("date", "unknown date")
