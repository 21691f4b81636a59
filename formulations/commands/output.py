"""What commands print: values as lines or JSON, a study's rows; and their exit status.

Whatever is printed goes through `say` or `warn`, which escape the control characters of names
that files brought.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from formulations.io.files import write_text
from nlp.errors import printable

if TYPE_CHECKING:
    from formulations.io.study import Effort, Study

UNSUCCESSFUL = 1
INTERRUPTED = 130
_MOST_NAMED = 5


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


def end(sentence: str, status: int = UNSUCCESSFUL) -> NoReturn:
    """End the command with a sentence on standard error and an exit status."""
    warn(sentence)
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
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.{digits}g}"
    if isinstance(value, Mapping):
        return ", ".join(
            f"{printable(name)} {shown(entry, digits)}" for name, entry in value.items()
        )
    if isinstance(value, (list, tuple)):
        parts = []
        for entry in value:
            text = shown(entry, digits)
            listed = isinstance(entry, (list, tuple))
            parts.append(text.replace("  ", ", ") if listed else text)
        return "  ".join(parts)
    return printable(str(value))


def as_table(rows: Sequence[Mapping[str, object]], digits: int = 6) -> str:
    """Return one line per row, headed by the names; empty without rows."""
    from formulations.io.table import written

    cells = [[shown(value, digits) for value in row.values()] for row in rows]
    heads = [name.replace("_", " ") for row in rows[:1] for name in row]
    return written(cells, heads, "plain") if rows else ""


def rows_of(matrix: Sequence[Sequence[float]], digits: int) -> str:
    """Return the rows of a matrix with so many digits."""
    return "\n".join("  ".join(f"{x: .{digits}f}" for x in row) for row in matrix)


def show(
    values: Any, as_json: bool, text: Callable[[Any], str] = as_text, out: Path | None = None
) -> None:
    """Print values as JSON or as a text; write the JSON to `out` if it is given.

    JSON has no word for what is not finite: there it is null.
    """
    content = json.dumps(_finite(values), indent=1, allow_nan=False)
    if out is not None:
        write_text(out, content + "\n")
    say(content if as_json else text(values))


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _finite(entry) for name, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def named(cell: object, start: object) -> dict[str, object]:
    """Return a record's cell and start by their names."""
    return {"case": cell, "start": start}


def refuse_damage(damaged: Mapping[Path, Sequence[tuple[object, object]]]) -> None:
    """Name the damaged records of stores, if there are any, and end with status 1."""
    for path, records in damaged.items():
        for cell, start in records[:_MOST_NAMED]:
            warn(f"Left out of {path}: damaged start {start} of {cell}.")
        if len(records) > _MOST_NAMED:
            warn(f"Left out of {path}: and {len(records) - _MOST_NAMED} more damaged records.")
    if any(damaged.values()):
        raise typer.Exit(UNSUCCESSFUL)


def run_study(
    study: Study,
    out: Path,
    as_json: bool = False,
    *,
    effort: Effort,
    each: Callable[[Any], object] | None = None,
    note: str = "",
) -> None:
    """Run a study into a folder and print its rows.

    Parameters
    ----------
    study
        What is run.
    out
        The folder, made if missing.
    as_json
        Whether JSON is printed, and nothing else.
    effort
        How it is run.
    each
        Prints every row as soon as it is written; by default their table is printed in the
        end.
    note
        A sentence below the table.

    Raises
    ------
    typer.Exit
        With status 130 if the user interrupted, 1 if something is wrong with the rows.
    """
    from formulations.io.study import INCOMPLETE
    from formulations.io.table import Table

    result = study.run(out, effort, each if each and not as_json else lambda _: None)
    table: Table[Any] = Table(next(iter(study.tables.values())), result.rows)
    if as_json:
        show({"complete": result.complete, "rows": table.plain()}, as_json)
    elif result.rows:
        if each is None:
            say(f"{table.terminal()}\n\n{note}")
        where = out if result.complete else out / INCOMPLETE
        say(f"Written to {where}: {', '.join(sorted(path.name for path in where.iterdir()))}")
    if not result.complete:
        done = f"what was done is in {out / INCOMPLETE}, the rest is missing"
        end(f"Interrupted: {done}.", INTERRUPTED)
    if result.complaint:
        end(f"Wrong: {result.complaint}.")
