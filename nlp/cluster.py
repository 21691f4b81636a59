"""Workers of a Dask cluster, through the same call as processes here."""

import asyncio
import logging
import threading
import time
from collections.abc import Coroutine, Sequence
from concurrent.futures import BrokenExecutor, Future, InvalidStateError
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

from nlp.errors import InputError, WorkerError, how_to_install
from nlp.processes import SET_UP
from nlp.task import Chunk, Outcomes, run_chunk

_PATIENCE = 12.0  # seconds without an answer or a worker, after which the cluster is given up
_PULSE = 0.5  # seconds between two questions to the scheduler


class DaskCluster:
    """The workers of a running Dask cluster.

    A dead worker's chunks are run again by Dask itself. Start workers with one thread each:
    solvers run one at a time in a process. Whoever reaches the scheduler can run code on the
    scheduler and on the workers.

    Parameters
    ----------
    address
        Address of the scheduler, such as ``tcp://host:8786``; for ``tls://``, Dask's
        configuration names the certificates.

    Raises
    ------
    InputError
        If Dask is not installed, the address is malformed, or there are no certificates for it.
    WorkerError
        If no Dask scheduler with a worker answers there within 12 s.
    """

    isolated = False  # chunks of one worker end with it

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            allowed = f"left out, or first run: {how_to_install('distributed', 'cluster')}"
            raise InputError("scheduler", address, allowed) from None
        _check_address(address)
        self._address = address
        self._sent: dict[Future[Outcomes], _Sent] = {}
        self._cores: dict[str, int] = {}  # of each worker, when last asked
        self._answered = self._staffed = time.monotonic()
        # What they log when a scheduler dies is said by our own errors.
        self._loggers = [logging.getLogger(name) for name in ("distributed", "tornado")]
        self._loggers += [logging.getLogger(f"distributed.{part}") for part in _PARTS]
        self._levels = [logger.level for logger in self._loggers]
        for logger in self._loggers:
            logger.setLevel(logging.CRITICAL + 1)
        try:
            # A Client waits for silent servers without a limit, so they are asked first.
            _answer_of(address)
            self._client = Client(address, timeout=_PATIENCE, set_as_default=False)
        except BaseException as error:
            self._restore_logging()
            if isinstance(error, OSError):  # also a time-out, or a connection closed at once
                raise WorkerError(f"No Dask scheduler answers at {address}.") from None
            if isinstance(error, Exception):
                said = f"The server at {address} is not a Dask scheduler of this version."
                raise WorkerError(said) from None
            raise
        self._questions = self._start(self._keep_asking())
        try:
            while not self._cores:
                self._check()
                time.sleep(0.05)
        except BaseException:
            self.close()
            raise
        self._topic = f"lockedjoint-{self._client.id}"
        self._client.subscribe_topic(self._topic, self._note)

    @property
    def size(self) -> int:
        """How many processes the cluster has now, and one more chunk to keep each busy."""
        return 2 * len(self._cores)

    def submit(self, chunk: Chunk, time_limit: float | None = None) -> Future[Outcomes]:
        """Run a chunk on some worker; the limit counts from when the worker begins."""
        self._check()
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

        Raises
        ------
        WorkerError
            If the scheduler ended, or there was no answer or no worker for 12 s.
        """
        self._check()
        now = time.monotonic()
        late = {f: s for f, s in self._sent.items() if s.latest is not None and s.latest < now}
        if not late:
            return
        keys = {sent.task.key for sent in late.values()}
        held = self._within(self._client.scheduler.processing(workers=None))
        workers = [address for address, tasks in held.items() if keys & set(tasks)]
        for future in late:
            with suppress(InvalidStateError):  # it ended at this moment
                future.set_exception(TimeoutError())
        if workers:
            # A worker started without a nanny cannot be restarted: it keeps its chunk.
            with suppress(ValueError):
                self._client.restart_workers(workers, timeout=_PATIENCE, raise_for_error=False)

    def close(self) -> None:
        """Leave the cluster; it goes on without us."""
        self._questions.cancel()
        with suppress(Exception):  # what is closed already, or never answers
            self._client.close(timeout=1.0)
        self._client.status = "closed"  # not again when it is deleted
        self._restore_logging()

    def _restore_logging(self) -> None:
        for logger, level in zip(self._loggers, self._levels, strict=True):
            logger.setLevel(level)

    def _start(self, work: Coroutine[Any, Any, Any]) -> Future[Any]:
        return asyncio.run_coroutine_threadsafe(work, self._client.loop.asyncio_loop)

    def _within(self, question: Coroutine[Any, Any, Any]) -> Any:
        """Return the scheduler's answer; WorkerError if there is none in time."""
        try:
            return self._start(question).result(_PATIENCE)
        except (OSError, TimeoutError):
            raise self._gone() from None

    async def _keep_asking(self) -> None:
        """Note when the scheduler last answered, and when it last had workers."""
        while True:
            with suppress(OSError):  # the connection broke: the client makes a new one
                self._cores = await self._client.scheduler.ncores(workers=None)
                self._answered = time.monotonic()
                if self._cores:
                    self._staffed = self._answered
            await asyncio.sleep(_PULSE)

    def _check(self) -> None:
        now = time.monotonic()
        if self._client.status != "running" or now - self._answered > _PATIENCE:
            raise self._gone()
        if now - self._staffed > _PATIENCE:
            said = f"The Dask cluster at {self._address} has no workers"
            raise WorkerError(f"{said}; results so far are kept.")

    def _gone(self) -> WorkerError:
        said = f"The Dask scheduler at {self._address} no longer answers"
        return WorkerError(f"{said}; results so far are kept.")

    def _settle(self, future: Future[Outcomes], task: Any) -> None:
        """Pass on what came of a chunk, its errors as `nlp.spread.Pool` has them."""
        from distributed import KilledWorker
        from distributed.client import FutureCancelledError

        with suppress(InvalidStateError):  # cancelled, or too late
            try:
                outcomes = task.result()
            except (KilledWorker, FutureCancelledError) as error:
                lost = self._client.status != "running"
                future.set_exception(self._gone() if lost else BrokenExecutor(str(error)))
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
        if not sent.task.done() and self._client.status == "running":
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


# Parts of distributed whose level Dask's configuration may set by itself.
_PARTS = ("batched", "client", "comm", "comm.tcp", "core", "scheduler", "utils", "worker")


def _check_address(address: str) -> None:
    """Raise InputError unless this is an address of a kind that can be connected to."""
    from distributed import Security
    from distributed.comm import get_address_host_port
    from distributed.comm.registry import backends

    scheme, separator, _ = address.partition("://")
    allowed = "the address of a Dask scheduler, such as tcp://host:8786"
    if not separator or scheme not in backends or scheme == "inproc":
        raise InputError("scheduler", address, allowed)
    try:
        _, port = get_address_host_port(address, strict=True)
    except ValueError:
        raise InputError("scheduler", address, allowed) from None
    if not 0 < port < 1 << 16:
        raise InputError("scheduler", address, f"{allowed}, a port from 1 to 65535")
    if scheme in ("tls", "wss"):
        try:
            context = Security().get_connection_args("client")["ssl_context"]
        except (OSError, ValueError):  # of the files that are named
            context = None
        if context is None:
            words = "after distributed.comm.tls of Dask's configuration names certificates"
            raise InputError("scheduler", address, f"{scheme}:// {words}")


def _answer_of(address: str) -> None:
    """Ask in a thread: this one may have an event loop already, and must hear Ctrl-C."""
    answer: Future[None] = Future()

    def ask() -> None:
        try:
            answer.set_result(asyncio.run(asyncio.wait_for(_ask(address), _PATIENCE)))
        except BaseException as error:
            answer.set_exception(error)

    threading.Thread(target=ask, daemon=True).start()
    answer.result()


async def _ask(address: str) -> None:
    """Ask the scheduler for its workers, to see that it is one and answers."""
    from distributed import Security, rpc

    arguments = Security().get_connection_args("client")
    async with rpc(address, timeout=_PATIENCE, connection_args=arguments) as scheduler:
        await scheduler.ncores(workers=None)


def _run(topic: str, payload: bytes, seed: int, indices: Sequence[int]) -> Outcomes:
    """Build the solver, log that the chunk begins, and run it."""
    from distributed import get_worker

    run_chunk(payload, seed, ())
    worker = get_worker()
    worker.log_event(topic, worker.get_current_task())
    return run_chunk(payload, seed, indices)
