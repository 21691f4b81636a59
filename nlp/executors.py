"""Chunks of starts dispatched to an executor whose workers may die or hang.

Every start comes back once, or is named as failed. Of executors, that of this machine is here.
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
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    as_completed,
    wait,
)
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing import current_process, resource_tracker
from typing import Any, TypeVar

from joblib import cpu_count
from joblib.externals.loky import ProcessPoolExecutor

from lockedjoint.nlp.errors import WorkerError
from lockedjoint.nlp.progress import Step
from lockedjoint.nlp.starts import Chunk, ChunkResult, FailedStart, RunChunk

Part = TypeVar("Part")
# The matrices are small: threads of linear algebra would only wait for one another. And glibc
# is to keep memory that is freed, which is asked for again at the next iteration.
_SETTINGS = {
    **{f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "BLIS")},
    "MALLOC_MMAP_THRESHOLD_": str(2**25),
    "MALLOC_TRIM_THRESHOLD_": str(2**26),
}
_PER_CORE = 8  # worker processes; more would only exhaust the machine's memory
_IDLE_SECONDS = 10.0  # after which processes without work end
_PULSE = 0.5  # seconds between two looks at an executor
_ATTEMPTS = 2  # of a start that ends its worker, as the only start under way
_HANDOVER_SECONDS = 0.5  # in which calls have gone to the processes' queue

# Pools without work: how many processes, the pool, and what ends it. Not loky's own time
# limit: it is a worker's, which may end just as work is sent to it.
_idle: list[tuple[int, ProcessPoolExecutor, threading.Timer]] = []
_idle_lock = threading.Lock()
if hasattr(os, "register_at_fork"):  # they serve the process that started them
    os.register_at_fork(after_in_child=_idle.clear)


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
    """Yield what comes of each call, in the order in which they end."""
    if executor is None:
        results: Iterator[Part] = (work(*call) for call in calls)
    else:
        under_way = [executor.submit(work, *call) for call in calls]
        results = (call.result() for call in as_completed(under_way))
    for k, part in enumerate(results, 1):
        progress(Step(f"{k} of {len(calls)} {name}", k / len(calls)))
        yield part


class LocalExecutor(Executor):
    """Worker processes of this machine, by joblib's loky; they start with the first call.

    Use it in a ``with`` block: at the end processes that still work are ended, and processes
    without work serve the next block for ten seconds. If a process ends, the calls under way
    raise `BrokenExecutor`, and the next call gets new processes.

    What loky's ``get_reusable_executor`` does not do: it has one pool for all threads of a
    process, so that a call that ends its worker ends the calls of other threads with it; and
    its workers answer a Ctrl-C, which a terminal sends to every process, with a traceback.

    Parameters
    ----------
    workers
        How many processes, at most eight for each core.
    """

    def __init__(self, workers: int) -> None:
        self.size = min(workers, _PER_CORE * default_workers())
        self.capacity = self.size + 1  # one waits, for whichever process is ready first
        self._under_way: set[object] = set()
        self._processes: ProcessPoolExecutor | None = None
        # Said when a process that grew by 300 MB is replaced: an error would end loky's thread.
        warnings.filterwarnings("ignore", "A worker stopped while some jobs", UserWarning)
        with _idle_lock:
            for entry in [entry for entry in _idle if entry[0] == self.size][:1]:
                _idle.remove(entry)
                _, self._processes, timer = entry
                timer.cancel()

    def submit(self, call: Callable[..., Any], /, *arguments: Any, **more: Any) -> Future[Any]:
        """Run a function in one of the processes.

        Raises
        ------
        WorkerError
            If no process can be started.
        """
        began = object()  # a Ctrl-C may come before there is a future
        self._under_way.add(began)
        try:
            future = self._submit(call, *arguments, **more)
        except BrokenExecutor:
            self.shutdown()
            future = self._submit(call, *arguments, **more)
        self._under_way.add(future)
        future.add_done_callback(self._under_way.discard)
        self._under_way.discard(began)
        return future

    def __exit__(self, *_: object) -> None:
        """End the processes that still work, or keep them for the next executor."""
        if self._under_way:
            self.shutdown()
        elif self._processes is not None:
            timer = threading.Timer(_IDLE_SECONDS, end_idle_processes, (self._processes,))
            timer.daemon = True
            with _idle_lock:
                _idle.append((self.size, self._processes, timer))
            timer.start()
            self._processes = None

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: ARG002
        """End the processes, those that still work included."""
        processes, self._processes = self._processes, None
        if processes is None:
            return
        # At a shutdown loky fails on calls that its thread has not yet seen.
        latest = time.monotonic() + _HANDOVER_SECONDS
        while time.monotonic() < latest and not all(
            isinstance(call, Future) and (call.running() or call.done())
            for call in tuple(self._under_way)
        ):
            time.sleep(1e-3)
        processes.shutdown(wait=True, kill_workers=True)

    def _submit(self, call: Callable[..., Any], *arguments: Any, **more: Any) -> Future[Any]:
        try:
            with _interrupts_blocked():
                if self._processes is None:
                    self._processes = ProcessPoolExecutor(
                        self.size,
                        initializer=_end_with_parent,
                        initargs=(os.getpid(),),
                        env=_SETTINGS,
                    )
                future: Future[Any] = self._processes.submit(call, *arguments, **more)
        except OSError as reason:
            raise WorkerError(f"No process can be started: {reason}.") from reason
        return future


def end_idle_processes(only: ProcessPoolExecutor | None = None) -> None:
    """End the worker processes without work, for instance after a change of the environment."""
    with _idle_lock:
        ended = [entry for entry in _idle if only in (None, entry[1])]
        _idle[:] = [entry for entry in _idle if entry not in ended]
    for _, pool, timer in ended:
        timer.cancel()
        pool.shutdown(wait=True, kill_workers=True)


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Start processes that do not hear Ctrl-C: they inherit which signals this thread blocks.

    A Ctrl-C of this moment is heard afterwards.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # It would unblock the signal: at once, then, and not while processes start.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_with_parent(parent: int) -> None:
    """End this worker when its parent has ended, even if a call never returns."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    if os.name == "posix":  # elsewhere the number stays the same
        threading.Thread(target=watch, daemon=True).start()


@dataclass(frozen=True)
class _Trial:
    """A chunk to be run; where it is one start alone, how often that ended its worker."""

    chunk: Chunk
    failures: int | None = None
    began: float = math.inf


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
            for future in wait(flight, _PULSE, FIRST_COMPLETED).done:
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
