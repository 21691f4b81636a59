"""Chunks of starts dispatched to an executor whose workers may die or hang.

A *start* is one run of a solver, a `Chunk` some starts of one task. A chunk goes to a *worker*,
a process, and comes back as a `ChunkResult`. Every start comes back once, or is named as
failed. The executor of this machine is loky's pool, `LocalExecutor`; those of Dask and MPI
are used as they are.
"""

import math
import os
import pickle
import signal
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Executor,
    Future,
    as_completed,
    wait,
)
from dataclasses import dataclass, replace
from multiprocessing import current_process
from typing import Any, TypeVar

from loky import cpu_count, get_reusable_executor

from lockedjoint.nlp.errors import WorkerError
from lockedjoint.nlp.progress import Step
from lockedjoint.nlp.starts import Chunk, ChunkResult, FailedStart, RunChunk
from lockedjoint.nlp.submitter import Submitter

Part = TypeVar("Part")
# Bytes up to which glibc takes memory from its own heap, and bytes at the heap's end that it
# keeps: memory that is freed is asked for again at the next iteration.
_FROM_HEAP_BYTES = 2**25
_KEPT_BYTES = 2**26
# Environment of a worker process. The matrices are small: threads of linear algebra would only
# wait for one another.
_SETTINGS = {
    **{f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "BLIS")},
    "MALLOC_MMAP_THRESHOLD_": str(_FROM_HEAP_BYTES),
    "MALLOC_TRIM_THRESHOLD_": str(_KEPT_BYTES),
}
# Largest number of worker processes for each core; more would only exhaust the machine's
# memory.
_PER_CORE = 8
# Seconds without work after which a worker process ends. Longer keeps memory, shorter starts
# processes anew.
_IDLE_SECONDS = 10.0
# Seconds between two looks at an executor.
_PULSE_SECONDS = 0.5
# Seconds in which calls have gone to the processes' queue.
_HANDOVER_SECONDS = 0.5
# Seconds between two looks at whether calls have gone there.
_HANDOVER_PULSE_SECONDS = 1e-3
# Seconds between two looks of a worker at whether its parent is there.
_PARENT_PULSE_SECONDS = 1.0
# Number of chunks under way for each core, on an executor that does not say how many it takes.
_CHUNKS_PER_CORE = 2
# Number of attempts of a start that ends its worker, as the only start under way.
_ATTEMPTS = 2
# Second threads, in which processes are started and calls submitted.
_SUBMITTER = Submitter()


def default_workers() -> int:
    """Return the number of processor cores that this process may use.

    One in a process that may start no others, such as those of ``multiprocessing.Pool``.
    """
    return 1 if current_process().daemon else int(cpu_count())


def in_groups(
    work: Callable[..., Part],
    calls: Sequence[tuple[Any, ...]],
    executor: Executor | None,
    progress: Callable[[str], None],
    name: str,
) -> Iterator[Part]:
    """Yield what comes of each call, in the order in which they end.

    `calls` has the arguments of each call of `work`; without an executor they are made here,
    one after another. `progress` is told how many have ended; `name` says of what.
    """
    if executor is None:
        results: Iterator[Part] = (work(*call) for call in calls)
    else:
        under_way = [executor.submit(work, *call) for call in calls]
        results = (call.result() for call in as_completed(under_way))
    for k, part in enumerate(results, 1):
        progress(Step(f"{k} of {len(calls)} {name}", k / len(calls)))
        yield part


class LocalExecutor(Executor):
    """Worker processes of this machine: the pool of loky, which a thread's blocks share.

    Use it in a ``with`` block. Processes serve the next block, too, and end after ten seconds
    without work; if calls are still under way at the end of the block all are ended. If a
    process ends, all calls under way in the pool raise `BrokenExecutor`, and the next call gets
    new processes.

    Parameters
    ----------
    workers
        How many processes, at most eight for each core.
    """

    def __init__(self, workers: int) -> None:
        self.size = min(workers, _PER_CORE * default_workers())
        self.capacity = self.size + 1  # one waits, for whichever process is ready first
        self._under_way: set[Future[Any]] = set()
        self._pool: Any = None
        # Said when a process that grew by 300 MB is replaced: an error would end loky's thread.
        warnings.filterwarnings(
            "ignore", r"A worker (stopped|was restarted) while some jobs", UserWarning
        )
        # Said when another thread works with another number of processes: they take turns.
        warnings.filterwarnings("ignore", "Trying to resize an executor", UserWarning)

    def submit(self, call: Callable[..., Any], /, *arguments: Any, **more: Any) -> Future[Any]:
        """Run a function in one of the processes.

        Raises
        ------
        WorkerError
            If no process can be started.
        """
        try:
            return _SUBMITTER.call(self._submitted, call, arguments, more)
        except OSError as reason:
            raise WorkerError(f"No process can be started: {reason}.") from reason

    def _submitted(
        self, call: Callable[..., Any], arguments: tuple[Any, ...], more: dict[str, Any]
    ) -> Future[Any]:
        """Submit a call, in a thread where no interrupt ends this halfway."""
        try:
            future: Future[Any] = self._started().submit(call, *arguments, **more)
        except RuntimeError:  # a process, or another thread, ended the pool
            self._pool = None
            future = self._started().submit(call, *arguments, **more)
        self._under_way.add(future)
        future.add_done_callback(self._ended)
        return future

    def _ended(self, call: Future[Any]) -> None:
        if not call.cancelled():  # the pool's thread has yet to see that it is
            self._under_way.discard(call)

    def _started(self) -> Any:
        """Return loky's pool, which is started or taken over at the first call."""
        if self._pool is None:
            self._pool = get_reusable_executor(
                self.size,
                timeout=_IDLE_SECONDS,
                initializer=_prepare_worker,
                initargs=(os.getpid(),),
                env=_SETTINGS,
            )
        return self._pool

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """End the processes if they may still work; else the next executor uses them."""
        _SUBMITTER.settle()
        if kind is not None or not all(call.cancelled() for call in self._under_way):
            self.shutdown()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: ARG002
        """End the processes, those that still work included."""
        _SUBMITTER.settle()
        if self._pool is None:
            return
        _wait_for_handover(tuple(self._under_way))
        self._pool.shutdown(wait=True, kill_workers=True)
        self._pool = None


def _wait_for_handover(calls: Sequence[Future[Any]]) -> None:
    """Wait until loky's thread has seen calls; a shutdown fails on one that it has not seen."""
    latest = time.monotonic() + _HANDOVER_SECONDS
    while time.monotonic() < latest and not all(c.running() or c.done() for c in calls):
        time.sleep(_HANDOVER_PULSE_SECONDS)
    # A cancelled call is done at once; `wait` waits until the thread has seen it, too.
    wait([call for call in calls if call.cancelled()], _HANDOVER_SECONDS)


def _prepare_worker(parent: int) -> None:
    """Leave Ctrl-C to the parent, and end with it, even if a call never returns.

    SIGTERM, which was blocked while this process started, ends it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})

    def watch() -> None:
        """End this process when its parent is another one: the first has ended."""
        while os.getppid() == parent:
            time.sleep(_PARENT_PULSE_SECONDS)
        os._exit(1)

    if os.name == "posix":  # elsewhere the number stays the same
        threading.Thread(target=watch, daemon=True).start()


@dataclass(frozen=True)
class _Trial:
    """A chunk to be run, or one start of it that is run alone."""

    chunk: Chunk
    # How often the start, alone, has ended its worker; None for a chunk of several starts.
    failures: int | None = None
    began: float = math.inf  # when it was submitted, in seconds of the monotonic clock


def dispatch(
    chunks: Iterable[Chunk],
    executor: Executor,
    time_limit: float | None = None,
    capacity: int | None = None,
) -> Generator[ChunkResult, None, None]:
    """Yield what came of each chunk, as it comes.

    Chunks are drawn only as workers ask, at most `capacity` at once, by default what the
    executor says of itself: memory does not grow with their number. It may be of processes
    here, on a cluster or under MPI, and its futures may raise anything if a worker ended.

    When a worker ends, whatever was under way runs again, one start at a time and nothing
    beside it, so that the start to blame is known. After `_ATTEMPTS` of these it has failed.

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
    capacity = capacity or _capacity(executor)
    try:
        while True:
            while len(flight) < capacity and not (
                flight and (again or any(t.failures is not None for t in flight.values()))
            ):
                trial = again.popleft() if again else next(waiting, None)
                if trial is None:
                    break
                try:
                    future = executor.submit(run, trial.chunk)
                except RuntimeError as reason:
                    raise WorkerError(f"The executor takes no more work: {reason}.") from reason
                flight[future] = replace(trial, began=time.monotonic())
            if not flight:
                return
            for future in wait(flight, _PULSE_SECONDS, FIRST_COMPLETED).done:
                yield from _landed(future, flight.pop(future), again, time_limit)
    finally:
        for future in flight:
            future.cancel()


def _capacity(executor: Executor) -> int:
    """Return how many chunks keep an executor busy, by the names that executors have for it."""
    for name in ("capacity", "_max_workers", "num_workers"):
        if isinstance(number := getattr(executor, name, None), int):
            return max(1, number)
    return _CHUNKS_PER_CORE * default_workers()


def _landed(
    future: Future[bytes], trial: _Trial, again: deque[_Trial], time_limit: float | None
) -> Generator[ChunkResult, None, None]:
    """Yield what came of a trial that has ended.

    If it ended its worker, its starts are put into `again`, one by one, or the start has
    failed.
    """
    chunk = trial.chunk
    try:
        result: ChunkResult | Exception = pickle.loads(future.result())
    except CancelledError:
        raise WorkerError("The executor cancelled its work; results so far are kept.") from None
    except Exception:  # its worker ended
        seconds = time.monotonic() - trial.began
        failures = 0 if trial.failures is None else trial.failures + 1
        if failures < _ATTEMPTS:
            again += [_Trial(replace(chunk, indices=(k,)), failures) for k in chunk.indices]
        else:
            late = time_limit is not None and seconds >= time_limit
            reason = "exceeded the time limit" if late else "ended its process"
            yield ChunkResult(chunk.label, failed=[FailedStart(chunk.indices[0], reason)])
        return
    if isinstance(result, Exception):
        raise result
    yield result
