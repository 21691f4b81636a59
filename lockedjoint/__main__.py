"""Entry point of ``lockedjoint`` and of ``python -m lockedjoint``."""

import _thread
import io
import os
import signal
import sys
from types import FrameType

_USAGE_ERROR = 2
_NO_OUTPUT = 1
INTERRUPTED = 130


def main() -> None:
    """Run the command line; whatever is wrong with the input is one sentence."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)
        signal.signal(signal.SIGTERM, _interrupt)  # as Ctrl-C: worker processes end in order
    try:
        status = _run()
    except (KeyboardInterrupt, ImportError, SystemError) as error:
        if not _is_interrupt(error):
            raise
        sys.stderr.write("Interrupted.\n")
        status = INTERRUPTED
        # Where it passed through code that `exec` ran, as dataclasses do, Python remembers it
        # and would end with another status; it forgets when it runs other such code.
        exec("")
    sys.exit(status)


def _interrupt(_: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt, a little later where an exception would be swallowed.

    Extension modules swallow one while they are imported, and CasADi one in what it calls.
    """
    innermost = frame
    while frame is not None:
        file = frame.f_code.co_filename
        called_by_casadi = frame is not innermost and file.endswith("casadi.py")
        if called_by_casadi or file.startswith("<frozen importlib"):
            import threading  # here: before `main` an interrupt is a traceback

            threading.Timer(0.02, _thread.interrupt_main).start()
            return
        frame = frame.f_back
    raise KeyboardInterrupt


def _is_interrupt(error: BaseException | None) -> bool:
    """Whether this is a Ctrl-C, or what an extension module or CasADi made of it."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _run() -> int:
    for stream in (sys.stdout, sys.stderr):  # of a terminal that has not all characters
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    if sys.stdout is None:
        return _fail("standard output is closed.", _NO_OUTPUT)
    try:
        status = _invoke()
        sys.stdout.flush()
        return status
    except OSError as error:  # files have errors of their own
        if error.filename is not None:  # but for those that nobody thought of
            return _fail(f"{error.filename} cannot be used: {error.strerror}.", _USAGE_ERROR)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # nor can the rest be
        if isinstance(error, BrokenPipeError):  # whoever reads the output has ended
            return _NO_OUTPUT
        return _fail(f"standard output cannot be written: {error.strerror}.", _NO_OUTPUT)


def _invoke() -> int:
    import click  # here, where an interrupt is answered

    from lockedjoint.commands.app import app
    from lockedjoint.nlp.errors import LockedJointError

    if "_LOCKEDJOINT_COMPLETE" in os.environ:  # a shell asks what could follow
        app(prog_name="lockedjoint")  # answers, and exits
    try:
        # Not by calling it: an interrupt that click answers would be one without a sentence.
        with app.make_context("lockedjoint", sys.argv[1:] or ["--help"]) as context:
            app.invoke(context)
    except click.exceptions.Exit as ended:
        return ended.exit_code
    except LockedJointError as error:
        return _fail(str(error), error.exit_status)
    except click.ClickException as error:
        return _fail(error.format_message(), _USAGE_ERROR)
    return 0


def _fail(sentence: str, status: int) -> int:
    from lockedjoint.nlp.errors import printable

    if sys.stderr is not None:
        sys.stderr.write(f"Error: {printable(' '.join(sentence.split()))}\n")
    return status


if __name__ == "__main__":
    main()
