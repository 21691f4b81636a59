"""Entry point of ``lockedjoint`` and of ``python -m lockedjoint``.

`main` runs the command line of `commands.app` and turns everything that can go wrong into one
sentence on standard error and an exit status. Ctrl-C and SIGTERM raise KeyboardInterrupt in the
main thread, so that files and worker processes are ended in order. The signal handlers belong
to this process alone: who imports the library gets none.
"""

import _thread
import io
import os
import signal
import sys
from types import FrameType

# Exit status for input that is not allowed, as click has it.
_USAGE_ERROR = 2
# Exit status if standard output cannot be written.
_NO_OUTPUT = 1
#: Exit status after Ctrl-C: 128 + SIGINT, as shells have it.
INTERRUPTED = 130
# Seconds after which an interrupt is tried again, where an exception would be swallowed.
_AGAIN_SECONDS = 0.02


def main() -> None:
    """Run the command line, and exit with its status."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)
        signal.signal(signal.SIGTERM, _interrupt)
    try:
        status = _run()
    except (KeyboardInterrupt, ImportError, SystemError) as error:
        if not _is_interrupt(error):
            raise
        sys.stderr.write("Interrupted.\n")
        status = INTERRUPTED
        # Python remembers an interrupt that passed through code run by `exec`, as that of
        # dataclasses, and would end with another status; it forgets when it runs other code so.
        exec("")
    sys.exit(status)


def _interrupt(_: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt, a little later where an exception would be swallowed.

    Extension modules swallow an exception while they are imported, and CasADi swallows one in
    what it calls. `frame` is where the signal came; the loop goes from there to its callers.
    """
    innermost = frame
    while frame is not None:
        file = frame.f_code.co_filename
        called_by_casadi = frame is not innermost and file.endswith("casadi.py")
        if called_by_casadi or file.startswith("<frozen importlib"):
            # Modules are imported late: an interrupt before `main` would be a traceback.
            import threading

            threading.Timer(_AGAIN_SECONDS, _thread.interrupt_main).start()
            return
        frame = frame.f_back
    raise KeyboardInterrupt


def _is_interrupt(error: BaseException | None) -> bool:
    """Whether this is a Ctrl-C, or what an extension module or CasADi made of it."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _run() -> int:
    """Run the command; return its exit status, also where its output cannot be written."""
    for stream in (sys.stdout, sys.stderr):  # a terminal may not have all characters
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    if sys.stdout is None:
        return _fail("standard output is closed.", _NO_OUTPUT)
    try:
        status = _invoke()
        sys.stdout.flush()
        return status
    except OSError as error:
        # Most files have errors of our own; this one is of a file that nobody thought of.
        if error.filename is not None:
            return _fail(f"{error.filename} cannot be used: {error.strerror}.", _USAGE_ERROR)
        # Python writes what is left of the output when it ends: that would fail, too.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):  # whoever reads the output has ended
            return _NO_OUTPUT
        return _fail(f"standard output cannot be written: {error.strerror}.", _NO_OUTPUT)


def _invoke() -> int:
    """Run the command of the arguments; return its exit status."""
    import click  # imported here, where an interrupt is answered

    from lockedjoint.commands.app import app
    from lockedjoint.commands.hints import sentence_of
    from lockedjoint.nlp.errors import LockedJointError

    if "_LOCKEDJOINT_COMPLETE" in os.environ:  # a shell asks what could follow
        app(prog_name="lockedjoint")  # it answers, and exits
    try:
        # The app is not called: click would answer an interrupt, without our sentence.
        with app.make_context("lockedjoint", sys.argv[1:] or ["--help"]) as context:
            app.invoke(context)
    except click.exceptions.Exit as ended:
        return ended.exit_code
    except LockedJointError as error:
        return _fail(str(error), error.exit_status)
    except click.ClickException as error:
        return _fail(sentence_of(error), _USAGE_ERROR)
    return 0


def _fail(sentence: str, status: int) -> int:
    """Print an error as one line on standard error; return the exit status."""
    from lockedjoint.nlp.errors import printable

    if sys.stderr is not None:
        sys.stderr.write(f"Error: {printable(' '.join(sentence.split()))}\n")
    return status


if __name__ == "__main__":
    main()
