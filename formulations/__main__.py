"""Entry point of ``lockedjoint`` and of ``python -m formulations``."""

from __future__ import annotations

import sys

from formulations.cli import app
from nlp.errors import LockedJointError

USAGE_ERROR = 2


def main() -> None:
    """Run the command line; an error of ours is one sentence and exit status 2."""
    try:
        app()
    except LockedJointError as error:
        sys.stderr.write(f"Error: {error}\n")
        sys.exit(USAGE_ERROR)


if __name__ == "__main__":
    main()
