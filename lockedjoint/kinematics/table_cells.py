"""The cells of a Denavit–Hartenberg table as numbers in metres and radians.

What comes in: the lines of a CSV file. What goes out: a `Row` for each line below the columns'
names. The title of a column states its unit, such as ``a_mm`` or ``alpha_deg``. To let a
column have another unit, change `_METRES` or `_title_of_angle`.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.io.files import real_in
from lockedjoint.kinematics.chain import listed
from lockedjoint.kinematics.tree import Limit
from lockedjoint.nlp.errors import InputError

# A table with more rows is refused: robots that exist have fewer than a hundred.
_MOST_ROWS = 10_000
# Kinds of rows are written in full, or by their first letters.
_KINDS = {"r": "revolute", "p": "prismatic", "f": "fixed"}
# These columns have angles.
_ANGLES = ("theta", "alpha")
# These columns have limits; an empty cell stands for the number beside it.
_RANGES = {"lower": -np.inf, "upper": np.inf, "velocity": 0.0}
# These columns have lengths.
_LENGTHS = ("a", "d")
# The name of a column of lengths may end so: the number says how many metres its unit has.
_METRES = {"": 1.0, "_m": 1.0, "_cm": 0.01, "_mm": 0.001}
# A length beyond this may be in millimetres: a remark says so, and nothing is refused. If it is
# smaller, remarks on large robots are wrong; the sentence below has the number, too.
_FAR_M = 20.0
# An angle beyond this may be in degrees: likewise.
_TURN_RAD = 2 * math.pi


@dataclass(frozen=True)
class Row:
    """A row of the table: metres and radians, and the limits of its joint."""

    kind: str  #: revolute, prismatic or fixed.
    a: float  #: Travel along x, metres.
    d: float  #: Travel along z, metres.
    alpha: float  #: Turn about x, radians.
    theta: float  #: Turn about z, radians.
    joint: str  #: The joint's name; empty if the table does not name it.
    limit: Limit  #: Radians or, of a prismatic joint, metres; velocity per second.


def read_rows(lines: list[str]) -> list[Row]:
    """Return the rows of a table; InputError if a column or a cell is wrong."""
    header, rows = _table(lines)
    titles = {name: _title_of_angle(name, header) for name in (*_ANGLES, *_RANGES)}
    titles |= {name: _title_of_length(name, header) for name in _LENGTHS}
    _check_columns(header, titles, bool(rows))
    if len(rows) > _MOST_ROWS:
        raise InputError("table", f"of {len(rows)} rows", f"at most {_MOST_ROWS} rows")
    return [_row(number, cells, header, titles) for number, cells in enumerate(rows, start=1)]


def remarks_on_units(lines: list[str]) -> Iterator[str]:
    """Yield sentences on numbers of a right table that may be millimetres or degrees."""
    large = _cells_beyond(lines, ("a", "d", "a_m", "d_m"), _FAR_M)
    if large:
        what = "Entries beyond 20 m may be millimetres, which columns a_mm and d_mm state"
        yield f"{what}: {listed(large)}."
    large = _cells_beyond(lines, ("theta_rad", "alpha_rad"), _TURN_RAD)
    if large:
        columns = "columns alpha_deg and theta_deg"
        what = f"Entries beyond a turn (±2π rad) may be degrees, which {columns} state"
        yield f"{what}: {listed(large)}."


def _cells_beyond(lines: list[str], titles: tuple[str, ...], most: float) -> list[str]:
    """Return where numbers in columns of these titles are larger than the largest usual one.

    Each place reads as "a of row 3". Sizes are compared, without their signs.
    """
    header, rows = _table(lines)
    return [
        f"{title} of row {number}"
        for number, row in enumerate(rows, start=1)
        for title, cell in zip(header, row, strict=True)
        if title in titles and abs(real_in(cell)) > most
    ]


def _table(lines: list[str]) -> tuple[list[str], list[list[str]]]:
    """Return the names of columns, and the rows, of lines of a table."""
    # Lines are read one by one, so that no quotation mark joins them.
    texts = [line for line in lines if line.strip() and not line.startswith("#")]
    try:
        header, *rows = (next(csv.reader([text], strict=True)) for text in texts)
    except (csv.Error, ValueError):
        raise InputError("content", "no table", "a line of columns' names, and rows") from None
    return [cell.strip().lower() for cell in header], rows


def _title_of_length(length: str, header: list[str]) -> str:
    """Return the title of a length's column, which may state its unit."""
    titles = [title for title in (length + ending for ending in _METRES) if title in header]
    if len(titles) > 1:
        raise InputError(f"column {length}", "there twice", "one of " + ", ".join(titles))
    return titles[0] if titles else length


def _title_of_angle(angle: str, header: list[str]) -> str:
    """Return the title of an angle's column, or of a limit's, which states its unit."""
    titles = [title for title in (f"{angle}_rad", f"{angle}_deg") if title in header]
    if len(titles) > 1 or (not titles and (angle in header or angle in _ANGLES)):
        shown = "there twice" if titles else "without a unit" if angle in header else "missing"
        raise InputError(f"column {angle}", shown, f"{angle}_rad or {angle}_deg, one of them")
    return titles[0] if titles else angle


def _check_columns(header: list[str], titles: Mapping[str, str], has_rows: bool) -> None:
    """Refuse columns that are unknown, there twice or missing, and a table without rows."""
    for column in header:
        if column not in ("joint", "kind", *titles.values()) or header.count(column) > 1:
            allowed = (
                "kind, a, d (or _m, _cm, _mm), joint, and with _rad or _deg alpha, theta, "
            )
            allowed += ", ".join(_RANGES)
            raise InputError("column", column or "without a name", f"{allowed}, each once")
    missing = [name for name in ("kind", *_LENGTHS) if titles.get(name, name) not in header]
    if missing or not has_rows:
        what = f"without {missing[0]}" if missing else "without rows"
        raise InputError("table", what, "columns kind, a, d, alpha and theta, and rows")


def _row(number: int, texts: list[str], header: list[str], titles: Mapping[str, str]) -> Row:
    """Return a row, whose number counts from 1."""
    if len(texts) != len(header):
        allowed = f"{len(header)} cells, as in the line of columns"
        raise InputError(f"row {number}", f"of {len(texts)} cells", allowed)
    cells = dict(zip(header, (text.strip() for text in texts), strict=True))
    letter_or_kind = cells["kind"].lower()
    kind = _KINDS.get(letter_or_kind, letter_or_kind)
    if kind not in _KINDS.values():
        allowed = "revolute, prismatic or fixed"
        raise InputError(f"kind in row {number}", cells["kind"], allowed)
    values = {name: _cell(cells, number, titles[name]) for name in (*_ANGLES, *_LENGTHS)}
    turns = kind == "revolute"
    limits = {
        name: _cell(cells, number, titles[name], turns, if_empty)
        for name, if_empty in _RANGES.items()
    }
    return Row(kind=kind, joint=cells.get("joint", ""), limit=Limit(**limits), **values)


def _cell(
    cells: Mapping[str, str],
    row: int,
    title: str,
    turns: bool = True,
    if_empty: float | None = None,
) -> float:
    """Return a number of a row, in radians where it turns, or in metres.

    The title states the unit: lengths are multiplied by it, and angles in degrees become
    radians. Limits of a prismatic joint, which does not turn, stay as they are.
    An empty cell is `if_empty`; if that is None, it is refused.
    """
    text = cells.get(title, "")
    if not text and if_empty is not None:
        return if_empty
    try:
        value = real_in(text)
    except ValueError:
        value = math.nan
    if math.isnan(value) or (math.isinf(value) and if_empty is None):
        allowed = "a finite number" if turns else "a finite number, in metres"
        raise InputError(f"{title} in row {row}", text or "empty", allowed)
    if title.startswith(tuple(f"{length}_" for length in _LENGTHS)):
        return value * _METRES[title[1:]]
    return math.radians(value) if turns and title.endswith("_deg") else value
