"""Entry point of ``lockedjoint`` and of ``python -m formulations``."""

import sys

from nlp.interrupts import INTERRUPTED, answer_interrupts, settle_interrupts

USAGE_ERROR = 2


def main() -> None:
    """Run the command line; whatever is wrong with the input is one sentence."""
    answer_interrupts()
    try:
        try:
            status = _run()
        finally:
            settle_interrupts()
    except KeyboardInterrupt:
        sys.stderr.write("Interrupted.\n")
        status = INTERRUPTED
    sys.exit(status)


def _run() -> int:
    import typer  # here, where an interrupt is answered

    from formulations.commands.app import app
    from nlp.errors import LockedJointError

    try:
        status = app(sys.argv[1:] or ["--help"], standalone_mode=False)
    except LockedJointError as error:
        return _fail(str(error), error.exit_status)
    except typer.TyperException as error:
        return _fail(error.format_message(), USAGE_ERROR)
    except typer.Abort:
        raise KeyboardInterrupt from None
    return status if isinstance(status, int) else 0


def _fail(sentence: str, status: int) -> int:
    sys.stderr.write(f"Error: {' '.join(sentence.split())}\n")
    return status


if __name__ == "__main__":
    main()
