"""Pages in Markdown: templates beside their studies, filled from the rows of tables.

A template is in the language of Jinja. The functions of this file that take text or rows are
its filters, listed in `_environment`: ``rows | table`` in a template calls `table`. Rows are
dataclasses, of one kind in a table.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import groupby
from math import isnan
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from lockedjoint.formulations.io.rounding import outward, rounded_down, rounded_up
from lockedjoint.formulations.io.table import Table, header, versions, written

#: An isotropy defect or a residual below this is the solver's tolerance, not a number.
NOTHING = 1e-6
#: A gap below this, in percent, is none.
CLOSED = 1e-4


def page(template: Path, values: Mapping[str, object]) -> str:
    """Return a template, filled; it may extend ``page.md.j2`` of this folder."""
    return _environment(template.parent).get_template(template.name).render(values)


def block(template: Path, name: str, values: Mapping[str, object]) -> str:
    """Return one block of a template, filled."""
    loaded = _environment(template.parent).get_template(template.name)
    return "".join(loaded.blocks[name](loaded.new_context(dict(values))))


def prose(text: str) -> str:
    """Return a text as one line: templates break lines where they like."""
    return " ".join(text.split())


def bullets(text: str) -> str:
    """Return the paragraphs of a text, separated by empty lines, as a Markdown list."""
    runs = groupby(text.splitlines(), key=lambda line: bool(line.strip()))
    return "\n".join(f"- {prose(' '.join(lines))}" for full, lines in runs if full)


def listed(text: str, separator: str) -> str:
    """Return the lines of a text that are not empty, joined by a separator."""
    return separator.join(line.strip() for line in text.splitlines() if line.strip())


def known(rows: Iterable[Any], name: str) -> list[Any]:
    """Return the rows whose field of that name is not NaN."""
    return [row for row in rows if getattr(row, name) == getattr(row, name)]


def groups(rows: Iterable[Any], *names: str) -> list[tuple[tuple[Any, ...], list[Any]]]:
    """Return the rows by the values of some fields, in the order of first appearance."""
    grouped: dict[tuple[Any, ...], list[Any]] = {}
    for row in rows:
        grouped.setdefault(tuple(getattr(row, name) for name in names), []).append(row)
    return list(grouped.items())


def by(rows: Iterable[Any], key: str, value: str) -> dict[Any, Any]:
    """Return one field of the rows by another."""
    return {getattr(row, key): getattr(row, value) for row in rows}


def table(rows: Sequence[Any]) -> str:
    """Return rows of one kind as a Markdown table; empty if there are none."""
    return Table(type(rows[0]), rows).markdown() if rows else ""


def aligned(text: str) -> str:
    """Return lines of cells between bars as a Markdown table, headed by the first line."""
    heads, *lines = (line.split(" | ") for line in text.splitlines() if line.strip())
    return written(lines, heads, "pipe")


@lru_cache
def _environment(folder: Path) -> Environment:
    """Return what loads the templates of a folder, with the filters that they may use."""
    made = Environment(
        loader=FileSystemLoader([folder, Path(__file__).parent]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    own = (
        aligned,
        bullets,
        by,
        groups,
        known,
        listed,
        outward,
        prose,
        rounded_down,
        rounded_up,
        table,
    )
    made.filters.update({function.__name__: function for function in own}, form=format)
    made.tests["nan"] = isnan
    made.globals.update(CLOSED=CLOSED, NOTHING=NOTHING, header=header, versions=versions)
    return made
