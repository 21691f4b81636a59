"""Ctrl-C: answered at once, or held back until something is finished."""

import atexit
import io
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, suppress
from types import FrameType

INTERRUPTED = 130  # exit status

_CASADI = os.path.join("casadi", "casadi.py")  # noqa: PTH118
_AGAIN = 0.02  # seconds until the handler looks again whether it may raise
_LONGEST = 1.0  # seconds that an interrupt may be held back
_TO_END = 0.7  # seconds that a start has to end after Ctrl-C
_TO_ANSWER = 1.0  # seconds after which an exception that nobody answered has been lost

_pressed: float | None = None  # when, as long as it is not answered
_raised = False  # whether an exception is on its way that nobody has answered


def answer_interrupts() -> None:
    """Raise KeyboardInterrupt at Ctrl-C, but not where it would be lost.

    Extension modules swallow an exception that is raised while they are imported, or turn it
    into another one, and CasADi one that is raised in Python code which it calls, for instance
    to convert an argument. After one that was raised in generated code, Python exits with
    another status. What is lost all the same, for instance in a destructor, is raised again
    until `settle_interrupts` or `interrupt_answered` is called. For command lines; does nothing
    where another handler than Python's own is in place.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _raise)
        sys.unraisablehook = _raise_again
        # The last of all: while Python takes itself down there is nothing left to interrupt.
        atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)


def interrupt_answered() -> None:
    """Tell that a KeyboardInterrupt was caught for good: it is not to be raised again."""
    global _pressed, _raised
    if _pressed is not None:
        _alarm(0)
    _pressed, _raised = None, False


def settle_interrupts() -> None:
    """Raise KeyboardInterrupt if a Ctrl-C was held back and not answered; stop listening.

    A later one ends the process at once, with the same sentence and status.
    """
    if signal.getsignal(signal.SIGINT) is _raise:
        signal.signal(signal.SIGINT, _end)
    _alarm(0)
    if _pressed is not None:
        raise KeyboardInterrupt


def _raise(_: int, frame: FrameType | None) -> None:
    global _pressed, _raised
    now = time.monotonic()
    _pressed = _pressed or now
    if _is_lost(frame):
        if now - _pressed > _LONGEST:
            _end(_, frame)
        if _alarm(_AGAIN):
            return
    _raised = True
    _alarm(_TO_ANSWER)
    raise KeyboardInterrupt


def _raise_again(lost: "sys.UnraisableHookArgs") -> None:
    """Show an exception that cannot be raised; raise that of Ctrl-C a little later."""
    if not issubclass(lost.exc_type, KeyboardInterrupt) or not _alarm(_AGAIN):
        sys.__unraisablehook__(lost)


def _end(_: int, __: FrameType | None) -> None:
    """End this process where an exception would be lost, or be shown with a traceback."""
    with suppress(Exception):  # the output of a command that was about to end
        sys.stdout.flush()
    os.write(2, b"Interrupted.\n")
    os._exit(INTERRUPTED)


def _alarm(seconds: float) -> bool:
    """Call the handler of Ctrl-C again after this time; return whether that is possible."""
    if not hasattr(signal, "setitimer"):
        return False
    if signal.getsignal(signal.SIGALRM) is signal.SIG_DFL:
        signal.signal(signal.SIGALRM, _look_again)
    if signal.getsignal(signal.SIGALRM) is not _look_again:
        return False
    signal.setitimer(signal.ITIMER_REAL, seconds)
    return True


def _look_again(_: int, frame: FrameType | None) -> None:
    global _pressed, _raised
    if _raised:
        if _is_on_its_way(sys.exception()):
            _alarm(_TO_ANSWER)
            return
        _pressed, _raised = None, False
    handler = signal.getsignal(signal.SIGINT)
    if callable(handler):
        handler(signal.SIGINT, frame)


def _is_on_its_way(error: BaseException | None) -> bool:
    """Whether what runs now, a ``finally`` for instance, does so because of a Ctrl-C."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__context__
    return error is not None


def _is_lost(frame: FrameType | None) -> bool:
    """Whether an exception may not get through: in an import, or in what CasADi calls."""
    innermost = frame
    while frame is not None and frame.f_back is not None:
        file = frame.f_code.co_filename
        if file.startswith(("<frozen importlib", "<string>")):
            return True
        if file.endswith(_CASADI) and frame is not innermost:
            return True
        frame = frame.f_back
    return False


@contextmanager
def deferred_interrupt(limited: bool = False) -> Iterator[None]:
    """Hold a first Ctrl-C back until the block ends; a second one acts at once.

    Where a handler is in place that is neither Python's own nor that of `answer_interrupts`,
    it is left alone.

    Parameters
    ----------
    limited
        Whether to raise inside of the block, too, if it does not end within a second. CasADi
        swallows an exception that is raised in its callbacks or conversions: Ipopt stops with
        one of several statuses, and the caller's loop would go on as if nothing had been
        pressed. Hence it is raised again after the block.

    Raises
    ------
    KeyboardInterrupt
        After the block, if the user interrupted during it.
    """
    before = signal.getsignal(signal.SIGINT)
    ours = threading.current_thread() is threading.main_thread()
    if not ours or before not in (signal.default_int_handler, _raise):
        yield
        return
    pressed = False
    quiet = ExitStack()

    def hold(_: int, __: FrameType | None) -> None:
        nonlocal pressed
        interrupt_answered()  # here, and raised again after the block
        again, pressed = pressed, True
        if again or (limited and not _alarm(_TO_END)):
            quiet.enter_context(redirect_stderr(io.StringIO()))  # CasADi's own message
            raise KeyboardInterrupt

    with quiet:  # closed last: an alarm of the last moment must not redirect for good
        signal.signal(signal.SIGINT, hold)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)
            if pressed:
                _alarm(0)
    if pressed:
        raise KeyboardInterrupt
