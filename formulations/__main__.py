"""Entry point of ``lockedjoint`` and of ``python -m formulations``."""

import os
import sys

USAGE_ERROR = 2
BROKEN_PIPE = 1
INTERRUPTED = 130


def main() -> None:
    """Run the command line; whatever is wrong with the input is one sentence."""
    try:
        status = _run()
    except KeyboardInterrupt:
        sys.stderr.write("Interrupted.\n")
        status = INTERRUPTED
    sys.exit(status)


def _run() -> int:
    import typer  # here, where an interrupt is answered

    from formulations.commands.app import app
    from nlp.errors import LockedJointError

    if "_LOCKEDJOINT_COMPLETE" in os.environ:  # a shell asks what could follow
        app(prog_name="lockedjoint")  # answers, and exits
    command = typer.main.get_command(app)
    try:
        # Not by calling it: an interrupt that Typer answers would be one without a sentence.
        with command.make_context("lockedjoint", sys.argv[1:] or ["--help"]) as context:
            command.invoke(context)
    except typer.Exit as ended:
        return ended.exit_code
    except LockedJointError as error:
        return _fail(str(error), error.exit_status)
    except typer.TyperException as error:
        return _fail(error.format_message(), USAGE_ERROR)
    except BrokenPipeError:  # whoever reads the output has ended; nor can the rest be flushed
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    return 0


def _fail(sentence: str, status: int) -> int:
    sys.stderr.write(f"Error: {' '.join(sentence.split())}\n")
    return status


if __name__ == "__main__":
    main()
