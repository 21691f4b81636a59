"""Chunks spread over workers that may die or hang; every start comes back once, or is lost."""

from collections import deque
from collections.abc import Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from dataclasses import dataclass, replace
from typing import Any, Protocol

from nlp.errors import WorkerError
from nlp.task import Chunk, Done, Lost, Outcomes

# How often a start may end its worker or exceed the time limit, as the only start of its chunk,
# before it is lost.
ATTEMPTS = 2

_PULSE = 0.5  # seconds between two looks at the workers


class Pool(Protocol):
    """Workers that run chunks.

    Attributes
    ----------
    isolated
        Whether a chunk that ends its worker can never end another chunk with it.
    """

    isolated: bool

    @property
    def size(self) -> int:
        """How many chunks can be under way at once."""

    def submit(self, chunk: Chunk, time_limit: float | None) -> Future[Outcomes]:
        """Run a chunk, for at most `time_limit` seconds from when it begins.

        The future raises BrokenExecutor if the chunk's worker ended, TimeoutError if the chunk
        ran for longer than the limit in seconds, and what building the task's solver raised.
        Cancelling it stops the chunk.

        Raises
        ------
        WorkerError
            If no worker can be had.
        """

    def supervise(self) -> None:
        """Fail the futures of chunks that ended or run too long; called at intervals."""

    def close(self) -> None:
        """Let go of the workers."""


@dataclass(frozen=True)
class Arrival:
    """What came of a chunk, or of some of its starts: those that ended, and those lost."""

    chunk: Chunk
    results: list[Done[Any]]
    lost: list[Lost]


@dataclass(frozen=True)
class _Trial:
    chunk: Chunk
    failures: int = 0
    again: bool = False


def spread(
    chunks: Iterable[Chunk], pool: Pool, time_limit: float | None = None
) -> Generator[Arrival, None, None]:
    """Yield what came of each chunk, as it comes.

    No more chunks are under way than the workers need, and chunks are drawn from the iterable
    only as workers ask, so memory does not grow with their number.

    When a worker ends or a chunk takes too long, its starts run again one by one. A start that
    fails `ATTEMPTS` times on its own is lost. Where workers are not isolated, nothing else is
    under way meanwhile, so that it is known which start is to blame.

    Parameters
    ----------
    chunks
        What to run.
    pool
        Where to run it.
    time_limit
        Seconds that a start may run, from when it begins; a chunk has this for each of its
        starts. No limit by default.

    Raises
    ------
    WorkerError
        If there is no worker and none can be had.
    """
    waiting = map(_Trial, chunks)
    again: deque[_Trial] = deque()
    flight: dict[Future[Outcomes], _Trial] = {}

    def fill() -> None:
        while len(flight) < max(1, pool.size):
            alone = again or any(trial.again for trial in flight.values())
            if alone and flight and not pool.isolated:
                return
            trial = again.popleft() if again else next(waiting, None)
            if trial is None:
                return
            try:
                limit = None if time_limit is None else time_limit * len(trial.chunk.indices)
                flight[pool.submit(trial.chunk, limit)] = trial
            except WorkerError:
                if not flight:
                    raise
                again.appendleft(trial)  # for one of those that there are
                return

    try:
        while True:
            fill()
            if not flight:
                return
            ended, _ = wait(flight, timeout=_PULSE, return_when=FIRST_COMPLETED)
            pool.supervise()
            for future in ended:
                yield from _landed(future, flight.pop(future), again)
    finally:
        for future in flight:
            future.cancel()


def _landed(
    future: Future[Outcomes], trial: _Trial, again: deque[_Trial]
) -> Generator[Arrival, None, None]:
    chunk = trial.chunk
    try:
        outcomes = future.result()
    except TimeoutError:
        why = "exceeded the time limit"
    except BrokenExecutor:
        why = "ended its process"
    else:
        done = [one for one in outcomes if isinstance(one, Done)]
        yield Arrival(chunk, done, [one for one in outcomes if isinstance(one, Lost)])
        return
    if len(chunk.indices) > 1:
        again += [_Trial(replace(chunk, indices=(k,)), again=True) for k in chunk.indices]
    elif trial.failures + 1 < ATTEMPTS:
        again.append(_Trial(chunk, trial.failures + 1, again=True))
    else:
        yield Arrival(chunk, [], [Lost(chunk.indices[0], why)])
