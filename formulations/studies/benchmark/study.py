"""The benchmark beside other solvers as a study: processor time, the targets, the growth."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isnan
from pathlib import Path

from formulations.solving.outcome import REACHED_BEST
from formulations.studies import pages
from formulations.studies.benchmark import peers
from formulations.studies.benchmark.measurement import NEAR, Row, measure
from formulations.studies.pages import groups
from formulations.studies.study import Effort, Part, Study

STARTS, TIME_LIMIT = 100, 20.0
SIZES = (7, 8, 10, 14, 20)
# Above this size, a fifth of the starts.
_SMALL = 8
_TEMPLATE = "benchmark.md.j2"
NAN = float("nan")

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
    """A ratio of the times per success of two peers on 7R, and the limit that it should keep.

    Attributes
    ----------
    text, formulation, above, below
        The target in words, and the statement and the peers of the ratio.
    limit, at_most
        The ratio should be at least the limit or, if `at_most`, at most the limit.
    """

    text: str
    formulation: str
    above: str
    below: str
    limit: float
    at_most: bool = False

    def ratio(self, rows: Sequence[Row]) -> float:
        """Return the ratio; NaN where it was not measured."""
        times = {
            row.peer: row.cpu_seconds_per_success
            for row in rows
            if (row.formulation, row.joints) == (self.formulation, 7)
        }
        return times.get(self.above, NAN) / times.get(self.below, NAN)

    def verdict(self, ratio: float) -> str:
        """Return whether a ratio meets the target, in words."""
        if isnan(ratio):
            return "not measured"
        met = ratio <= self.limit if self.at_most else ratio >= self.limit
        return "met" if met else "missed"


_MINIMA = "from residual minima at least 10 times classical"
TARGETS = (
    Target("default at least 2 times trf", "residual", _TRF, _DEFAULT, 2),
    Target("compiled at least 3 times trf", "residual", _TRF, _COMPILED, 3),
    Target("fast path at least 15 times trf", "residual", _TRF, _FAST, 15),
    Target("fast path within 8 times the floor", "residual", _FAST, _FLOOR, 8, at_most=True),
    Target("default at least 10 times classical", "max-min", _CLASSICAL, _SHARED, 10),
    Target(_MINIMA, "max-min", _CLASSICAL, _FROM_MINIMA, 10),
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
        starts = effort.starts or STARTS
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
            "reach": REACHED_BEST,
            "near": NEAR,
            "goals": TARGETS,
        },
    )


def targets(rows: Sequence[Row]) -> str:
    """Return which targets on 7R are met, as a Markdown list."""
    return pages.block(_TEMPLATE, "targets", {"rows": rows, "goals": TARGETS})


def growth(rows: Sequence[Row]) -> str:
    """Return CPU ms per success by number of joints, as a Markdown table."""
    return pages.aligned(pages.block(_TEMPLATE, "growth", {"rows": rows}))
