"""Ctrl-C while compiled code runs: answered right after, never lost."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


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
