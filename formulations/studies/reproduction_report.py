"""The reproduction as files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from formulations.files.provenance import header
from formulations.reproduction.row import Row
from formulations.studies.reproduction_finding import finding
from nlp.files import write_text

COLUMNS = ("equation", "quantity", "paper", "ours", "verdict", "note")


def table(rows: Sequence[Row]) -> pd.DataFrame:
    """All columns, one line per row, as text."""
    return pd.DataFrame([row.to_dict() for row in rows], columns=list(COLUMNS), dtype=str)


def markdown(rows: Sequence[Row], seed: int, complete: bool) -> str:
    """Return the reproduction as a Markdown page."""
    counts = Counter(str(row.verdict) for row in rows)
    said = ", ".join(f"{count} {verdict}" for verdict, count in sorted(counts.items()))
    note = "" if complete else "\nInterrupted or still running: not all rows are here.\n"
    return (
        f"# The paper, reproduced\n\n{header({'seed': seed, 'verdicts': said})}{note}\n"
        f"{finding(rows)}\n\n"
        f"{escaped(rows).to_markdown(index=False, disable_numparse=True)}\n"
    )


def escaped(rows: Sequence[Row]) -> pd.DataFrame:
    """All columns, with the bars that would end a cell of a Markdown table escaped."""
    return table(rows).map(lambda text: text.replace("|", "\\|"))


def write(rows: Sequence[Row], folder: Path, seed: int, complete: bool) -> None:
    """Write ``reproduction.csv`` and ``reproduction.md`` into the folder.

    Raises
    ------
    FileError
        If a file cannot be written.
    """
    write_text(folder / "reproduction.csv", table(rows).to_csv(index=False))
    write_text(folder / "reproduction.md", markdown(rows, seed, complete))
