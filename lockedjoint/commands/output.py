"""What commands print: an answer as lines or JSON; and their exit status.

Whatever is printed goes through `say` or `warn`, which escape the control characters of names
that files brought.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, NoReturn

import typer

from lockedjoint.formulations.io.files import write_text
from lockedjoint.nlp.errors import printable

UNSUCCESSFUL = 1
INTERRUPTED = 130


def progress(sentence: str) -> None:
    """Show what is being done, on a terminal's standard error, until something is printed."""
    if sys.stderr.isatty():
        typer.echo(f"\r\x1b[K{printable(sentence[:78], '')}", nl=False, err=True)


def say(text: str, nl: bool = True) -> None:
    """Print a text of one or more lines."""
    progress("")
    typer.echo(printable(text, "\n"), nl=nl)


def warn(*sentences: str) -> None:
    """Print sentences on standard error, a line each."""
    progress("")
    for sentence in sentences:
        typer.echo(printable(sentence), err=True)


def end(*sentences: str, status: int = UNSUCCESSFUL) -> NoReturn:
    """End the command with sentences on standard error and an exit status."""
    warn(*sentences)
    raise typer.Exit(status)


def as_text(values: Mapping[str, object]) -> str:
    """Return one line per value, names aligned."""
    names = [printable(name).replace("_", " ") for name in values]
    width = max(map(len, names))
    lines = zip(names, values.values(), strict=True)
    return "\n".join(f"{name:<{width}}  {shown(value)}" for name, value in lines)


def shown(value: object, digits: int = 9) -> str:
    """Return a value as a reader wants it: yes or no, so many digits, entries side by side.

    Entries that are lists of their own, such as sets of joints, are told apart: ``0, 1  0, 2``.
    """
    if value is None or value != value:
        return "–"
    if isinstance(value, (list, tuple, Mapping)) and not value:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value + 0.0:.{digits}g}"  # no -0
    if isinstance(value, Mapping):
        entries = [f"{printable(name)} {shown(entry, digits)}" for name, entry in value.items()]
        return ", ".join(entries)
    if isinstance(value, (list, tuple)):
        texts = [(shown(entry, digits), isinstance(entry, (list, tuple))) for entry in value]
        return "  ".join(text.replace("  ", ", ") if nested else text for text, nested in texts)
    return printable(str(value))


def as_table(rows: Sequence[Mapping[str, object]], digits: int = 6) -> str:
    """Return one line per row, headed by the names; empty without rows."""
    from lockedjoint.formulations.io.table import written

    cells = [[shown(value, digits) for value in row.values()] for row in rows]
    heads = [name.replace("_", " ") for row in rows[:1] for name in row]
    return written(cells, heads, "plain") if rows else ""


def rows_of(matrix: Sequence[Sequence[float]], digits: int) -> str:
    """Return the rows of a matrix with so many digits."""
    return "\n".join("  ".join(f"{x: .{digits}f}" for x in row) for row in matrix)


@dataclass(frozen=True)
class Answer:
    """What a command has to show, and how it ends."""

    values: Any  # for JSON, where what is not finite is null
    text: str | Callable[[Any], str] = as_text  # printed without ``--json``, or what makes it
    out: Path | None = None  # a file for the JSON
    notes: Sequence[str] = ()  # sentences on standard error, before anything else
    failure: Sequence[str] = ()  # why the exit status is not 0, in sentences
    status: int = 0  # the exit status; with a failure `UNSUCCESSFUL`, if no other is given

    def show(self, as_json: bool) -> None:
        """Print and write it; `typer.Exit` with the status if that is not 0."""
        warn(*(f"Note: {note}" for note in self.notes))
        content = json.dumps(_finite(self.values), indent=1, allow_nan=False)
        if self.out is not None:
            write_text(self.out, content + "\n")
        if as_json:
            say(content)
        else:
            say(self.text if isinstance(self.text, str) else self.text(self.values))
        warn(*self.failure)
        if status := self.status or (UNSUCCESSFUL if self.failure else 0):
            raise typer.Exit(status)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _finite(entry) for name, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not isfinite(value) else value
