"""Pages of the reference that are made from the program: its commands and its public names.

`conf.py` writes what the two public functions return, as Markdown, into docs/_build/made. The
pages reference/commands.md and reference/library.md include it. To change a text, change the
help of the command, the docstring, or the comment in ``lockedjoint/__init__.pyi``.
"""

from __future__ import annotations

import ast
import inspect
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import click

import lockedjoint as lj
from lockedjoint.commands.app import GROUPS, app

# Width of the help, in characters: as many as a page has room for.
_WIDTH = 88


def commands_page() -> str:
    """Return the reference of the command line: a heading for each command, and its help."""
    lines = ["# The command line", "", "What each command says of itself with `--help`.", ""]
    for heading, section in GROUPS.items():
        lines += [f"**{heading}.**", ""]
        lines += [
            f"- [`{name}`](#lockedjoint-{name}): {says}" for name, (_, says) in section.items()
        ]
        lines += [""]
    lines += _help(("lockedjoint",), app)
    for section in GROUPS.values():
        for name in section:
            command = app.get_command(click.Context(app), name)
            lines += _help(("lockedjoint", name), command)
            for inner, below in getattr(command, "commands", {}).items():
                lines += _help(("lockedjoint", name, inner), below, level=3)
    return "\n".join(lines) + "\n"


def _help(words: tuple[str, ...], command: Any, level: int = 2) -> list[str]:
    """Return the lines of a command's heading, of a level, and of its help.

    `words` are what a user types: the program, the command and, of a group, the inner command.
    """
    parent = None
    for word in words[:-1]:
        parent = click.Context(app, info_name=word, parent=parent, terminal_width=_WIDTH)
    context = click.Context(command, info_name=words[-1], parent=parent, terminal_width=_WIDTH)
    text = command.get_help(context)
    return [f"{'#' * level} {' '.join(words)}", "", "```text", text, "```", ""]


def library_page() -> str:
    """Return the reference of the public names, under the headings of ``__init__.pyi``."""
    lines = []
    for heading, entries in _sections().items():
        title, _, rest = heading.partition(": ")
        lines += [
            f"## {title.rstrip('.')}",
            "",
            f"{rest[:1].upper()}{rest[1:]}" if rest else "",
            "",
        ]
        for name, home in entries:
            lines += _entry(name, home)
    return "\n".join(lines) + "\n"


def _sections() -> dict[str, list[tuple[str, str]]]:
    """Return the public names, each with the module that it is from, by heading.

    A heading is the comment above a block of imports in ``__init__.pyi``. Its part before the
    first colon is the title, and the rest a sentence below it.
    """
    text = Path(lj.__file__).with_suffix(".pyi").read_text("utf-8")
    sections: dict[str, list[tuple[str, str]]] = {}
    for block in text.split("\n\n"):
        comment = " ".join(re.findall(r"^# (.*)$", block, re.MULTILINE))
        names = [
            (alias.name, str(statement.module))
            for statement in ast.parse(block).body
            if isinstance(statement, ast.ImportFrom)
            for alias in statement.names
        ]
        if names:
            sections[comment] = names
    return sections


def _entry(name: str, home: str) -> list[str]:
    """Return the lines on a public name that is imported from the module `home`.

    Autodoc writes those of a function or a class. A module has a link to its page, and a
    mapping has its keys.
    """
    full = f"lockedjoint.{name}"
    try:
        value: Any = getattr(lj, name)
    except lj.LockedJointError:  # the tool of an adapter is not installed
        value = ModuleType(name)
    if isinstance(value, ModuleType):
        module = f"{home}.{name}"
        return [f"### lj.{name}", "", f"The module {{py:mod}}`{module}`.", ""]
    if not callable(value):
        listed = ", ".join(f"`{key}`" for key in value)
        return [f"### lj.{name}", "", f"A mapping from names to what they mean: {listed}.", ""]
    kind, members = "function", list[str]()
    if inspect.isclass(value):
        kind = "exception" if issubclass(value, Exception) else "class"
        members = ["   :members:"]
    return [
        f"### lj.{name}",
        "",
        "```{eval-rst}",
        f".. auto{kind}:: {full}",
        *members,
        "```",
        "",
    ]
