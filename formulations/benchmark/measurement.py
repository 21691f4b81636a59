"""Peers measured side by side: the same starts in turn, answers checked from J alone."""

from __future__ import annotations

import os
import tempfile
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from formulations.arm import Arm
from formulations.benchmark.peer import NotRunError, Peer, Run
from formulations.catalogue import arm, formulation
from formulations.joints import NotInModelError
from nlp.arrays import FloatArray
from nlp.task import generator

# Answers within this of the best of all peers are successes; within the second, near.
REACH, NEAR = 1e-6, 1e-3
# Peers take turns, so that whatever else the machine does meets all alike.
_ROUNDS = 4


@dataclass(frozen=True)
class Row:
    """One peer on one statement and size; NaN where it was not run.

    Attributes
    ----------
    formulation, joints, peer, settings
        What was run.
    starts, success, near
        Starts, and those within `REACH` and `NEAR` of the best merit of all peers.
    milliseconds_per_start, milliseconds_per_success
        Processor time, without setting up.
    relative
        Time per success as a multiple of the first peer's that has the same statement and
        size, which is this library's default.
    setup_seconds
        Wall time of setting up: derivatives, compilation.
    note
        Why it was not run, if it was not.
    """

    formulation: str
    joints: int
    peer: str
    settings: str
    starts: int
    success: int
    near: int
    milliseconds_per_start: float
    milliseconds_per_success: float
    relative: float
    setup_seconds: float
    note: str

    def to_dict(self) -> dict[str, object]:
        """Return the columns as plain values."""
        return asdict(self)


@dataclass(eq=False)
class _Trial:
    peer: Peer
    run: Run | None = None
    note: str = ""
    setup: float = float("nan")
    seconds: float = 0.0
    merits: tuple[float, ...] = ()


def measure(peers: Sequence[Peer], joints: int, starts: int, seed: int) -> list[Row]:
    """Return a row for each peer, all of one formulation, on `joints` unit revolute joints."""
    built = arm("unit-revolute", joints)
    points = np.array([built.sample(generator(seed, index)) for index in range(starts)])
    batch = -(-starts // _ROUNDS)
    with _fresh_cache():
        trials = [_set_up(peer, built, batch, points[:1]) for peer in peers]
    # Only now: libraries of linear algebra that peers brought with them count, too.
    with threadpool_limits(1):
        for first in range(0, starts, batch):
            for trial in trials:
                _take_turn(trial, built, points[first : first + batch], batch)
    return _rows(trials, joints, starts)


def _set_up(peer: Peer, built: Arm, batch: int, point: FloatArray) -> _Trial:
    if built.shape[1] > peer.most_joints:
        return _Trial(peer, note=f"only up to {peer.most_joints} joints")
    began = time.perf_counter()
    try:
        run = peer.prepare(built, batch)
    except ImportError as reason:
        return _Trial(peer, note=f"not installed: {reason.name}")
    except NotRunError as reason:
        return _Trial(peer, note=str(reason))
    setup = time.perf_counter() - began
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run(np.repeat(point, batch, axis=0)[:batch] if peer.batched else point)
    return _Trial(peer, run, setup=setup)


def _take_turn(trial: _Trial, built: Arm, points: FloatArray, batch: int) -> None:
    if trial.run is None:
        return
    if trial.peer.batched:  # compiled for one size of batch
        points, wanted = np.resize(points, (batch, points.shape[1])), len(points)
    else:
        wanted = len(points)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # peers' own; what counts is what comes out
        began = time.process_time()
        jacobians = trial.run(points)
        trial.seconds += time.process_time() - began
    merits = (_merit(trial.peer, built, matrix) for matrix in jacobians[:wanted])
    trial.merits = (*trial.merits, *merits)


def _merit(peer: Peer, built: Arm, jacobian: FloatArray) -> float:
    """Return the merit, from J alone; NaN if J is not one of the arm's."""
    if not np.all(np.isfinite(jacobian)):
        return float("nan")
    try:
        built.variables(jacobian)
    except NotInModelError:
        return float("nan")
    return formulation(peer.formulation).merit(jacobian)


def _rows(trials: Sequence[_Trial], joints: int, starts: int) -> list[Row]:
    everything = [merit for trial in trials for merit in trial.merits if np.isfinite(merit)]
    if not everything:
        return [_row(trial, joints, starts, float("nan"), float("nan")) for trial in trials]
    sense = formulation(trials[0].peer.formulation).SENSE
    best = min(everything) if sense == "minimise" else max(everything)
    unit = _row(trials[0], joints, starts, best, float("nan")).milliseconds_per_success
    return [_row(trial, joints, starts, best, unit) for trial in trials]


def _row(trial: _Trial, joints: int, starts: int, best: float, unit: float) -> Row:
    ran, nan = trial.run is not None, float("nan")
    away = np.abs(np.array(trial.merits) - best)
    success = int(np.sum(away <= REACH))
    per_success = 1e3 * trial.seconds / success if success else nan
    return Row(
        formulation=trial.peer.formulation,
        joints=joints,
        peer=trial.peer.name,
        settings=trial.peer.settings,
        starts=starts if ran else 0,
        success=success,
        near=int(np.sum(away <= NEAR)),
        milliseconds_per_start=1e3 * trial.seconds / starts if ran else nan,
        milliseconds_per_success=per_success,
        relative=per_success / unit,
        setup_seconds=trial.setup,
        note=trial.note,
    )


@contextmanager
def _fresh_cache() -> Iterator[None]:
    """Compile everything anew, so that the time it takes shows."""
    before: Mapping[str, str | None] = {"XDG_CACHE_HOME": os.environ.get("XDG_CACHE_HOME")}
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder
        try:
            yield
        finally:
            for name, value in before.items():
                if value is None:
                    os.environ.pop(name)
                else:
                    os.environ[name] = value
