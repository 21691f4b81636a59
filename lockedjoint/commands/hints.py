"""What helps a user whose option is not known where it stands.

What comes in: click's error. What goes out: the sentence that is printed.
"""

from __future__ import annotations

import click
from click.exceptions import NoSuchOption

# Commands that bound the worst case of one kind of arm only.
_BOUNDS_OF_ONE_ARM = ("bound max-min", "bound isotropy", "bound two-point")


def sentence_of(error: click.ClickException) -> str:
    """Return the message of an error; for some options with where they belong."""
    if isinstance(error, NoSuchOption) and error.ctx is not None:
        command = error.ctx.command_path.partition(" ")[2]
        if error.option_name == "--plugin":
            return f"--plugin goes before the command: lockedjoint --plugin FILE.py {command}"
        if error.option_name == "--model" and command in _BOUNDS_OF_ONE_ARM:
            other = "for another arm: lockedjoint bound worst-case --model …"
            return f"{error.message.rstrip('.')}; {other}"
    return error.format_message()
