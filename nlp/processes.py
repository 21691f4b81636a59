"""Worker processes on this machine, by joblib's loky."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Collection, Iterator
from concurrent.futures import BrokenExecutor, Future
from contextlib import contextmanager
from typing import Any

from joblib.externals import loky
from joblib.externals.loky.process_executor import ShutdownExecutorError

from nlp.spread import Results
from nlp.task import Chunk, run_chunk

# The matrices are small: threads of linear algebra would only stand in each other's way.
_ONE_THREAD = {
    f"{library}_NUM_THREADS": "1"
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM", "NUMEXPR")
}


class Processes:
    """A pool of processes, started when first needed and kept for the next call.

    Parameters
    ----------
    workers
        How many.
    """

    lost: tuple[type[Exception], ...] = (BrokenExecutor, ShutdownExecutorError)

    def __init__(self, workers: int) -> None:
        self.size = workers

    def submit(self, chunk: Chunk) -> Future[Results]:
        """Run a chunk in some process."""
        with _interrupts_held():
            future: Future[Results] = self._executor().submit(
                run_chunk, chunk.payload, chunk.seed, chunk.indices
            )
        return future

    def started(self, future: Future[Results], submitted: float) -> float | None:  # noqa: ARG002
        """Return when it was submitted: there are as many processes as chunks."""
        return submitted

    def kill(self, futures: Collection[Future[Results]]) -> None:
        """Kill all processes; new ones start with the next chunk."""
        # Chunks that run beside these are lost, too, and run again.
        self._executor().shutdown(wait=True, kill_workers=True)
        for future in futures:
            future.cancel()

    def abandon(self, futures: Collection[Future[Results]]) -> None:
        """Kill all processes, so that none works on for nothing."""
        self.kill(futures)

    def close(self) -> None:
        """Do nothing: idle processes end by themselves, or serve the next call."""

    def _executor(self) -> Any:
        return loky.get_reusable_executor(
            max_workers=self.size,
            env=_ONE_THREAD,
            initializer=_begin,
            initargs=(os.getpid(),),
        )


def _begin(parent: int) -> None:
    """Let this worker end with its parent, should that be killed."""
    threading.Thread(target=_outlive_not, args=(parent,), daemon=True).start()


def _outlive_not(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Let processes that start meanwhile ignore Ctrl-C, which is the parent's to answer.

    A blocked signal stays blocked in a child; a Ctrl-C of this moment comes right after.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
