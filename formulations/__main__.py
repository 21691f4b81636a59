"""Entry point of ``lockedjoint`` and of ``python -m formulations``."""

import sys

import typer

from formulations.commands.app import app
from nlp.errors import LockedJointError

USAGE_ERROR = 2
INTERRUPTED = 130


def main() -> None:
    """Run the command line; whatever is wrong with the input is one sentence."""
    try:
        status = app(sys.argv[1:] or ["--help"], standalone_mode=False)
    except LockedJointError as error:
        _fail(str(error), error.exit_status)
    except typer.TyperException as error:
        _fail(error.format_message(), USAGE_ERROR)
    except (typer.Abort, KeyboardInterrupt):
        sys.exit(INTERRUPTED)
    sys.exit(status if isinstance(status, int) else 0)


def _fail(sentence: str, status: int) -> None:
    sys.stderr.write(f"Error: {' '.join(sentence.split())}\n")
    sys.exit(status)


if __name__ == "__main__":
    main()
