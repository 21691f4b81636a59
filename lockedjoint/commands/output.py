"""What commands print: an answer as lines or JSON; and their exit status.

Whatever is printed goes through `say` or `warn`, which escape the control characters of names
that files brought.
"""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from lockedjoint.commands.bars import progress
from lockedjoint.formulations.io.files import write_text
from lockedjoint.nlp.errors import printable

if TYPE_CHECKING:
    from lockedjoint.formulations.io.table import Table

#: Exit status of a command that did not find what it was asked for, or whose check failed.
UNSUCCESSFUL = 1
#: Exit status after Ctrl-C: 128 + SIGINT, as shells have it.
INTERRUPTED = 130
#: Number of columns of a terminal that everything printed fits.
WIDTH = 80
# Number of characters of a table's first column, if the whole table is too wide.
_NARROW = 24
# Least number of digits of a matrix's entries: with less room its columns come in blocks.
_FEWEST_DIGITS = 4
# Width of an entry's sign, its digit before the point, the point and the gap of two.
_BESIDE_DIGITS = 5


def say(text: str, nl: bool = True) -> None:
    """Print a text of one or more lines."""
    progress.close()
    click.echo(printable(text, "\n"), nl=nl)


def warn(*sentences: str) -> None:
    """Print sentences on standard error, a line each."""
    progress.close()
    for sentence in sentences:
        click.echo(printable(sentence), err=True)


def end(*sentences: str, status: int = UNSUCCESSFUL) -> NoReturn:
    """End the command with sentences on standard error and an exit status."""
    warn(*sentences)
    raise click.exceptions.Exit(status)


def as_text(values: Mapping[str, object]) -> str:
    """Return one line per value, names aligned; long values go on in the next line."""
    names = [printable(name).replace("_", " ") for name in values]
    width = max(map(len, names))
    lines = []
    for name, value in zip(names, values.values(), strict=True):
        parts = textwrap.wrap(
            shown(value),
            max(WIDTH - width - 2, WIDTH // 3),
            break_long_words=False,
            break_on_hyphens=False,
        )
        first, *rest = parts or [""]
        lines += [f"{name:<{width}}  {first}", *(f"{'':<{width}}  {part}" for part in rest)]
    return "\n".join(line.rstrip() for line in lines)


def shown(value: object, digits: int = 9) -> str:
    """Return a value as text: yes or no, numbers with `digits`, entries of lists side by side.

    Entries that are lists of their own, such as sets of joints, are told apart: ``0, 1  0, 2``.
    None and NaN are a dash.
    """
    if value is None or value != value:  # NaN alone differs from itself
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


def as_table(
    rows: Sequence[Mapping[str, object]],
    digits: int = 6,
    columns: Sequence[str] | None = None,
) -> str:
    """Return one line per row, headed by the names; empty without rows.

    Parameters
    ----------
    rows
        Values by name; all rows have the names of the first.
    digits
        Number of digits of numbers.
    columns
        Names of columns to show; ``["all"]`` for all. By default as many as fit a terminal of
        80 columns, and a line below that says which are left out.

    Raises
    ------
    InputError
        If there is no such column.
    """
    if not rows:
        return ""
    names = list(rows[0])
    cells = {name: [shown(row[name], digits) for row in rows] for name in names}
    heads = {name: name.replace("_", " ") for name in names}
    return chosen_columns(cells, heads, columns)


def chosen_columns(
    cells: Mapping[str, Sequence[str]],
    heads: Mapping[str, str],
    columns: Sequence[str] | None = None,
) -> str:
    """Return columns as a table: those that are asked for, or that fit; see `as_table`.

    `cells` has the texts of each column by its name, and `heads` what stands above them. If not
    all columns fit, the first is broken into lines of `_NARROW` characters.
    """
    if columns is not None:
        from lockedjoint.formulations.io.table import chosen_names

        return _written(cells, heads, chosen_names("--columns", columns, heads))
    if _width(whole := _written(cells, heads, list(cells))) <= WIDTH:
        return whole
    first = next(iter(cells))
    broken = [_broken(text) for text in cells[first]]
    cells = {**cells, first: broken}
    fitting: list[str] = []
    for name in cells:
        if _width(_written(cells, heads, [*fitting, name])) <= WIDTH or not fitting:
            fitting.append(name)
    left = [name for name in cells if name not in fitting]
    table = _written(cells, heads, fitting)
    if not left:
        return table
    more = textwrap.fill(f"Left out; --columns chooses: {', '.join(left)}.", WIDTH)
    return f"{table}\n\n{more}"


def _broken(text: str) -> str:
    """Return a text in lines of `_NARROW` characters; long names break after an underscore."""
    lines: list[str] = []
    for part in re.findall(r"[^_ ]*[_ ]*", text):
        if lines and len(lines[-1] + part.rstrip()) <= _NARROW:
            lines[-1] += part
        elif part:
            lines += textwrap.wrap(part, _NARROW, drop_whitespace=False)
    return "\n".join(line.rstrip() for line in lines)


def _written(
    cells: Mapping[str, Sequence[str]], heads: Mapping[str, str], names: Sequence[str]
) -> str:
    """Return the columns of these names as a table."""
    from lockedjoint.formulations.io.table import written

    lines = list(zip(*(cells[name] for name in names), strict=True))
    return written(lines, [heads[name] for name in names], "plain", "\n")


def fitted(table: Table[Any], columns: Sequence[str] | None = None) -> str:
    """Return a table for a terminal: the columns that are asked for, or that fit."""
    heads = table.columns(every=columns is not None)
    return chosen_columns({name: table.cells(name) for name in heads}, heads, columns)


def _width(text: str) -> int:
    """Return the number of characters of the longest line."""
    return max(map(len, text.splitlines()))


def rows_of(matrix: Sequence[Sequence[float]], digits: int) -> str:
    """Return the rows of a matrix with `digits` decimals, or fewer if they do not fit.

    If `_FEWEST_DIGITS` do not fit either, the columns come in blocks, one below the other.
    """
    count = len(matrix[0])
    fitting = max(min(digits, WIDTH // count - _BESIDE_DIGITS), min(digits, _FEWEST_DIGITS))
    block = max(1, WIDTH // (fitting + _BESIDE_DIGITS))
    parts = []
    for first in range(0, count, block):
        some = [row[first : first + block] for row in matrix]
        lines = "\n".join("  ".join(f"{x: .{fitting}f}" for x in row) for row in some)
        last = min(first + block, count) - 1
        parts.append(lines if count <= block else f"columns {first} to {last}\n{lines}")
    return "\n".join(parts)


@dataclass(frozen=True)
class Answer:
    """What a command has to show, and how it ends."""

    values: Any  #: What ``--json`` prints; numbers that are not finite become null.
    #: What is printed without ``--json``, or a function that makes it of the values.
    text: str | Callable[[Any], str] = as_text
    out: Path | None = None  #: A file that the JSON is written to.
    notes: Sequence[str] = ()  #: Sentences on standard error, before anything else.
    failure: Sequence[str] = ()  #: Sentences on why the exit status is not 0.
    status: int = 0  #: The exit status; with a failure `UNSUCCESSFUL`, if no other is given.
    until: Callable[[], None] | None = None  #: It is called after all is printed, and waits.
    draw: Callable[[], None] | None = None  #: It draws pictures, after all data are written.

    def show(self, as_json: bool) -> None:
        """Print and write it; `click.exceptions.Exit` with the status if that is not 0."""
        warn(*(f"Note: {note}" for note in self.notes))
        content = json.dumps(_finite(self.values), indent=1, allow_nan=False)
        if self.out is not None:
            write_text(self.out, content + "\n")
        if self.draw is not None:
            self.draw()
        if as_json:
            say(content)
        else:
            say(self.text if isinstance(self.text, str) else self.text(self.values))
        if self.until is not None:
            self.until()
        warn(*self.failure)
        if status := self.status or (UNSUCCESSFUL if self.failure else 0):
            raise click.exceptions.Exit(status)


def _finite(value: Any) -> Any:
    """Return plain values in which numbers that are not finite are None."""
    if isinstance(value, Mapping):
        return {name: _finite(entry) for name, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not isfinite(value) else value
