"""Worker processes of this machine; `nlp.dispatch` takes any other executor as well."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import contextmanager
from multiprocessing import resource_tracker
from types import TracebackType
from typing import Any

from joblib import cpu_count
from joblib.externals.loky import ProcessPoolExecutor

from nlp.errors import WorkerError

# The matrices are small: threads of linear algebra would only wait for one another.
_ONE_THREAD = {
    f"{library}_NUM_THREADS": "1"
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM", "NUMEXPR")
}
_PER_CORE = 8  # worker processes; more would only exhaust the machine's memory
_IDLE_SECONDS = 10.0  # after which processes without work end
_HANDOVER_SECONDS = 0.5  # in which calls have gone to the processes' queue


def default_workers() -> int:
    """Return the number of processor cores that this process may use."""
    return int(cpu_count())


# Pools of worker processes without work, by their number of processes, and what ends them. Not
# loky's own time limit: it is a worker's, which may end just as work is sent to it.
_idle: dict[int, list[tuple[ProcessPoolExecutor, threading.Timer]]] = {}
_idle_lock = threading.Lock()
if hasattr(os, "register_at_fork"):  # they serve the process that started them
    os.register_at_fork(after_in_child=_idle.clear)


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
        with _idle_lock:
            if pools := _idle.get(self.size):
                self._processes, timer = pools.pop()
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
            self._end()
            future = self._submit(call, *arguments, **more)
        self._under_way.add(future)
        future.add_done_callback(self._under_way.discard)
        self._under_way.discard(began)
        return future

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the processes that still work, or keep them for the next executor."""
        if self._under_way:
            self._end()
        elif self._processes is not None:
            timer = threading.Timer(_IDLE_SECONDS, end_idle_processes, (self._processes,))
            timer.daemon = True
            with _idle_lock:
                _idle.setdefault(self.size, []).append((self._processes, timer))
            timer.start()
            self._processes = None

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: ARG002
        """End the processes, those that still work included."""
        self._end()

    def _submit(self, call: Callable[..., Any], *arguments: Any, **more: Any) -> Future[Any]:
        try:
            with _interrupts_blocked():
                if self._processes is None:
                    self._processes = ProcessPoolExecutor(
                        self.size,
                        initializer=_end_with_parent,
                        initargs=(os.getpid(),),
                        env=_ONE_THREAD,
                    )
                future: Future[Any] = self._processes.submit(call, *arguments, **more)
        except OSError as reason:
            raise WorkerError(f"No process can be started: {reason}.") from reason
        return future

    def _end(self) -> None:
        processes, self._processes = self._processes, None
        if processes is not None:
            self._wait_for_calls_to_run()
            processes.shutdown(wait=True, kill_workers=True)

    def _wait_for_calls_to_run(self) -> None:
        """Wait a moment: at a shutdown loky fails on calls that its thread has not yet seen."""
        latest = time.monotonic() + _HANDOVER_SECONDS
        while time.monotonic() < latest and not all(
            isinstance(call, Future) and (call.running() or call.done())
            for call in tuple(self._under_way)
        ):
            time.sleep(1e-3)


def end_idle_processes(these: ProcessPoolExecutor | None = None) -> None:
    """End the worker processes without work, for instance after a change of the environment."""
    with _idle_lock:
        ended = [(pool, timer) for pools in _idle.values() for pool, timer in pools]
        ended = [pair for pair in ended if these in (None, pair[0])]
        for pools in _idle.values():
            pools[:] = [pair for pair in pools if pair not in ended]
    for pool, timer in ended:
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
