"""Workers of a Dask cluster, through the same call as processes here."""

import time
from collections.abc import Sequence
from concurrent.futures import BrokenExecutor, Future, InvalidStateError
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

from nlp.errors import InputError, WorkerError
from nlp.processes import SET_UP
from nlp.task import Chunk, Outcomes, run_chunk

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

    isolated = False  # chunks of one worker end with it

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            allowed = "left out, or first run: pip install lockedjoint[cluster]"
            raise InputError("scheduler", address, allowed) from None
        self._address = address
        self._sent: dict[Future[Outcomes], _Sent] = {}
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

    def submit(self, chunk: Chunk, time_limit: float | None = None) -> Future[Outcomes]:
        """Run a chunk on some worker; the limit counts from when the worker begins."""
        if self._client.status != "running":
            said = f"The scheduler {self._address} no longer answers; results so far are kept."
            raise WorkerError(said)
        future: Future[Outcomes] = Future()
        call = (self._topic, chunk.payload, chunk.seed, chunk.indices)
        task = self._client.submit(_run, *call, pure=False)
        # It waits behind one other at most. If it has not begun by then, its worker is stuck.
        late = None if time_limit is None else time.monotonic() + 2 * (time_limit + SET_UP)
        self._sent[future] = _Sent(task, time_limit, late)
        future.add_done_callback(self._forget)
        task.add_done_callback(partial(self._settle, future))
        return future

    def supervise(self) -> None:
        """Stop chunks that run too long, by a restart of their workers.

        Other chunks of these workers are run again by Dask.
        """
        now = time.monotonic()
        late = {f: s for f, s in self._sent.items() if s.latest is not None and s.latest < now}
        if not late:
            return
        keys = {sent.task.key for sent in late.values()}
        running = self._client.processing()
        workers = [address for address, held in running.items() if keys & set(held)]
        for future in late:
            with suppress(InvalidStateError):  # it ended at this moment
                future.set_exception(TimeoutError())
        if workers:
            # A worker started without a nanny cannot be restarted: it keeps its chunk.
            with suppress(ValueError):
                self._client.restart_workers(workers, timeout=_PATIENCE, raise_for_error=False)

    def close(self) -> None:
        """Leave the cluster; it goes on without us."""
        self._client.close()

    def _settle(self, future: Future[Outcomes], task: Any) -> None:
        """Pass on what came of a chunk, its errors as `nlp.spread.Pool` has them."""
        from distributed import KilledWorker
        from distributed.client import FutureCancelledError

        with suppress(InvalidStateError):  # cancelled, or too late
            try:
                outcomes = task.result()
            except (KilledWorker, FutureCancelledError) as error:
                future.set_exception(BrokenExecutor(str(error)))
            except ModuleNotFoundError as error:
                said = f"The cluster's workers lack a module: {error}."
                future.set_exception(WorkerError(said))
            except Exception as error:
                future.set_exception(error)
            else:
                future.set_result(outcomes)

    def _forget(self, future: Future[Outcomes]) -> None:
        """Cancel the task if it is still there: a waiting one is never run."""
        sent = self._sent.pop(future)
        if not sent.task.done():
            self._client.cancel([sent.task], force=True)

    def _note(self, event: tuple[float, str]) -> None:
        """Note that a chunk began to run, or runs again on another worker."""
        for sent in list(self._sent.values()):
            if sent.task.key == event[1] and sent.limit is not None:
                sent.latest = time.monotonic() + sent.limit


@dataclass
class _Sent:
    """A chunk on the cluster: its limit in seconds, and when it will have run too long."""

    task: Any
    limit: float | None
    latest: float | None


def _run(topic: str, payload: bytes, seed: int, indices: Sequence[int]) -> Outcomes:
    """Build the solver, log that the chunk begins, and run it."""
    from distributed import get_worker

    run_chunk(payload, seed, ())
    worker = get_worker()
    worker.log_event(topic, worker.get_current_task())
    return run_chunk(payload, seed, indices)
