"""The study as files and as text."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from formulations.files.provenance import header
from formulations.studies.failures.finding import finding
from formulations.studies.failures.row import Row, Summary
from nlp.files import write_text

_SHOWN = {
    "model": "model",
    "task_dimension": "m",
    "joints": "n",
    "locked": "k",
    "failing": "failing",
    "goal": "objective",
    "encoding": "encoding",
    "starts_from": "from",
    "starts": "starts",
    "solved": "solved",
    "reached_best": "reached best",
    "merit": "best",
    "bound": "bound",
    "gap_percent": "gap %",
    "worst_case_sigma": "worst σ",
    "expected_sigma": "expected σ",
    "distinct_optima": "optima",
    "iterations_median": "iterations",
    "milliseconds_per_start": "CPU ms per start",
}
_FORMATS = {
    "merit": "{:.7f}",
    "bound": "{:.7f}",
    "gap_percent": "{:z.2f}",
    "worst_case_sigma": "{:.5f}",
    "expected_sigma": "{:.5f}",
    "iterations_median": "{:g}",
    "milliseconds_per_start": "{:.3g}",
}


def table(rows: Sequence[Row]) -> pd.DataFrame:
    """All columns, one line per row."""
    columns = list(Row.__dataclass_fields__)
    return pd.DataFrame([one.to_dict() for one in rows], columns=columns)


def summary(rows: Sequence[Row]) -> pd.DataFrame:
    """Return the columns to read, as text."""
    frame = table(rows)
    for column, style in _FORMATS.items():
        frame[column] = [
            "–" if pd.isna(value) else style.format(value) for value in frame[column]
        ]
    frame["distinct_optima"] = [str(count or "–") for count in frame["distinct_optima"]]
    return frame[list(_SHOWN)].rename(columns=_SHOWN)


def markdown(rows: Sequence[Row], seed: int, complete: bool) -> str:
    """Return the study as a Markdown page."""
    note = "" if complete else "\nInterrupted or still running: not all rows are here.\n"
    shown = summary(rows).to_markdown(index=False, disable_numparse=True)
    return (
        f"# Several and unequal failures\n\n{header({'seed': seed})}{note}\n{finding(rows)}\n\n"
        f"{shown}\n\n"
        "The objective 'worst' is the least σ_F/w_F, w_F the failure's probability over the\n"
        "likeliest one's; 'expected' the mean of σ_F. Bounds hold for every Jacobian of the "
        "same\n‖J‖_F, where failures are unequal of the same column norms; that on the "
        "expectation is\n"
        "not sharp. Joints are counted from 0.\n"
    )


def write(summaries: Sequence[Summary], folder: Path, seed: int, complete: bool) -> None:
    """Write ``failures.csv``, ``failures.md`` and ``jacobians.json`` into the folder.

    Raises
    ------
    FileError
        If a file cannot be written.
    """
    rows = [one.row for one in summaries]
    jacobians = [{**one.row.to_dict(), "jacobian": one.jacobian.tolist()} for one in summaries]
    write_text(folder / "failures.csv", table(rows).to_csv(index=False))
    write_text(folder / "failures.md", markdown(rows, seed, complete))
    write_text(folder / "jacobians.json", json.dumps(jacobians, indent=1) + "\n")
