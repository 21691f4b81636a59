"""The benchmark beside other solvers as a study: processor time, the targets, the growth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isnan
from pathlib import Path

from tabulate import tabulate

from formulations.studies import pages
from formulations.studies.benchmark import peers
from formulations.studies.benchmark.measurement import NEAR, REACH, Row, measure
from formulations.studies.pages import groups
from formulations.studies.study import Effort, Part, Study

STARTS, TIME_LIMIT = 100, 20.0
SIZES = (7, 8, 10, 14, 20)
# Above this size, a fifth of the starts.
_SMALL = 8
_TEMPLATE = "benchmark.md.j2"

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
    """A ratio of processor times per success on 7R, and the limit that it should keep.

    Attributes
    ----------
    text
        The target in words.
    formulation, above, below
        What is solved, and the two peers whose ratio it is.
    limit
        The ratio should be at least this.
    at_most
        Whether it should be at most that instead.
    """

    text: str
    formulation: str
    above: str
    below: str
    limit: float
    at_most: bool = False

    def verdict(self, ratio: float) -> str:
        """Say whether the target is met; NaN is a ratio that was not measured."""
        if isnan(ratio):
            return "not measured"
        return (
            "met"
            if (ratio <= self.limit if self.at_most else ratio >= self.limit)
            else "missed"
        )


TARGETS = (
    Target("default at least 2 times trf", "residual", _TRF, _DEFAULT, 2),
    Target("compiled at least 3 times trf", "residual", _TRF, _COMPILED, 3),
    Target("fast path at least 15 times trf", "residual", _TRF, _FAST, 15),
    Target("fast path within 8 times the floor", "residual", _FAST, _FLOOR, 8, at_most=True),
    Target("default at least 10 times classical", "max-min", _CLASSICAL, _SHARED, 10),
    Target(
        "from residual minima at least 10 times classical",
        "max-min",
        _CLASSICAL,
        _FROM_MINIMA,
        10,
    ),
)


def study(sizes: Sequence[int] = SIZES, time_limit: float = TIME_LIMIT) -> Study:
    """Return the benchmark.

    Parameters
    ----------
    sizes
        Numbers of joints.
    time_limit
        Seconds of processor time for each peer on one statement and size.
    """

    def compute(effort: Effort, _: Path) -> Iterator[Part]:
        starts = effort.starts_or(STARTS)
        for size in sizes:
            few = starts if size <= _SMALL else max(1, starts // 5)
            for (_,), same in groups(peers.PEERS, "formulation"):
                rows: Sequence[Row] = ()
                for found in measure(same, size, few, effort.seed, time_limit, effort.progress):
                    yield Part(rows=found, replaces=len(rows))
                    rows = found

    return Study(
        name="benchmark",
        title="processor time per start and per success, beside other solvers, 7R to 20R",
        page="benchmark.md",
        template=_TEMPLATE,
        tables={"benchmark": Row},
        command="lockedjoint benchmark --out results/benchmark",
        takes="a quarter of an hour, on a machine that does nothing else",
        compute=compute,
        long=True,
        settings={
            "time_limit": time_limit,
            "reach": REACH,
            "near": NEAR,
            "growth": growth,
            "ratios": ratios,
        },
    )


def ratios(rows: Sequence[Row]) -> list[tuple[Target, float]]:
    """Return the targets, and the ratio of each on 7R, NaN where it was not measured."""
    times = {
        (row.formulation, row.peer): row.cpu_seconds_per_success
        for row in rows
        if row.joints == 7
    }
    nan = float("nan")
    return [
        (
            one,
            times.get((one.formulation, one.above), nan)
            / times.get((one.formulation, one.below), nan),
        )
        for one in TARGETS
    ]


def targets(rows: Sequence[Row]) -> str:
    """Return which targets on 7R are met, as a Markdown list."""
    return pages.block(_TEMPLATE, "targets", {"rows": rows, "ratios": ratios})


def growth(rows: Sequence[Row]) -> str:
    """Return CPU ms per success by number of joints, as a Markdown table."""
    sizes = sorted({row.joints for row in rows})
    lines = []
    for names, same in groups(rows, "formulation", "peer"):
        found = {row.joints: row for row in same}
        lines.append([*names, *(_cell(found[n]) if n in found else "–" for n in sizes)])
    heads = ["formulation", "peer", *(f"{n}R" for n in sizes)]
    return str(tabulate(lines, heads, tablefmt="pipe", disable_numparse=True))


def _cell(row: Row) -> str:
    if row.starts and not row.success:
        shown = f"> {1e3 * row.cpu_seconds_per_start * row.starts:.3g}"
    elif isnan(row.cpu_seconds_per_success):
        shown = "–"
    else:
        shown = f"{1e3 * row.cpu_seconds_per_success:.3g}"
    return f"{shown} *" if 0 < row.starts < row.asked else shown
