"""A second thread that starts processes: an interrupt of the first does not end it halfway."""

import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import suppress
from multiprocessing import resource_tracker
from typing import TypeVar

from loky.backend import resource_tracker as loky_tracker

Result = TypeVar("Result")


class Submitter(threading.local):
    """A second thread for each thread that starts processes, or submits calls to them.

    Python raises KeyboardInterrupt in the main thread only. Raised while loky takes a call it
    would leave a process that no pool knows, and Python would wait for it when it exits. Each
    thread has a second one of its own because loky has a pool for each thread.
    """

    def __init__(self) -> None:  # called in each thread that uses the object
        self._second: Executor | None = None
        self._process = 0  # the process that has the second thread: a forked child has none

    def call(self, work: Callable[..., Result], *arguments: object) -> Result:
        """Return what a function returns, or raise what it raises, in the second thread.

        If the caller is interrupted the function goes on to its end.
        """
        if self._second is None or self._process != os.getpid():
            self._second, self._process = _started(), os.getpid()
        return self._second.submit(work, *arguments).result()

    def settle(self) -> None:
        """Wait until a function whose caller was interrupted has ended."""
        if self._second is not None and self._process == os.getpid():
            with suppress(RuntimeError):  # Python exits: it has waited for the second thread
                self._second.submit(int).result()


def _started() -> Executor:
    """Return a thread that has begun; an interrupt meanwhile ends it."""
    second = ThreadPoolExecutor(1, "submitter")
    try:
        second.submit(_block_interrupts).result()
    except BaseException:
        second.shutdown(wait=False)
        raise
    return second


def _block_interrupts() -> None:
    """Let this thread start processes that do not hear Ctrl-C: they inherit what it blocks.

    A terminal sends Ctrl-C to all processes, and one that is starting would answer with a
    traceback.
    """
    if not hasattr(signal, "pthread_sigmask"):
        return
    # The trackers of resources, of Python and loky, may unblock the signals as they start: they
    # have to run before.
    resource_tracker.ensure_running()
    loky_tracker.ensure_running()
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
