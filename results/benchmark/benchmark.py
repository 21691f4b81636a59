"""The benchmark beside other solvers: processor time, the targets, the growth.

A peer is a solver, and how one of two statements is given to it: ``residual``, the
least-squares residual of the isotropy equations, or ``max-min``, the largest worst case.
`peers` lists them. Arms have unit revolute joints, whose Jacobians have the shape (6, n). What
goes out: ``benchmark.csv``, a `BenchmarkRow` for each peer and n, and ``cost.svg``, processor
time per success over n. The page compares the ratios of some rows with `_TARGETS`.

Peers are measured in turn, so that any other load on the machine affects all of them alike, and
their answers are checked from J alone.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain
from math import isnan
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING
from unittest import mock

import numpy as np
from threadpoolctl import threadpool_limits

from lockedjoint.figures.style import BLUE, GREY, INK, ORANGE, SMALL, VERMILION, styled
from lockedjoint.formulations.io.table import HIDDEN, column, row_from
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.models import arm
from lockedjoint.formulations.registry import formulation_of
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.formulations.solving.outcome import REACHED_BEST
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.starts import generator
from results.benchmark.other_libraries import NotRunError, Solve
from results.benchmark.peers import CLASSICAL, DEFAULT, FAST, PEERS, Peer
from results.pages import groups, known
from results.script import parser, run, save, study_of
from results.study import Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# The number of random starts of each peer, on each n. More of them make the times per success
# more certain.
STARTS = 99
# A peer that has used up this processor time on one n, in seconds, begins no other start.
TIME_LIMIT = 20.0
# The numbers of joints n.
SIZES = (7, 8, 9, 12, 16, 20, 24)
# An answer is near if its score differs by this at most from the best of all peers, and a
# success if it differs by `REACHED_BEST` at most.
NEAR = 1e-3
NAN = float("nan")
# The starts are divided among so many rounds, in each of which all peers take their turn.
# Ratios are given with their spread over the rounds. The number stays 3: `BenchmarkRow` has a
# column for each round.
ROUNDS = 3
# How the names of the peers in `_TARGETS` begin. Of two floors the faster one counts.
_FLOOR = "floor"
_TRF = "scipy least_squares trf"
_JAX = "JAX"
_SLSQP = "scipy SLSQP"
# The colour of a line, by how the peer's name begins: this library's default and fast path,
# others of it, and the floor, which is C written by hand. The first that fits counts; all else
# is grey.
_COLOURS = {DEFAULT: BLUE, FAST: VERMILION, "lockedjoint": ORANGE, _FLOOR: INK}
# The marks of the lines, of matplotlib, one after the other.
_MARKS = "os^Dv<>Pp*hX"


@dataclass(frozen=True)
class BenchmarkRow:
    """One peer on one statement and size; NaN where it was not run.

    Of the starts `asked`, it ran `starts` within the time limit; `success` and `near` of them
    are within `REACHED_BEST` and `NEAR` of the best score of all peers. Processor time, in
    each of three rounds per success, too, is without setting up, whose wall time is
    `setup_seconds`. `relative` is time per success over that of the first peer, this
    library's default. `note` says why it was not run, or stopped early.
    """

    formulation: str = field(metadata=HIDDEN)
    joints: int = field(metadata=HIDDEN)
    peer: str
    settings: str
    asked: int = field(metadata=column("of"))
    starts: int
    success: int
    near: int
    cpu_seconds_per_start: float = field(metadata=column("CPU ms per start", scale=1e3))
    cpu_seconds_per_success: float = field(metadata=column("CPU ms per success", scale=1e3))
    relative: float = field(metadata=column("relative to default"))
    first: float = field(metadata=HIDDEN)
    second: float = field(metadata=HIDDEN)
    third: float = field(metadata=HIDDEN)
    setup_seconds: float = field(metadata=column("set-up s"))
    note: str

    @property
    def rounds(self) -> tuple[float, ...]:
        """Processor time per success in each round."""
        return (self.first, self.second, self.third)


@dataclass(eq=False)
class _Trial:
    """A peer under measurement, which grows from round to round.

    `setup` is the wall time in seconds of setting up. By round, `times` has the processor time
    of all starts in seconds, and `rounds` the scores of the answers: NaN of one that is no
    Jacobian of the arm.
    """

    peer: Peer
    solve: Solve | None = None
    note: str = ""
    setup: float = NAN
    times: list[float] = field(default_factory=list)
    rounds: list[list[float]] = field(default_factory=list)


def measure(
    peers: Sequence[Peer],
    joints: int,
    starts: int,
    seed: int,
    time_limit: float = np.inf,
    progress: Callable[[str], None] = lambda _: None,
) -> list[BenchmarkRow]:
    """Return a row for each of the peers of one formulation, from the same starts.

    A peer that has used up `time_limit`, in seconds of processor time, begins no other start.
    """
    # A batch has the starts of one round, rounded up.
    built, statement = arm("unit-revolute", joints), formulation_of(peers[0].formulation)
    points = np.array([built.sample(generator(seed, index)) for index in range(starts)])
    batch = -(-starts // ROUNDS)
    trials = []
    # Without a cache everything is compiled anew: set-up times include compilation.
    with (
        tempfile.TemporaryDirectory() as cache,
        mock.patch.dict(os.environ, XDG_CACHE_HOME=cache),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")  # only the peers' answers count
        for peer in peers:
            progress(f"{peer.formulation} {joints}R, setting up: {peer.name}")
            trials.append(_set_up(peer, built, np.resize(points, (batch, built.size))))
        # Only now, so that libraries of linear algebra that peers import are limited, too.
        with threadpool_limits(1):
            for first in range(0, starts, batch):
                for trial in trials:
                    name = trial.peer.name
                    progress(f"{trial.peer.formulation} {joints}R, start {first}: {name}")
                    _run_round(trial, built, points[first : first + batch], batch, time_limit)
    scores = [score for trial in trials for score in chain(*trial.rounds) if not isnan(score)]
    best = (min if statement.SENSE == "minimise" else max)(scores, default=NAN)
    rows: list[BenchmarkRow] = []
    for trial in trials:
        rows.append(_row(trial, joints, starts, best, rows[0] if rows else None))
    return rows


def _set_up(peer: Peer, built: Arm, points: FloatArray) -> _Trial:
    """Prepare a peer and let it solve once, which may compile more.

    `points` are the starts of a round, shape (batch, size of the arm).
    """
    began = time.perf_counter()
    try:
        solve = peer.prepare(built, len(points)) if peer.batched else peer.prepare(built)
    except ImportError as reason:
        return _Trial(peer, note=f"not installed: {reason.name}")
    except NotRunError as reason:
        return _Trial(peer, note=str(reason))
    trial = _Trial(peer, solve, setup=time.perf_counter() - began)
    solve(points if peer.batched else points[0])
    return trial


def _run_round(
    trial: _Trial, built: Arm, points: FloatArray, batch: int, time_limit: float
) -> None:
    """Let a peer solve from points, all at once if it is batched, until its time is up.

    `points` has the shape (up to `batch`, size of the arm). Times and scores go into `trial`.
    """
    trial.times.append(0.0)
    trial.rounds.append([])
    if trial.solve is None:
        return
    score = formulation_of(trial.peer.formulation).score
    # A batched peer is compiled for one size of batch.
    batched = trial.peer.batched
    tasks = [np.resize(points, (batch, built.size))] if batched else list(points)
    for task in tasks:
        if sum(trial.times) >= time_limit:
            trial.note = f"stopped after {time_limit:g} s"
            break
        began = time.process_time()
        answer = trial.solve(task)
        trial.times[-1] += time.process_time() - began
        trial.rounds[-1] += [
            score(matrix) if built.admits(matrix) else NAN
            for matrix in (answer[: len(points)] if batched else [answer])
        ]


def _row(
    trial: _Trial, joints: int, asked: int, best: float, default: BenchmarkRow | None
) -> BenchmarkRow:
    """Return the row of a peer, beside that of the default; None if it is the default's own.

    `best` is the best score of all peers, and `asked` the number of starts.
    """

    def within(scores: Sequence[float], tolerance: float) -> int:
        return int(np.sum(np.abs(np.array(scores) - best) <= tolerance))

    def per(seconds: float, count: int) -> float:
        return seconds / count if count else NAN

    seconds, scores = sum(trial.times), list(chain(*trial.rounds))
    success = within(scores, REACHED_BEST)
    per_success = per(seconds, success)
    each = zip(trial.times, trial.rounds, strict=True)
    rounds = [per(spent, within(some, REACHED_BEST)) for spent, some in each]
    first, second, third = [*rounds, *[NAN] * ROUNDS][:ROUNDS]
    return row_from(
        BenchmarkRow,
        trial.peer,
        trial,
        joints=joints,
        peer=trial.peer.name,
        asked=asked,
        starts=len(scores),
        success=success,
        near=within(scores, NEAR),
        cpu_seconds_per_start=per(seconds, len(scores)),
        cpu_seconds_per_success=per_success,
        relative=per_success / (default.cpu_seconds_per_success if default else per_success),
        first=first,
        second=second,
        third=third,
        setup_seconds=trial.setup,
    )


@dataclass(frozen=True)
class Target:
    """A ratio of the times per success of two peers, and the limit that it should keep.

    The ratio is the time of `above` divided by that of `below`: so many times faster is
    `below`. Both are given by how the peers' names begin; of several peers the fastest counts.
    The ratio should be at least the limit or, if `at_most`, at most the limit: for arms of
    `only` so many joints, or of all if that is 0.
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
        same = [r for r in rows if (r.formulation, r.joints) == (self.formulation, joints)]
        above, below = _fastest(same, self.above), _fastest(same, self.below)
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


def _fastest(rows: Sequence[BenchmarkRow], name: str) -> tuple[float, ...]:
    """Return the seconds per success, by round, of the fastest peer with such a name."""
    chosen = [r for r in _known(rows) if r.peer.startswith(name)]
    return min(chosen, key=lambda row: row.cpu_seconds_per_success).rounds if chosen else ()


def _known(rows: Sequence[BenchmarkRow]) -> list[BenchmarkRow]:
    """Return the rows of peers that had a success."""
    return known(rows, "cpu_seconds_per_success")


# What the page judges. A first number is the limit; the text says it in words.
_TARGETS = (
    Target("default ≥ 2 × trf", "residual", _TRF, DEFAULT, 2),
    Target("fast path ≥ 15 × trf", "residual", _TRF, FAST, 15, only=7),
    Target("fast path ≥ 1 × JAX", "residual", _JAX, FAST, 1),
    Target("fast path ≤ 5 × floor", "residual", FAST, _FLOOR, 5, at_most=True),
    Target("default ≥ 3 × SLSQP", "max-min", _SLSQP, DEFAULT, 3),
    Target("default ≥ 10 × classical", "max-min", CLASSICAL, DEFAULT, 10),
    Target("fast path ≥ 12 × SLSQP", "max-min", _SLSQP, FAST, 12),
    Target("fast path ≤ 5 × floor", "max-min", FAST, _FLOOR, 5, at_most=True),
)


def drawn(rows: Sequence[BenchmarkRow]) -> Figure:
    """Return the figure: CPU ms per success, on a logarithmic scale."""
    panels = groups(rows, "formulation")
    beside = {"loc": "center left", "bbox_to_anchor": (1.01, 0.5)}
    with styled(9.0, 3.2 + 3.2 * len(panels)) as figure:
        every = figure.subplots(len(panels), squeeze=False).ravel()
        for axes, ((formulation,), same) in zip(every, panels, strict=True):
            for mark, ((peer,), line) in enumerate(groups(same, "peer")):
                colour = next((_COLOURS[k] for k in _COLOURS if peer.startswith(k)), GREY)
                axes.semilogy(
                    [row.joints for row in _known(line)],
                    [1e3 * row.cpu_seconds_per_success for row in _known(line)],
                    marker=_MARKS[mark % len(_MARKS)],
                    markersize=4,
                    linewidth=1.8 if colour in (BLUE, VERMILION) else 0.9,
                    linestyle="--" if colour == INK else "-",
                    color=colour,
                    label=peer,
                )
            axes.set_xticks(sorted({row.joints for row in same}))
            axes.set(title=formulation, xlabel="joints", ylabel="CPU ms per success")
            axes.legend(fontsize=SMALL, frameon=False, **beside)
    return figure


def study(sizes: Sequence[int] = SIZES, time_limit: float = TIME_LIMIT) -> Study:
    """Return the benchmark of arms of so many joints, in seconds for each peer on each."""

    def compute(effort: Effort, folder: Path) -> Iterator[BenchmarkRow]:
        starts, rows = effort.starts or STARTS, list[BenchmarkRow]()
        for size in sizes:
            for _, peers in groups(PEERS, "formulation"):
                measured = measure(
                    peers, size, starts, effort.seed, time_limit, effort.progress
                )
                yield from measured
                rows += measured
        save(drawn(rows), folder / "cost.svg")

    return study_of(
        __file__,
        compute,
        BenchmarkRow,
        title="processor time per start and per success, beside other solvers, from 7R on",
        takes="five minutes, on a machine that does nothing else",
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
    made.add_argument("--joints", type=int, nargs="+", default=SIZES, help="from 7 to 24")
    made.add_argument("--time-limit", type=float, default=TIME_LIMIT, help="seconds a peer")
    options = made.parse_args()
    sys.exit(run(study(options.joints, options.time_limit), options, options.out))
