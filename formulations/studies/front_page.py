"""``README.md`` in front of the results, made from the tables in their folders."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from types import MappingProxyType

import pandas as pd

from formulations.files.provenance import header, read_header
from formulations.studies.formulation_table import NOTES, formulation_table
from formulations.studies.learned import learned
from formulations.studies.studies import STUDIES
from formulations.studies.study import Study
from formulations.studies.tables import read_tables
from nlp.errors import FileError
from nlp.files import write_text

PAGE = "README.md"
# Figures that show what a study found, by the study's name.
_PICTURES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "reproduction": ("figure-1", "figure-3"),
        "comparison": ("trade-off", "optima"),
        "bounds": ("singular-values",),
        "figures": ("seven-axes",),
    }
)


def write_front_page(
    out: Path, seed: int, made: Collection[str], failed: Mapping[str, str]
) -> None:
    """Write the front page of the results in a folder.

    Parameters
    ----------
    out
        The folder of the studies' folders.
    seed
        That this run was given.
    made
        Names of the studies that this run computed.
    failed
        Names of those that it tried to, and why it could not.

    Raises
    ------
    FileError
        If the page cannot be written.
    """
    write_text(out / PAGE, front_page(out, seed, made, failed))


def front_page(out: Path, seed: int, made: Collection[str], failed: Mapping[str, str]) -> str:
    """Return the front page as Markdown; see `write_front_page`."""
    tables = read_tables(out)
    items = "\n".join(f"- {text}" for text in learned(tables))
    studies = "\n\n".join(_section(study, out) for study in STUDIES.values())
    return (
        f"# Results\n\n{header({'seed': seed})}\n"
        "Seven and eight revolute joints in six dimensions, the three formulations from\n"
        f"common random starts:\n\n{formulation_table(tables)}\n\n{NOTES}\n"
        f"## What was learned that the paper did not know\n\n{items or 'Nothing yet.'}\n\n"
        "## Studies\n\n"
        "Each folder holds a table as CSV and as Markdown, under the command, seed, versions,\n"
        f"machine and date that made it. `{_all()}` makes all of them.\n\n"
        f"{_list(out, made)}\n\n{studies}\n\n{_left_out(out, made, failed)}"
    )


def _all() -> str:
    return "lockedjoint report --all --out results"


def _list(out: Path, made: Collection[str]) -> str:
    lines = []
    for study in STUDIES.values():
        date = _date(study, out)
        link = f"[{study.name}]({study.name}/{study.page})" if date else study.name
        when = f"{date or '–'}{'' if study.name in made or not date else ' (kept)'}"
        lines.append([link, f"`{study.command}`", study.takes, when])
    heads = ["study", "by itself", "takes, on two cores", "made"]
    frame = pd.DataFrame(lines, columns=heads)
    return str(frame.to_markdown(index=False, disable_numparse=True))


def _section(study: Study, out: Path) -> str:
    heading = f"### {study.name}: {study.title}"
    return "\n\n".join([heading, finding_in(study, out), *_pictures(study, out)])


def _pictures(study: Study, out: Path) -> list[str]:
    files = [f"figures/{name}.svg" for name in _PICTURES.get(study.name, ())]
    return [f"![{Path(file).stem}]({file})" for file in files if (out / file).exists()]


def finding_in(study: Study, out: Path) -> str:
    """Return what a study in a folder shows, or why that cannot be said."""
    if not (out / study.name / study.table).exists():
        return f"Not there; `{study.command}` makes it."
    try:
        return study.finding(out / study.name)
    except FileError:
        return f"Its table is not of this version; `{study.command}` makes it anew."


def _left_out(out: Path, made: Collection[str], failed: Mapping[str, str]) -> str:
    lines = [
        f"- {_why(study, out, failed)}" for study in STUDIES.values() if study.name not in made
    ]
    if not lines:
        return ""
    return "## Left out of this run\n\n" + "\n".join(lines) + "\n"


def _why(study: Study, out: Path, failed: Mapping[str, str]) -> str:
    date = _date(study, out)
    kept = f"what is there is of {date}" if date else "nothing is there"
    if study.name in failed:
        return f"{study.name}: {failed[study.name]} ({kept})"
    reason = f"takes {study.takes}" if study.long else "not asked for"
    return f"{study.name}: {reason}; `{study.command}` makes it ({kept})"


def _date(study: Study, out: Path) -> str:
    page = out / study.name / study.page
    if not page.is_file():
        return ""
    return read_header(page.read_text(encoding="utf-8")).get("date", "unknown date")
