"""Where starts run: worker processes of this machine, or of a Dask cluster.

`nlp.dispatch` takes any `concurrent.futures.Executor`; these two are ready to use.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from types import TracebackType
from typing import Any

from joblib import cpu_count
from joblib.externals.loky import ProcessPoolExecutor

from nlp.errors import InputError, WorkerError, how_to_install

# The matrices are small: threads of linear algebra would only wait for one another.
_ONE_THREAD = {
    f"{library}_NUM_THREADS": "1"
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM", "NUMEXPR")
}
_PER_CORE = 8  # worker processes; more would only exhaust the machine's memory
_IDLE_SECONDS = 10.0  # after which a process without work ends
_PATIENCE = 12.0  # seconds without an answer or a worker, after which a cluster is given up
_PULSE = 2.0  # seconds between two questions to the scheduler


def default_workers() -> int:
    """Return the number of processor cores that this process may use."""
    return int(cpu_count())


# Pools of worker processes without work, by their number of processes.
_idle: dict[int, list[ProcessPoolExecutor]] = {}
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
        with _idle_lock:
            kept = _idle.get(self.size)
            self._processes = kept.pop() if kept else None

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
            with _idle_lock:
                _idle.setdefault(self.size, []).append(self._processes)
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
                        timeout=_IDLE_SECONDS,
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
            processes.shutdown(wait=True, kill_workers=True)


def end_idle_processes() -> None:
    """End the worker processes without work, for instance after a change of the environment."""
    with _idle_lock:
        pools = [pool for kept in _idle.values() for pool in kept]
        _idle.clear()
    for pool in pools:
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


class DaskExecutor(Executor):
    """The workers of a running Dask cluster, by ``Client.get_executor``.

    What that does not do: `check` gives a cluster up that no longer answers or has no workers.
    Start workers with one thread each. Whoever reaches the scheduler can run code on the
    scheduler and on the workers.

    Parameters
    ----------
    address
        Address of the scheduler, such as ``tcp://host:8786``.

    Raises
    ------
    InputError
        If Dask is not installed.
    WorkerError
        If no Dask scheduler answers there.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            allowed = f"left out, or first run: {how_to_install('distributed')}"
            raise InputError("scheduler", address, allowed) from None
        self._address = address
        client: Future[Any] = Future()

        def connect() -> None:
            try:
                client.set_result(Client(address, timeout=_PATIENCE, set_as_default=False))
            except Exception as error:
                client.set_exception(error)

        # Aside: it waits for a server that accepts and says nothing, without a limit.
        threading.Thread(target=connect, daemon=True).start()
        try:
            self._client = client.result(_PATIENCE + 2)
        except Exception as reason:
            raise WorkerError(f"No Dask scheduler answers at {address} ({reason}).") from None
        self._executor = self._client.get_executor(pure=False)
        self._asked = self._staffed = time.monotonic()
        self._cores = 1

    @property
    def capacity(self) -> int:
        """How many cores the workers had when last asked, and one more chunk for each."""
        return 2 * self._cores

    def submit(self, call: Callable[..., Any], /, *arguments: Any, **more: Any) -> Future[Any]:
        """Run a function on one of the workers."""
        future: Future[Any] = self._executor.submit(call, *arguments, **more)
        return future

    def check(self) -> None:
        """Ask the scheduler for its workers.

        Raises
        ------
        WorkerError
            If it does not answer, or there was no worker for 12 s.
        """
        now = time.monotonic()
        if now - self._asked < _PULSE:
            return
        said = f"The Dask scheduler at {self._address} no longer answers"
        try:
            cores = self._client.sync(
                self._client.scheduler.ncores, workers=None, callback_timeout=_PATIENCE
            )
        except Exception:
            raise WorkerError(f"{said}; results so far are kept.") from None
        self._asked = now
        self._cores = sum(cores.values())
        if cores:
            self._staffed = now
        elif now - self._staffed > _PATIENCE:
            said = f"The Dask cluster at {self._address} has no workers"
            raise WorkerError(f"{said}; results so far are kept.")

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: ARG002
        """Leave the cluster; it goes on without us."""
        with suppress(Exception):  # what is closed already, or never answers
            self._executor.shutdown(wait=False)
        with suppress(Exception):
            self._client.close(timeout=1.0)
