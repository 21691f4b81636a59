"""The benchmark as files: one table per statement and size, the targets, the growth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import pandas as pd

from formulations.files.provenance import header
from formulations.solving.outcome import REACHED_BEST
from formulations.studies.benchmark.finding import finding
from formulations.studies.benchmark.measurement import NEAR, Row
from nlp.files import write_text

_SHOWN = {
    "peer": "peer",
    "starts": "starts",
    "asked": "of",
    "success": "success",
    "near": "near",
    "cpu_seconds_per_start": "CPU ms per start",
    "cpu_seconds_per_success": "CPU ms per success",
    "relative": "relative to default",
    "setup_seconds": "set-up s",
    "settings": "settings",
    "note": "note",
}
_GROWTH = (
    "CPU ms per success; with >, what was spent without one. A star: stopped at the time limit "
    "before all starts."
)
_DEFAULT = "lockedjoint, Ipopt (default)"
_COMPILED = "lockedjoint, Ipopt, compiled"
_FAST = "lockedjoint, Fatrop, compiled (fast path)"
_FLOOR = "floor: hand-written C, Levenberg–Marquardt, exact Hessian"
_TRF = "scipy least_squares trf"
_SHARED = "lockedjoint, shared factor (default)"
_FROM_MINIMA = "lockedjoint, from residual minima by Ipopt"
_CLASSICAL = "classical: one free factor per failure"


@dataclass(frozen=True)
class Target:
    """A ratio of CPU ms per success on 7R, and what it should be."""

    text: str
    formulation: str
    above: str
    below: str
    met: Callable[[float], bool]


def _ten_times(ratio: float) -> bool:
    return ratio >= 10


TARGETS = (
    Target("default at least 2 times trf", "residual", _TRF, _DEFAULT, lambda r: r >= 2),
    Target("compiled at least 3 times trf", "residual", _TRF, _COMPILED, lambda r: r >= 3),
    Target("fast path at least 15 times trf", "residual", _TRF, _FAST, lambda r: r >= 15),
    Target("fast path within 8 times the floor", "residual", _FAST, _FLOOR, lambda r: r <= 8),
    Target("default at least 10 times classical", "max-min", _CLASSICAL, _SHARED, _ten_times),
    Target(
        "from residual minima at least 10 times classical",
        "max-min",
        _CLASSICAL,
        _FROM_MINIMA,
        _ten_times,
    ),
)


def write(
    rows: Sequence[Row], folder: Path, seed: int, packages: Sequence[str], time_limit: float
) -> None:
    """Write ``benchmark.csv`` and ``benchmark.md``; FileError if a file cannot be written."""
    table = pd.DataFrame([asdict(row) for row in rows], columns=list(Row.__dataclass_fields__))
    write_text(folder / "benchmark.csv", table.to_csv(index=False))
    write_text(folder / "benchmark.md", markdown(rows, seed, packages, time_limit))


def markdown(rows: Sequence[Row], seed: int, packages: Sequence[str], time_limit: float) -> str:
    """Return the benchmark as a Markdown page."""
    parts = [
        "# Benchmark\n",
        header({"seed": seed, "peers": ", ".join(packages)}),
        "Unit revolute joints, the same random starts for all, in turns within one run, one "
        "thread each. A *success* is an answer whose Jacobian, measured by itself, is one of "
        f"the arm's and within {REACHED_BEST:g} of the best of all peers; *near* is within "
        f"{NEAR:g}. "
        "Processor time is without set-up, which stands beside it. Who has used up "
        f"{time_limit:g} s of it on one statement and size begins no other start there, which "
        "the note says.\n",
        f"{finding(rows)}\n",
        targets(rows),
    ]
    for formulation, joints in dict.fromkeys((row.formulation, row.joints) for row in rows):
        here = [r for r in rows if (r.formulation, r.joints) == (formulation, joints)]
        parts.append(f"## {formulation}, {joints}R\n\n{_table(here)}\n")
    parts.append(f"## Growth\n\n{_GROWTH}\n\n{growth(rows)}\n")
    return "\n".join(parts)


def targets(rows: Sequence[Row]) -> str:
    """Say which targets on 7R are met, as a Markdown list."""
    lines = []
    times = {
        (row.formulation, row.peer): 1e3 * row.cpu_seconds_per_success
        for row in rows
        if row.joints == 7
    }
    for target in TARGETS:
        above = times.get((target.formulation, target.above), float("nan"))
        below = times.get((target.formulation, target.below), float("nan"))
        ratio = above / below
        verdict = "not measured" if pd.isna(ratio) else "met" if target.met(ratio) else "missed"
        lines.append(f"- {target.formulation}, {target.text}: {ratio:.2f}, {verdict}")
    return "Targets on 7R, by CPU ms per success:\n\n" + "\n".join(lines) + "\n"


def growth(rows: Sequence[Row]) -> str:
    """Return CPU ms per success by number of joints, as a Markdown table."""
    sizes = sorted({row.joints for row in rows})
    lines = []
    for name in dict.fromkeys((row.formulation, row.peer) for row in rows):
        found = {r.joints: r for r in rows if (r.formulation, r.peer) == name}
        cells = [_growth_cell(found[n]) if n in found else "–" for n in sizes]
        lines.append([*name, *cells])
    heads = ["formulation", "peer", *(f"{n}R" for n in sizes)]
    return str(
        pd.DataFrame(lines, columns=heads).to_markdown(index=False, disable_numparse=True)
    )


def _growth_cell(row: Row) -> str:
    if row.starts and not row.success:
        shown = f"> {_number(1e3 * row.cpu_seconds_per_start * row.starts)}"
    else:
        shown = _number(1e3 * row.cpu_seconds_per_success)
    return f"{shown} *" if 0 < row.starts < row.asked else shown


def _table(rows: Sequence[Row]) -> str:
    table = pd.DataFrame([asdict(row) for row in rows])[list(_SHOWN)]
    for column in ("cpu_seconds_per_start", "cpu_seconds_per_success"):
        table[column] *= 1e3  # shown in milliseconds
    for column in table.columns:
        table[column] = [_number(value) for value in table[column]]
    return str(table.rename(columns=_SHOWN).to_markdown(index=False, disable_numparse=True))


def _number(value: object) -> str:
    if isinstance(value, float):
        return "–" if pd.isna(value) else f"{value:.3g}"
    return str(value)
