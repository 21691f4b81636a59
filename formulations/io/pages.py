"""Markdown pages: templates beside their studies, filled from the rows of tables."""

from collections.abc import Iterable, Mapping, Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal
from functools import lru_cache
from itertools import groupby
from math import isnan
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from formulations.io.table import Table, header, versions, written

# Below this an isotropy defect, or a residual, is the solver's tolerance and not a number.
NOTHING = 1e-6
# A gap below this, in percent, is none.
_CLOSED = 1e-4


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


def rounded_down(number: float, digits: int = 5) -> str:
    """Return a number with so many decimals that is not above it: still a lower bound."""
    return str(Decimal(number).quantize(Decimal(1).scaleb(-digits), ROUND_FLOOR))


def rounded_up(number: float, digits: int = 5) -> str:
    """Return a number with so many decimals that is not below it: still an upper bound."""
    return str(Decimal(number).quantize(Decimal(1).scaleb(-digits), ROUND_CEILING))


def outward(number: float, digits: int, *, lower: bool) -> str:
    """Return a lower bound rounded down, or an upper one rounded up, to significant digits."""
    decimals = digits - 1 - Decimal(number).adjusted() if number else 0
    text = (rounded_down if lower else rounded_up)(number, decimals)
    return f"{Decimal(text).normalize():f}"


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
    made = Environment(
        loader=FileSystemLoader([folder, Path(__file__).parent]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        # Markdown is of our own numbers, HTML also of what others wrote.
        autoescape=lambda name: name is not None and name.endswith(".html.j2"),
    )
    own = (
        *(aligned, bullets, by, groups, known, listed, outward, prose),
        *(rounded_down, rounded_up, table),
    )
    made.filters.update({function.__name__: function for function in own}, form=format)
    made.tests["nan"] = isnan
    made.globals.update(CLOSED=_CLOSED, NOTHING=NOTHING, header=header, versions=versions)
    return made
