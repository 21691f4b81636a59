"""The comparison as files and as text."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from formulations.files.provenance import header
from formulations.studies.comparison.finding import finding
from formulations.studies.comparison.row import Row, Summary
from nlp.files import write_text

_SHOWN = {
    "formulation": "formulation",
    "variant": "variant",
    "model": "model",
    "verdict": "verdict",
    "starts": "starts",
    "solved": "solved",
    "reached_best": "reached best",
    "objective": "objective",
    "certified_bound": "certified bound",
    "certified_gap_percent": "gap %",
    "certificate": "certificate",
    "numerical_bound": "numerical bound",
    "numerical_gap_percent": "numerical gap %",
    "worst_case_sigma": "worst-case σ",
    "gap_percent": "below eq. (6) %",
    "isotropy_defect": "isotropy defect",
    "distinct_optima": "optima",
    "iterations_median": "iterations",
    "milliseconds_per_success": "CPU ms per success",
    "relative_cost": "relative cost",
}
_FORMATS = {
    "objective": "{:.7g}",
    "worst_case_sigma": "{:.7f}",
    "certified_bound": "{:.7g}",
    "certified_gap_percent": "{:z.2f}",
    "numerical_bound": "{:.7g}",
    "numerical_gap_percent": "{:z.2f}",
    "gap_percent": "{:z.2f}",
    "isotropy_defect": "{:.3g}",
    "iterations_median": "{:g}",
    "milliseconds_per_success": "{:.3g}",
    "relative_cost": "{:.3g}",
}


def table(rows: Sequence[Row]) -> pd.DataFrame:
    """All columns, one line per row.

    `relative_cost` is the processor time per success over that of the same formulation and
    model without a variant.
    """
    frame = pd.DataFrame(
        [one.to_dict() for one in rows], columns=list(Row.__dataclass_fields__)
    )
    plain = {(one.formulation, one.model): one for one in rows if not one.variant}
    frame["relative_cost"] = [
        one.seconds_per_success / plain[one.formulation, one.model].seconds_per_success
        if (one.formulation, one.model) in plain
        else float("nan")
        for one in rows
    ]
    return frame


def brief(rows: Sequence[Row]) -> pd.DataFrame:
    """Return the columns that fit on a screen, as text."""
    shown = summary(rows).rename(columns={"CPU ms per success": "CPU ms"})
    shown["reached"] = [f"{one.reached_best}/{one.starts}" for one in rows]
    shown["bound"] = [
        one.certificate if math.isnan(one.certified_bound) else text
        for one, text in zip(rows, shown["certified bound"], strict=True)
    ]
    names = ("formulation", "variant", "model", "reached", "objective", "bound", "gap %")
    return shown[[*names, "CPU ms"]]


def summary(rows: Sequence[Row]) -> pd.DataFrame:
    """Return the columns to read, as text."""
    frame = table(rows)
    frame["milliseconds_per_success"] = 1e3 * frame["seconds_per_success"]
    for column, style in _FORMATS.items():
        frame[column] = [
            "–" if pd.isna(value) else style.format(value) for value in frame[column]
        ]
    return frame[list(_SHOWN)].rename(columns=_SHOWN)


def markdown(rows: Sequence[Row], seed: int, complete: bool = True) -> str:
    """Return the comparison as a Markdown page: where it came from, the table, the statuses."""
    statuses = "\n".join(
        f"- {' '.join(filter(None, (one.formulation, one.variant)))}, {one.model}: "
        f"{one.status_counts}"
        for one in rows
    )
    note = "" if complete else "\nInterrupted: not all starts or rows are here.\n"
    return (
        f"# Comparison of the formulations{_size(rows)}\n\n{header({'seed': seed})}{note}\n"
        f"{finding(rows)}\n\n"
        f"{summary(rows).to_markdown(index=False, disable_numparse=True)}\n\n"
        f"Ipopt's return statuses:\n\n{statuses}\n"
    )


def jacobians(summaries: Sequence[Summary]) -> list[dict[str, object]]:
    """Each row's Jacobian at full precision, with what it is."""
    return [
        {
            "formulation": one.row.formulation,
            "variant": one.row.variant,
            "model": one.row.model,
            "verdict": one.row.verdict,
            "seed": one.record.seed,
            "start": one.record.index,
            "worst_case_sigma": one.record.worst_case_sigma,
            "isotropy_defect": one.record.isotropy_defect,
            "jacobian": one.record.jacobian.tolist(),
        }
        for one in summaries
    ]


def write(summaries: Sequence[Summary], folder: Path, seed: int, complete: bool) -> None:
    """Write ``comparison.csv``, ``comparison.md`` and ``jacobians.json`` into the folder.

    Raises
    ------
    FileError
        If a file cannot be written.
    """
    rows = [one.row for one in summaries]
    write_text(folder / "comparison.csv", table(rows).to_csv(index=False))
    write_text(folder / "comparison.md", markdown(rows, seed, complete))
    write_text(folder / "jacobians.json", json.dumps(jacobians(summaries), indent=1) + "\n")


def _size(rows: Sequence[Row]) -> str:
    sizes = dict.fromkeys((one.joints, one.task_dimension) for one in rows)
    return "".join(f", {n} joints in {m} dimensions" for n, m in sizes)
