"""What compiled code needs around it: one thread of linear algebra, and Ctrl-C afterwards."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from types import FrameType
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

P = ParamSpec("P")
T = TypeVar("T")


def one_blas_thread(function: Callable[P, T]) -> Callable[P, T]:
    """Return the function so that linear algebra within it runs on one thread.

    Matrices here are small: more threads would only wait for one another. The limit ends with
    the function; libraries that are loaded within it are not limited.
    """

    @wraps(function)
    def limited(*arguments: P.args, **keywords: P.kwargs) -> T:
        with threadpool_limits(limits=1, user_api="blas"):
            return function(*arguments, **keywords)

    return limited


@contextmanager
def deferred_interrupt() -> Iterator[None]:
    """Hold a first Ctrl-C back until the block ends; a second one acts at once.

    CasADi swallows the KeyboardInterrupt raised in its callbacks: Ipopt stops with one of
    several statuses, and the caller's loop would go on as if nothing had been pressed.
    Where another handler than Python's own is in place, it is left alone.

    Raises
    ------
    KeyboardInterrupt
        After the block, if the user interrupted during it.
    """
    ours = threading.current_thread() is threading.main_thread()
    if not ours or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    pressed = False

    def hold(number: int, frame: FrameType | None) -> None:
        nonlocal pressed
        if pressed:
            signal.default_int_handler(number, frame)
        pressed = True

    signal.signal(signal.SIGINT, hold)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if pressed:
        raise KeyboardInterrupt
