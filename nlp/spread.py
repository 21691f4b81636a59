"""Chunks spread over workers that may die or hang; every chunk comes back once, or is lost."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Collection, Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from typing import Any, Protocol

from nlp.task import Chunk, Done

# How often a single start may end its worker, with nobody else at work, before it is lost.
ATTEMPTS = 2

Results = list[Done[Any]]


class Pool(Protocol):
    """Workers that run chunks.

    Attributes
    ----------
    lost
        What a future raises whose worker died or was killed.
    """

    lost: tuple[type[Exception], ...]

    @property
    def size(self) -> int:
        """How many chunks they can run at once."""

    def submit(self, chunk: Chunk) -> Future[Results]:
        """Run a chunk; raises one of `lost` itself if no worker can take it just now."""

    def started(self, future: Future[Results], submitted: float) -> float | None:
        """Return when it began to run, by `time.monotonic`; None if it may still wait.

        `submitted` is when it was submitted, by the same clock.
        """

    def kill(self, futures: Collection[Future[Results]]) -> None:
        """Stop these, by killing their workers; others may be lost with them."""

    def abandon(self, futures: Collection[Future[Results]]) -> None:
        """Stop caring for these."""

    def close(self) -> None:
        """Let go of the workers."""


@dataclass(frozen=True)
class Arrival:
    """What came of a chunk: one result per start, or None if it was lost."""

    chunk: Chunk
    results: Results | None


@dataclass(frozen=True)
class _Trial:
    chunk: Chunk
    failures: int = 0
    alone: bool = False
    since: float = 0.0


def spread(
    chunks: Iterable[Chunk], pool: Pool, time_limit: float | None = None
) -> Generator[Arrival, None, None]:
    """Yield what came of each chunk, as it comes.

    No more chunks are under way than there are workers, and chunks are drawn from the
    iterable only as workers ask, so memory does not grow with their number.

    When a worker dies or a chunk takes too long, chunks that were under way are suspects.
    Suspects run again one at a time, with nothing else under way, so that it is known which
    one is to blame; that one is split into its starts, and a start that ends its worker
    `ATTEMPTS` times alone is lost.

    Parameters
    ----------
    chunks
        What to run.
    pool
        Where to run it.
    time_limit
        Seconds that a chunk may run, not counting the time that it waits for a worker; no
        limit by default.
    """
    waiting = iter(chunks)
    suspects: deque[_Trial] = deque()
    flight: dict[Future[Results], _Trial] = {}
    try:
        while True:
            _fill(flight, suspects, waiting, pool)
            if not flight:
                return
            yield from _landed(flight, suspects, pool, time_limit)
            for trial in _overdue(flight, pool, time_limit):
                yield from _failed(trial, suspects)
    finally:
        if flight:
            pool.abandon(list(flight))


def _fill(
    flight: dict[Future[Results], _Trial],
    suspects: deque[_Trial],
    waiting: Iterable[Chunk],
    pool: Pool,
) -> None:
    if suspects:
        if not flight:
            trial = suspects.popleft()
            _submit(_Trial(trial.chunk, trial.failures, alone=True), flight, suspects, pool)
        return
    while len(flight) < max(1, pool.size):
        chunk = next(iter(waiting), None)
        if chunk is None or not _submit(_Trial(chunk), flight, suspects, pool):
            return


def _submit(
    trial: _Trial,
    flight: dict[Future[Results], _Trial],
    suspects: deque[_Trial],
    pool: Pool,
) -> bool:
    began = _Trial(trial.chunk, trial.failures, trial.alone, time.monotonic())
    try:
        flight[pool.submit(trial.chunk)] = began
    except pool.lost:  # a worker died since, and not of this chunk
        suspects.append(trial)
        return False
    return True


def _landed(
    flight: dict[Future[Results], _Trial],
    suspects: deque[_Trial],
    pool: Pool,
    time_limit: float | None,
) -> Generator[Arrival, None, None]:
    """Wait until something ends, and say what."""
    patience = None
    if time_limit is not None:
        # What has not begun yet cannot be late before this much time has passed.
        latest = time.monotonic() + time_limit
        ends = (_deadline(pool, *pair, time_limit) for pair in flight.items())
        patience = max(0.0, min(latest, *ends) - time.monotonic()) + 0.01
    ended, _ = wait(flight, timeout=patience, return_when=FIRST_COMPLETED)
    for future in ended:
        try:
            results = future.result()
        except pool.lost:
            yield from _failed(flight.pop(future), suspects)
        else:
            yield Arrival(flight.pop(future).chunk, results)


def _overdue(
    flight: dict[Future[Results], _Trial], pool: Pool, time_limit: float | None
) -> list[_Trial]:
    """Stop what takes too long; return it and what was lost with it."""
    if time_limit is None:
        return []
    now = time.monotonic()
    late = [one for one in flight.items() if _deadline(pool, *one, time_limit) < now]
    overdue = [future for future, _ in late if not future.done()]
    if not overdue:
        return []
    pool.kill(overdue)
    return [flight.pop(future) for future in overdue]


def _deadline(pool: Pool, future: Future[Results], trial: _Trial, time_limit: float) -> float:
    started = pool.started(future, trial.since)
    if started is not None:
        return started + time_limit
    # Behind one other at most. If neither that nor a start shows, its worker is stuck.
    return trial.since + 2 * time_limit


def _failed(trial: _Trial, suspects: deque[_Trial]) -> Generator[Arrival, None, None]:
    chunk = trial.chunk
    if not trial.alone:
        suspects.append(_Trial(chunk))
    elif len(chunk.indices) > 1:
        suspects.extend(
            _Trial(Chunk(chunk.payload, chunk.seed, (index,), chunk.label))
            for index in chunk.indices
        )
    elif trial.failures + 1 < ATTEMPTS:
        suspects.append(_Trial(chunk, trial.failures + 1))
    else:
        yield Arrival(chunk, None)
