"""Worker processes on this machine."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import BrokenExecutor, Future, InvalidStateError
from contextlib import ExitStack, suppress
from functools import partial
from multiprocessing import spawn
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType
from typing import TYPE_CHECKING

import cloudpickle
from pebble import ProcessExpired, ProcessPool

from nlp.errors import WorkerError

if TYPE_CHECKING:  # a worker sets its environment before it imports any linear algebra
    from nlp.task import Chunk, Outcomes

# The matrices are small: threads of linear algebra would only wait for one another.
_ONE_THREAD = {
    f"{library}_NUM_THREADS": "1"
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM", "NUMEXPR")
}

# Seconds that building a solver may take, where there is a time limit for its starts.
SET_UP = 60.0

_KEPT = 10.0  # seconds that a process without work waits for more
_PER_CORE = 8  # processes; more would only exhaust the machine's memory

_STARTING = threading.Lock()
# Until a process has got its orders it has nothing to say: if this one ends first, by Ctrl-C,
# it would show a traceback.
_SILENT = "import sys; sys.excepthook = lambda *_: None; "


def _command_line(**handles: int) -> list[str]:
    words = list(_PLAIN(**handles))
    place = words.index("-c") + 1
    return [*words[:place], _SILENT + words[place], *words[place + 1 :]]


_PLAIN = spawn.get_command_line


class _Process(SpawnProcess):
    """A new interpreter, which neither runs the caller's script nor answers Ctrl-C."""

    def start(self) -> None:
        with _STARTING, ExitStack() as afterwards:
            # A blocked signal stays blocked in a child; a Ctrl-C of this moment comes after.
            if hasattr(signal, "pthread_sigmask"):
                before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
                afterwards.callback(signal.pthread_sigmask, signal.SIG_SETMASK, before)
            # Functions of the script travel by value, so the script is not run again.
            afterwards.callback(sys.modules.__setitem__, "__main__", sys.modules["__main__"])
            sys.modules["__main__"] = ModuleType("__main__")
            afterwards.callback(setattr, spawn, "get_command_line", spawn.get_command_line)
            spawn.get_command_line = _command_line
            super().start()

    @property
    def exitcode(self) -> int | None:
        """Exit status, never 0: the pool would not report a worker that ends with 0."""
        code = super().exitcode
        return -1 if code == 0 else code


class _Context(SpawnContext):
    Process = _Process


# Workers without work, each with the timer that ends it when none comes for a while.
_IDLE: dict[ProcessPool, threading.Timer] = {}
if hasattr(os, "register_at_fork"):  # they serve the process that started them
    os.register_at_fork(after_in_child=_IDLE.clear)


def _keep(pool: ProcessPool) -> None:
    timer = threading.Timer(_KEPT, _end_idle, (pool,))
    timer.daemon = True
    _IDLE[pool] = timer
    timer.start()


def _take() -> ProcessPool | None:
    """Return an idle worker that is ready, if there is one."""
    while _IDLE:
        with suppress(KeyError):  # ended at this moment
            pool, timer = _IDLE.popitem()
            timer.cancel()
            if pool.active:
                return pool
            _end(pool)
    return None


def _end_idle(pool: ProcessPool) -> None:
    timer = _IDLE.pop(pool, None)
    if timer is not None:
        timer.cancel()
        _end(pool)


def end_idle_processes() -> None:
    """End the workers that have no work, for instance after a change of the environment."""
    for pool in list(_IDLE):
        _end_idle(pool)


class Processes:
    """Processes that run chunks, started as needed and kept for a while for the next call.

    Each process is a pool of one: what happens to it concerns its own chunk only.

    Parameters
    ----------
    workers
        How many at most; never more are started than there are chunks, or than eight for
        each processor core.
    """

    isolated = True

    def __init__(self, workers: int) -> None:
        self.size = min(workers, _PER_CORE * (os.cpu_count() or 1))
        self._busy: dict[Future[Outcomes], ProcessPool] = {}

    def submit(self, chunk: Chunk, time_limit: float | None = None) -> Future[Outcomes]:
        """Run a chunk in some process; the limit does not count its start and set-up."""
        pool = _take()
        if pool is not None:
            with suppress(WorkerError):  # it broke this moment
                return self._schedule(pool, chunk, time_limit)
        pool = ProcessPool(1, initializer=_begin, context=_Context())
        return self._schedule(pool, chunk, time_limit)

    def supervise(self) -> None:
        """Fail the futures of pools that broke without notice."""
        for future, pool in list(self._busy.items()):
            if not pool.active:
                with suppress(InvalidStateError):
                    future.set_exception(BrokenExecutor("its pool broke"))

    def close(self) -> None:
        """Stop what is under way; idle processes end by themselves, or serve the next call."""
        for future in list(self._busy):
            future.cancel()

    def _schedule(
        self, pool: ProcessPool, chunk: Chunk, limit: float | None
    ) -> Future[Outcomes]:
        call = (chunk.payload, chunk.seed, chunk.indices)
        set_up = None if limit is None else max(limit, SET_UP)
        try:
            pool.schedule(_run, (chunk.payload, chunk.seed, ()), timeout=set_up)
            inner = pool.schedule(_run, call, timeout=limit)
        except (RuntimeError, OSError) as reason:
            _end(pool)
            raise WorkerError(f"No process can be started: {reason}.") from reason
        future: Future[Outcomes] = Future()
        self._busy[future] = pool
        future.add_done_callback(self._drop)
        inner.add_done_callback(partial(self._settle, future))
        return future

    def _settle(self, future: Future[Outcomes], inner: Future[bytes]) -> None:
        """Pass on what came of a chunk; its process is free before its sender knows."""
        pool = self._busy.pop(future, None)
        if pool is None:  # cancelled, or failed by `supervise`
            return
        error = inner.exception()
        if error is None:
            _keep(pool)
            outcome = pickle.loads(inner.result())
            error = outcome if isinstance(outcome, Exception) else None
        else:
            _end_aside(pool)
        if isinstance(error, ProcessExpired):
            error = BrokenExecutor(str(error))
        with suppress(InvalidStateError):  # cancelled at this moment
            if error is None:
                future.set_result(outcome)
            else:
                future.set_exception(error)

    def _drop(self, future: Future[Outcomes]) -> None:
        pool = self._busy.pop(future, None)
        if pool is not None:  # still at work, or broken
            _end_aside(pool)


def _end_aside(pool: ProcessPool) -> None:
    threading.Thread(target=_end, args=(pool,), daemon=True).start()


def _end(pool: ProcessPool) -> None:
    pool.stop()  # type: ignore[no-untyped-call]
    pool.join()


def _begin() -> None:
    """Prepare this worker: one thread of linear algebra, and an end when its parent ends."""
    os.environ.update(_ONE_THREAD)
    sys.excepthook = sys.__excepthook__
    threading.Thread(target=_end_with_parent, daemon=True).start()
    import nlp.task  # noqa: F401


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)


def _run(payload: bytes, seed: int, indices: Sequence[int]) -> bytes:
    """Run a chunk; return its outcomes, or the exception that building its solver raised."""
    from nlp.task import portable, run_chunk

    try:
        return bytes(cloudpickle.dumps(run_chunk(payload, seed, indices)))
    except Exception as error:
        return bytes(cloudpickle.dumps(portable(error)))
