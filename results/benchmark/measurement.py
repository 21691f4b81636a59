"""What a peer of the benchmark offers; peers measured in turn, answers checked from J alone."""

import os
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import TypeAlias
from unittest import mock

import numpy as np
from threadpoolctl import threadpool_limits

from formulations.io.table import HIDDEN, column
from formulations.joints.arm import Arm
from formulations.joints.models import arm
from formulations.registry import formulation_of
from formulations.solving.outcome import REACHED_BEST
from nlp.arrays import FloatArray
from nlp.starts import generator

# Answers within `REACHED_BEST` of the best of all peers are successes; within this, near.
NEAR = 1e-3
NAN = float("nan")
# Peers take turns, so that any other load on the machine affects all of them alike. Each round
# is a repetition with starts of its own; ratios are given with their spread over the rounds.
ROUNDS = 3
# From a start to its Jacobian, or from starts, shape (K, size of the arm), to Jacobians,
# shape (K, m, n).
Solve: TypeAlias = Callable[[FloatArray], FloatArray]


class NotRunError(Exception):
    """A peer that cannot be run here; its message says why in a few words."""


@dataclass(frozen=True)
class Peer:
    """A way to solve one statement on unit revolute joints.

    Attributes
    ----------
    name
        As the table shows it.
    formulation
        What it solves: ``residual`` or ``max-min``.
    prepare
        Sets up for an arm and returns what solves one start, shape (size of the arm,), for
        the Jacobian; its time is reported separately. Raises NotRunError, or ImportError
        where a package is missing.
    settings
        How it is set up, in words.
    batched
        Whether it is prepared for an arm and a number of starts, and then solves batches of
        that size only.
    """

    name: str
    formulation: str
    prepare: Callable[..., Solve]
    settings: str = ""
    batched: bool = False


@dataclass(frozen=True)
class BenchmarkRow:
    """One peer on one statement and size; NaN where it was not run.

    Attributes
    ----------
    formulation, joints, peer, settings
        What was run.
    asked, starts
        Starts that it was given, and those that it ran within the time limit.
    success, near
        Starts within `REACHED_BEST` and `NEAR` of the best score of all peers.
    cpu_seconds_per_start, cpu_seconds_per_success
        Processor time, without setting up.
    relative
        Time per success as a multiple of that of the first peer with the same statement and
        size, which is this library's default.
    first, second, third
        Processor time per success in each round; NaN without one.
    setup_seconds
        Wall time of setting up: derivatives, compilation.
    note
        Why it was not run, or stopped early, if so.
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
    """A peer under measurement: by round, its processor time and the scores of its answers."""

    peer: Peer
    solve: Solve | None = None
    note: str = ""
    setup: float = NAN
    times: list[float] = field(default_factory=list)
    rounds: list[list[float]] = field(default_factory=list)

    @property
    def seconds(self) -> float:
        """Processor time of all rounds."""
        return sum(self.times)

    @property
    def scores(self) -> list[float]:
        """Scores of all rounds."""
        return list(chain.from_iterable(self.rounds))


def measure(
    peers: Sequence[Peer],
    joints: int,
    starts: int,
    seed: int,
    time_limit: float = np.inf,
    progress: Callable[[str], None] = lambda _: None,
) -> list[BenchmarkRow]:
    """Return a row for each peer.

    Parameters
    ----------
    peers
        All of one formulation.
    joints
        Number of unit revolute joints.
    starts, seed
        Starts for each, the same for all.
    time_limit
        Seconds of processor time for each peer: one that has used them up begins no other
        start.
    progress
        Called with a sentence that says what is being done.
    """
    built = arm("unit-revolute", joints)
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
    statement = formulation_of(peers[0].formulation)
    known = [score for trial in trials for score in trial.scores if np.isfinite(score)]
    best = (min if statement.SENSE == "minimise" else max)(known, default=NAN)
    default = _per(trials[0].seconds, _within(trials[0].scores, best, REACHED_BEST))
    return [_row(trial, joints, starts, best, default) for trial in trials]


def _set_up(peer: Peer, built: Arm, points: FloatArray) -> _Trial:
    """Prepare a peer and let it solve once, which may compile more."""
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
    """Let a peer solve from points, all at once if it is batched, until its time is up."""
    trial.times.append(0.0)
    trial.rounds.append([])
    if trial.solve is None:
        return
    score = formulation_of(trial.peer.formulation).score
    # A batched peer is compiled for one size of batch.
    batched = trial.peer.batched
    tasks = [np.resize(points, (batch, built.size))] if batched else list(points)
    for task in tasks:
        if trial.seconds >= time_limit:
            trial.note = f"stopped after {time_limit:g} s"
            break
        began = time.process_time()
        answer = trial.solve(task)
        trial.times[-1] += time.process_time() - began
        trial.rounds[-1] += [
            score(matrix) if built.admits(matrix) else NAN
            for matrix in (answer[: len(points)] if batched else [answer])
        ]


def _row(trial: _Trial, joints: int, asked: int, best: float, default: float) -> BenchmarkRow:
    success = _within(trial.scores, best, REACHED_BEST)
    rounds = [
        _per(seconds, _within(scores, best, REACHED_BEST))
        for seconds, scores in zip(trial.times, trial.rounds, strict=True)
    ]
    first, second, third = [*rounds, *[NAN] * ROUNDS][:ROUNDS]
    return BenchmarkRow(
        formulation=trial.peer.formulation,
        joints=joints,
        peer=trial.peer.name,
        settings=trial.peer.settings,
        asked=asked,
        starts=len(trial.scores),
        success=success,
        near=_within(trial.scores, best, NEAR),
        cpu_seconds_per_start=_per(trial.seconds, len(trial.scores)),
        cpu_seconds_per_success=_per(trial.seconds, success),
        relative=_per(trial.seconds, success) / default,
        first=first,
        second=second,
        third=third,
        setup_seconds=trial.setup,
        note=trial.note,
    )


def _within(scores: Sequence[float], best: float, tolerance: float) -> int:
    return int(np.sum(np.abs(np.array(scores) - best) <= tolerance))


def _per(seconds: float, count: int) -> float:
    return seconds / count if count else NAN
