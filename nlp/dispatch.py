"""Chunks dispatched to an executor whose workers may die or hang.

Every start comes back once, or is named as failed.
"""

import math
import pickle
import time
from collections import deque
from collections.abc import Generator, Iterable
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from dataclasses import dataclass, replace
from typing import Any

from nlp.errors import WorkerError
from nlp.executors import default_workers
from nlp.starts import Chunk, FailedStart, FinishedStart, Outcomes, RunChunk

# How often a start may end its worker, as the only start under way, before it is given up.
_ATTEMPTS = 2

_PULSE = 0.5  # seconds between two looks at the executor


@dataclass(frozen=True)
class ChunkResult:
    """What came of a chunk, or of a part of it: starts that ended, and those that failed."""

    chunk: Chunk
    finished: list[FinishedStart[Any]]
    failed: list[FailedStart]


@dataclass(frozen=True)
class _Trial:
    chunk: Chunk
    began: float = math.inf
    failures: int = 0
    alone: bool = False


def dispatch(
    chunks: Iterable[Chunk],
    executor: Executor,
    time_limit: float | None = None,
    capacity: int | None = None,
) -> Generator[ChunkResult, None, None]:
    """Yield what came of each chunk, as it comes.

    No more chunks are under way than the executor needs, and chunks are drawn from the iterable
    only as workers ask, so memory does not grow with their number.

    When a worker ends, whatever was under way runs again, one start at a time and nothing
    beside it, so that the start to blame is known. After `_ATTEMPTS` of these it has failed.

    Parameters
    ----------
    chunks
        What to run.
    executor
        Where to run it: of processes here, on a cluster or under MPI. Its future may raise
        anything if a worker ended.
    time_limit
        Seconds that a start may run; its worker ends itself then. No limit by default.
    capacity
        How many chunks are under way at most; by default what the executor says of itself.

    Raises
    ------
    WorkerError
        If the executor takes no more work, or its work was cancelled.
    Exception
        What building a chunk's problem raised.
    """
    run = RunChunk(time_limit)
    waiting = map(_Trial, chunks)
    again: deque[_Trial] = deque()
    flight: dict[Future[bytes], _Trial] = {}

    def fill() -> None:
        while len(flight) < (capacity or _capacity(executor)):
            if flight and (again or any(trial.alone for trial in flight.values())):
                return
            trial = again.popleft() if again else next(waiting, None)
            if trial is None:
                return
            try:
                future = executor.submit(run, trial.chunk)
            except (BrokenExecutor, RuntimeError) as reason:
                raise WorkerError(f"The executor takes no more work: {reason}.") from reason
            flight[future] = replace(trial, began=time.monotonic())

    try:
        while True:
            fill()
            if not flight:
                return
            ended, _ = wait(flight, timeout=_PULSE, return_when=FIRST_COMPLETED)
            for future in ended:
                yield from _landed(future, flight.pop(future), again, time_limit)
    finally:
        for future in flight:
            future.cancel()


def _capacity(executor: Executor) -> int:
    """Return how many chunks keep an executor busy, by the names that executors have for it."""
    for name in ("capacity", "_max_workers", "num_workers"):
        if isinstance(number := getattr(executor, name, None), int):
            return max(1, number)
    return 2 * default_workers()


def _landed(
    future: Future[bytes], trial: _Trial, again: deque[_Trial], time_limit: float | None
) -> Generator[ChunkResult, None, None]:
    chunk = trial.chunk
    try:
        outcomes: Outcomes = pickle.loads(future.result())
    except CancelledError:
        raise WorkerError("The executor cancelled its work; results so far are kept.") from None
    except Exception:  # its worker ended
        seconds = time.monotonic() - trial.began
        if len(chunk.indices) > 1:
            again += [_Trial(replace(chunk, indices=(k,)), alone=True) for k in chunk.indices]
        elif trial.failures + trial.alone < _ATTEMPTS:
            again.append(_Trial(chunk, failures=trial.failures + trial.alone, alone=True))
        else:
            late = time_limit is not None and seconds >= time_limit
            reason = "exceeded the time limit" if late else "ended its process"
            yield ChunkResult(chunk, [], [FailedStart(chunk.indices[0], reason)])
        return
    if isinstance(outcomes, Exception):
        raise outcomes
    finished = [start for start in outcomes if isinstance(start, FinishedStart)]
    yield ChunkResult(chunk, finished, [s for s in outcomes if isinstance(s, FailedStart)])
