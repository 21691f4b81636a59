"""What helps a user whose option or command is not known where it stands.

What comes in: click's error. What goes out: the sentence that is printed.
"""

from __future__ import annotations

import re
from difflib import get_close_matches

import click
from click.exceptions import NoSuchOption

# Commands that bound the worst case of one kind of arm only.
_BOUNDS_OF_ONE_ARM = ("bound max-min", "bound isotropy", "bound two-point")
# A name that is longer is no command that was written wrong, and takes long to compare.
_LONGEST_NAME = 100


def sentence_of(error: click.ClickException) -> str:
    """Return the message of an error; with where an option belongs, or what a name may mean."""
    if isinstance(error, NoSuchOption) and error.ctx is not None:
        command = error.ctx.command_path.partition(" ")[2]
        if error.option_name == "--plugin":
            return f"--plugin goes before the command: lockedjoint --plugin FILE.py {command}"
        if error.option_name == "--model" and command in _BOUNDS_OF_ONE_ARM:
            other = "for another arm: lockedjoint bound worst-case --model …"
            return f"{error.message.rstrip('.')}; {other}"
    context = error.ctx if isinstance(error, click.UsageError) else None
    unknown = re.fullmatch(r"No such command '(.*)'\.", error.message, re.DOTALL)
    if unknown and context is not None and isinstance(context.command, click.Group):
        names = context.command.list_commands(context)
        for near in get_close_matches(unknown[1][:_LONGEST_NAME], names, n=1):
            return f"{error.message} Did you mean '{near}'?"
    return error.format_message()
