"""Workers of a Dask cluster, through the same call as processes here."""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from concurrent.futures import BrokenExecutor, Future
from contextlib import suppress
from functools import partial
from typing import Any

from nlp.errors import InputError, WorkerError
from nlp.spread import Results
from nlp.task import Chunk, run_chunk

_PATIENCE = 15.0  # seconds to wait for the scheduler and a first worker


class DaskCluster:
    """The workers of a running Dask cluster.

    A dead worker's chunks are run again by Dask itself. Start workers with one thread each:
    solvers run one at a time in a process.

    Parameters
    ----------
    address
        Address of the scheduler, such as ``tcp://host:8786``.

    Raises
    ------
    InputError
        If Dask is not installed, or no scheduler or no worker answers.
    """

    lost: tuple[type[Exception], ...] = (BrokenExecutor,)

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            allowed = "left out, or first run: pip install lockedjoint[cluster]"
            raise InputError("scheduler", address, allowed) from None
        self._address = address
        self._tasks: dict[Future[Results], Any] = {}
        self._started: dict[str, float] = {}
        try:
            self._client = Client(address, timeout=_PATIENCE, set_as_default=False)
        except (OSError, ValueError):
            allowed = "the address of a Dask scheduler that answers"
            raise InputError("scheduler", address, allowed) from None
        try:
            self._client.wait_for_workers(1, timeout=_PATIENCE)
        except TimeoutError:
            self.close()
            allowed = "that of a Dask scheduler with at least one worker"
            raise InputError("scheduler", address, allowed) from None
        self._topic = f"lockedjoint-{self._client.id}"
        self._client.subscribe_topic(self._topic, self._note)

    @property
    def size(self) -> int:
        """How many processes the cluster has now, and one more chunk to keep each busy."""
        return 2 * len(self._client.nthreads())

    def submit(self, chunk: Chunk) -> Future[Results]:
        """Run a chunk on some worker."""
        if self._client.status != "running":
            said = f"The scheduler {self._address} no longer answers; what arrived is kept."
            raise WorkerError(said)
        future: Future[Results] = Future()
        future.set_running_or_notify_cancel()
        task = self._client.submit(
            _run, self._topic, chunk.payload, chunk.seed, chunk.indices, pure=False
        )
        self._tasks[future] = task
        task.add_done_callback(partial(self._settle, future))
        return future

    def started(self, future: Future[Results], submitted: float) -> float | None:  # noqa: ARG002
        """Return when a worker said that it began; None while none has."""
        task = self._tasks.get(future)
        return None if task is None else self._started.get(task.key)

    def kill(self, futures: Collection[Future[Results]]) -> None:
        """Restart the workers that run these; their other chunks are run again by Dask."""
        tasks = [self._tasks[future] for future in futures if future in self._tasks]
        keys = {task.key for task in tasks}
        running = self._client.processing()
        workers = [address for address, held in running.items() if keys & set(held)]
        self.abandon(futures)
        if workers:
            # A worker started without a nanny cannot be restarted: it keeps its chunk.
            with suppress(ValueError):
                self._client.restart_workers(workers, timeout=_PATIENCE, raise_for_error=False)

    def abandon(self, futures: Collection[Future[Results]]) -> None:
        """Forget these: waiting ones are never run, running ones end for nothing."""
        tasks = [self._tasks.pop(future, None) for future in futures]
        known = [task for task in tasks if task is not None]
        for task in known:
            self._started.pop(task.key, None)
        self._client.cancel(known, force=True)

    def close(self) -> None:
        """Leave the cluster; it goes on without us."""
        self._client.close()

    def _settle(self, future: Future[Results], task: Any) -> None:
        if self._tasks.pop(future, None) is None:  # abandoned
            return
        self._started.pop(task.key, None)
        try:
            future.set_result(task.result())
        except Exception as error:
            future.set_exception(_told(error))

    def _note(self, event: tuple[float, str]) -> None:
        """Note that a chunk began to run, or runs again on another worker."""
        key = event[1]
        if any(task.key == key for task in list(self._tasks.values())):
            self._started[key] = time.monotonic()


def _run(topic: str, payload: bytes, seed: int, indices: Sequence[int]) -> Results:
    """Say that the chunk begins, and run it."""
    from distributed import get_worker

    worker = get_worker()
    worker.log_event(topic, worker.get_current_task())
    return run_chunk(payload, seed, indices)


def _told(error: Exception) -> Exception:
    """Return the error as `nlp.spread` expects it."""
    from distributed import KilledWorker
    from distributed.client import FutureCancelledError

    if isinstance(error, (KilledWorker, FutureCancelledError)):
        return BrokenExecutor(str(error))
    if isinstance(error, ModuleNotFoundError):
        return WorkerError(f"The cluster's workers lack a module: {error}.")
    return error
