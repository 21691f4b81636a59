"""The benchmark beside other solvers: processor time, the targets, the growth."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isnan
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from formulations.io.files import write_bytes
from formulations.io.pages import groups
from formulations.io.study import Effort, Study
from formulations.plot.style import BLUE, GREY, INK, ORANGE, SMALL, VERMILION, content, styled
from formulations.solving.outcome import REACHED_BEST
from results.benchmark.measurement import NEAR, BenchmarkRow, measure
from results.benchmark.peers import CLASSICAL, DEFAULT, FAST, PEERS
from results.script import parser, run, study_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STARTS, TIME_LIMIT = 99, 20.0
SIZES = (7, 8, 9, 12, 16, 20)
_FLOOR = "floor"  # whichever is less
_TRF, _JAX, _SLSQP = "scipy least_squares trf", "JAX", "scipy SLSQP"
# By how a peer's name begins: this library's default and fast path, others of it, the floor.
# All else is grey.
_COLOURS = {
    "lockedjoint, Ipopt (default)": BLUE,
    "lockedjoint, Fatrop, compiled (fast path)": VERMILION,
    "lockedjoint": ORANGE,
    "floor": INK,
}
_MARKS = "os^Dv<>Pp*hX"


@dataclass(frozen=True)
class Target:
    """A ratio of the times per success of two peers, and the limit that it should keep.

    Attributes
    ----------
    text, formulation, above, below
        The target in words, the statement, and how the names of the two peers begin. Of several
        peers the fastest counts.
    limit, at_most
        The ratio should be at least the limit or, if `at_most`, at most the limit.
    only
        The one number of joints of which it is asked; 0 for all.
    """

    text: str
    formulation: str
    above: str
    below: str
    limit: float
    at_most: bool = False
    only: int = 0

    def ratios(self, rows: Sequence[BenchmarkRow], joints: int) -> list[float]:
        """Return the least ratio of all rounds, the median and the largest; none if unknown."""
        above, below = (
            _fastest(rows, self.formulation, joints, name) for name in (self.above, self.below)
        )
        rounds = [a / b for a, b in zip(above, below, strict=False) if not isnan(a / b)]
        return [min(rounds), median(rounds), max(rounds)] if rounds else []

    def verdict(self, ratios: Sequence[float], joints: int) -> str:
        """Return whether the median meets the target, in words."""
        if not ratios:
            return "not measured"
        if self.only not in (0, joints):
            return "not asked"
        met = ratios[1] <= self.limit if self.at_most else ratios[1] >= self.limit
        return "met" if met else "missed"


def _fastest(
    rows: Sequence[BenchmarkRow], statement: str, joints: int, name: str
) -> tuple[float, ...]:
    chosen = [
        row
        for row in rows
        if (row.formulation, row.joints) == (statement, joints)
        and row.peer.startswith(name)
        and not isnan(row.cpu_seconds_per_success)
    ]
    return min(chosen, key=lambda row: row.cpu_seconds_per_success).rounds if chosen else ()


_TARGETS = (
    Target("default ≥ 2 × trf", "residual", _TRF, DEFAULT, 2),
    Target("fast path ≥ 15 × trf", "residual", _TRF, FAST, 15, only=7),
    Target("fast path ≥ 1 × JAX", "residual", _JAX, FAST, 1),
    Target("fast path ≤ 5 × floor", "residual", FAST, _FLOOR, 5, at_most=True),
    Target("default ≥ 3 × SLSQP", "max-min", _SLSQP, DEFAULT, 3),
    Target("default ≥ 10 × classical", "max-min", CLASSICAL, DEFAULT, 10),
    Target("fast path ≥ 10 × SLSQP", "max-min", _SLSQP, FAST, 10),
    Target("fast path ≤ 5 × floor", "max-min", FAST, _FLOOR, 5, at_most=True),
)


def drawn(rows: Sequence[BenchmarkRow]) -> Figure:
    """Return the figure: CPU ms per success, on a logarithmic scale."""
    panels = groups(rows, "formulation")
    with styled(9.0, 3.2 + 3.2 * len(panels)) as figure:
        for place, ((formulation,), same) in enumerate(panels, 1):
            axes = figure.add_subplot(len(panels), 1, place)
            for mark, ((peer,), line) in enumerate(groups(same, "peer")):
                known = [row for row in line if not isnan(row.cpu_seconds_per_success)]
                colour = next(
                    (c for begins, c in _COLOURS.items() if peer.startswith(begins)), ""
                )
                axes.plot(
                    [row.joints for row in known],
                    [1e3 * row.cpu_seconds_per_success for row in known],
                    marker=_MARKS[mark % len(_MARKS)],
                    markersize=4,
                    linewidth=1.8 if colour in (BLUE, VERMILION) else 0.9,
                    linestyle="--" if colour == INK else "-",
                    color=colour or GREY,
                    label=peer,
                )
            axes.set_yscale("log")
            axes.set_xticks(sorted({row.joints for row in same}))
            axes.set_title(formulation)
            axes.set_xlabel("joints")
            axes.set_ylabel("CPU ms per success")
            axes.legend(
                loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=SMALL, frameon=False
            )
    return figure


def study(sizes: Sequence[int] = SIZES, time_limit: float = TIME_LIMIT) -> Study:
    """Return the benchmark.

    Parameters
    ----------
    sizes
        Numbers of joints.
    time_limit
        Seconds of processor time for each peer on one statement and size.
    """

    def compute(effort: Effort, folder: Path) -> Iterator[BenchmarkRow]:
        starts, rows = effort.starts or STARTS, list[BenchmarkRow]()
        for size in sizes:
            for _, peers in groups(PEERS, "formulation"):
                measured = measure(
                    peers, size, starts, effort.seed, time_limit, effort.progress
                )
                yield from measured
                rows += measured
        write_bytes(folder / "cost.svg", content(drawn(rows), "svg"))

    return study_of(
        __file__,
        title="processor time per start and per success, beside other solvers, 7R to 20R",
        page="benchmark.md",
        tables={"benchmark": BenchmarkRow},
        takes="a quarter of an hour, on a machine that does nothing else",
        compute=compute,
        long=True,
        settings={
            "time_limit": time_limit,
            "reach": REACHED_BEST,
            "near": NEAR,
            "goals": _TARGETS,
        },
    )


if __name__ == "__main__":
    made = parser("Measure processor time beside other solvers.", Path(__file__).parent)
    made.add_argument("--joints", type=int, nargs="+", default=SIZES, help="from 7 to 20")
    made.add_argument("--time-limit", type=float, default=TIME_LIMIT, help="seconds a peer")
    options = made.parse_args()
    sys.exit(run(study(options.joints, options.time_limit), options, options.out))
