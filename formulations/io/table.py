"""Tables of rows: one definition of the columns for CSV, Markdown, terminal and JSON.

A row is a frozen dataclass of texts, numbers and mappings. Its fields are the columns of the
CSV file. How a field is shown is declared with the field, by the metadata that `column` returns
or `HIDDEN`; a field without either is shown under its own name. Where a table came from is its
header: command, versions, commit, machine and date.
"""

from __future__ import annotations

import csv
import json
import platform
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from enum import StrEnum
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Generic, TypeVar, get_origin, get_type_hints

import numpy as np

from lockedjoint.formulations.io import escaping
from lockedjoint.formulations.io.objects import library
from lockedjoint.nlp.errors import FileError, InputError, printable

if TYPE_CHECKING:
    import pandas as pd
    from _typeshed import DataclassInstance

    Line = TypeVar("Line", bound=DataclassInstance)
else:
    Line = TypeVar("Line")

# What stands for NaN in a table to read.
_DASH = "–"
# Seconds in which git answers, or the header names no commit.
_GIT_SECONDS = 5
# Number of hexadecimal digits of a commit.
_COMMIT_DIGITS = 12
# A cell that counts as a number, or stands in the place of one.
_NUMBER = re.compile(rf"{_DASH}?|(< )?[-+]?\d[\d.]*(e[-+]?\d+)?( %|(/| of )\d+)?")


@dataclass(frozen=True)
class Column:
    """How a field is shown."""

    heading: str = ""  # in place of the field's name
    # Format specification of a number, or a function that makes the cell from the row.
    form: str | Callable[[Any], str] = ".3g"
    scale: float = 1.0  # what a number is multiplied with: 1000 shows seconds as ms
    # In place of an empty text or a count of 0; None shows them. NaN is always a dash.
    empty: str | None = None
    brief: bool = False  # whether it is in the terminal's table
    shown: bool = True  # whether it is in any table but the CSV and the JSON

    def cell(self, row: object, name: str) -> str:
        """Return the text of a row's field."""
        if callable(self.form):
            return self.form(row)
        value = getattr(row, name)
        if self.empty is not None and not value:
            return self.empty
        if isinstance(value, float):
            return _DASH if value != value else format(self.scale * value, self.form)  # NaN
        return str(_stored(value))


def column(*heading_and_form: Any, **settings: Any) -> Mapping[str, Column]:
    """Return the metadata of a dataclass field that is shown as a `Column` says; see there."""
    return {"column": Column(*heading_and_form, **settings)}


#: Metadata of a dataclass field that is in the CSV and the JSON only.
HIDDEN: Mapping[str, Column] = MappingProxyType({"column": Column(shown=False)})


@dataclass(frozen=True)
class Table(Generic[Line]):
    """Rows of one kind, and the forms in which they are written."""

    kind: type[Line]
    rows: Sequence[Line]

    def frame(self) -> pd.DataFrame:
        """Return all columns as a DataFrame; mappings as JSON.

        MissingLibraryError without pandas.
        """
        library("pandas")
        import pandas as pd

        names, types = [field.name for field in fields(self.kind)], get_type_hints(self.kind)
        frame = pd.DataFrame(self._stored(), columns=names)
        return frame.astype({name: "Int64" for name in names if types[name] == _WHOLE_OR_NONE})

    def csv(self, columns: Sequence[str] | None = None) -> str:
        """Return columns, by default all; numbers with every digit, NaN as an empty cell."""
        return escaping.rows_csv(self._stored(), self._named(columns, ["all"]))

    def plain(self) -> list[dict[str, Any]]:
        """Return the rows as plain values for JSON, None in place of NaN."""
        names = [column.name for column in fields(self.kind)]
        return [{name: _plain(getattr(row, name)) for name in names} for row in self.rows]

    def markdown(self, columns: Sequence[str] | None = None) -> str:
        """Return columns, by default those to read, as a Markdown table."""
        return self._written(columns, escaping.markdown_cell)

    def latex(self, columns: Sequence[str] | None = None) -> str:
        """Return columns, by default those to read, as LaTeX for the package booktabs."""
        return escaping.latex(self._written(columns, style="latex_booktabs"))

    def columns(self, every: bool = False) -> dict[str, str]:
        """Return the headings of the columns to read on a terminal, or of every column."""
        columns = self._columns
        some = any(column.brief for column in columns.values())
        return {
            name: column.heading or name.replace("_", " ")
            for name, column in columns.items()
            if every or (column.brief if some else column.shown)
        }

    def cells(self, name: str) -> list[str]:
        """Return a column as text."""
        column = self._columns[name]
        return [column.cell(row, name) for row in self.rows]

    @property
    def _columns(self) -> dict[str, Column]:
        """How each field is shown, by its name."""
        listed = fields(self.kind)
        return {field.name: field.metadata.get("column", Column()) for field in listed}

    def _stored(self) -> list[dict[str, object]]:
        """Return the rows as CSV has them: mappings as JSON."""
        names = [field.name for field in fields(self.kind)]
        return [{name: _stored(getattr(row, name)) for name in names} for row in self.rows]

    def _named(self, columns: Sequence[str] | None, default: Sequence[str]) -> list[str]:
        """Return the names of the columns that are asked for, else of the default."""
        wanted = default if columns is None else columns
        return chosen_names("columns", wanted, self.columns(every=True))

    def _written(
        self,
        wanted: Sequence[str] | None,
        escape: Callable[[str], str] = str,
        style: str = "pipe",
    ) -> str:
        every = self._columns
        to_read = [name for name, column in every.items() if column.shown]
        columns = {name: every[name] for name in self._named(wanted, to_read)}
        cells = [[escape(c.cell(row, k)) for k, c in columns.items()] for row in self.rows]
        heads = [c.heading or k.replace("_", " ") for k, c in columns.items()]
        return written(cells, heads, style)


def chosen_names(
    argument: str, wanted: Sequence[str], headings: Mapping[str, str]
) -> list[str]:
    """Return the names of columns that are asked for, by name or by heading.

    Parameters
    ----------
    argument
        Name of the argument or option that asks.
    wanted
        Names or headings; ``all`` stands for all columns.
    headings
        The heading of each column by its name.

    Raises
    ------
    InputError
        If there is no such column.
    """
    names = {heading: name for name, heading in headings.items()}
    names |= {name: name for name in headings}
    for one in wanted:
        if one != "all" and one not in names:
            raise InputError(argument, one, "all, or some of " + ", ".join(headings))
    return list(headings) if "all" in wanted else [names[one] for one in wanted]


def chosen_rows(table: Table[Line], conditions: Sequence[str]) -> list[Line]:
    """Return the rows that meet conditions of ``pandas.DataFrame.query``, such as ``n == 7``.

    InputError if one is none on the columns of the table, MissingLibraryError if there is one
    but no pandas.
    """
    if not conditions:
        return list(table.rows)
    frame = table.frame()
    for condition in conditions:
        try:
            rows: Any = frame.eval(condition)
            if not np.shape(rows):
                raise TypeError("one value for all rows")
            if len(frame) == 0 and condition.strip() in frame:
                raise TypeError("a column alone")
            frame = frame[rows]
        except Exception as reason:  # pandas raises many kinds
            allowed = f"a comparison of {', '.join(map(str, frame))} ({reason})"
            raise InputError("--where", condition, allowed) from None
    return [table.rows[int(k)] for k in frame.index]


def row_from(kind: type[Line], /, *sources: object, **stated: Any) -> Line:
    """Return a row: a field that is not stated is that of the first source that has it."""
    for name in (field.name for field in fields(kind)):
        having = [source for source in sources if name not in stated and hasattr(source, name)]
        if having:
            stated[name] = getattr(having[0], name)
    return kind(**stated)


def written(
    cells: Sequence[Sequence[str]], heads: Sequence[str], style: str, kept: str = ""
) -> str:
    """Return cells as a table in a style of tabulate, columns of numbers aligned right.

    Control characters are escaped, but for those that are kept, such as line ends.
    """
    from tabulate import tabulate

    cells = [[printable(cell, kept) for cell in row] for row in cells]
    numeric = [all(map(_NUMBER.fullmatch, column)) for column in zip(*cells, strict=True)]
    sides = ["right" if number else "left" for number in numeric] or None
    return str(tabulate(cells, heads, tablefmt=style, colalign=sides, disable_numparse=True))


def read_rows(path: Path, kind: type[Line]) -> list[Line]:
    """Read a CSV file whose columns are, among others, the fields of a dataclass.

    FileError if it cannot be read, a column is missing or a cell is not of its type.
    """
    types = get_type_hints(kind)
    readers = {field.name: _reader(types[field.name]) for field in fields(kind)}
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return [
                kind(**{name: read(line[name]) for name, read in readers.items()})
                for line in csv.DictReader(file)
            ]
    except OSError:
        raise FileError("table", str(path), "a file that can be read") from None
    except (KeyError, ValueError, TypeError, csv.Error):
        allowed = f"a table with the columns of this version's {kind.__module__}"
        raise FileError("table", str(path), allowed) from None


# The type of a whole number that may be missing.
_WHOLE_OR_NONE = int | None


def _reader(kind: Any) -> Callable[[str], Any]:
    """Return what reads a cell of a CSV file as a value of a field's type."""
    if kind is float:
        return lambda text: float(text or "nan")  # an empty cell is NaN, as it was written
    if kind is bool:
        return {"True": True, "False": False}.__getitem__
    if get_origin(kind) is Mapping:
        return json.loads
    if kind == _WHOLE_OR_NONE:
        return lambda text: int(text) if text else None
    return kind if kind is int or issubclass(kind, StrEnum) else str


def _plain(value: object) -> object:
    """Return a value as JSON has it: None in place of NaN."""
    if isinstance(value, float):
        return None if value != value else float(value)
    return dict(value) if isinstance(value, Mapping) else value


def _stored(value: object) -> object:
    """Return a value as CSV has it: a mapping as JSON text."""
    return json.dumps(value) if isinstance(value, Mapping) else value


def provenance() -> Mapping[str, str]:
    """Return what it takes to run this again, in the order to print it.

    The keys are command, versions, commit (in a checkout only), machine and date, YYYY-MM-DD.
    """
    packages, program = versions(("lockedjoint", "casadi", "numpy")), Path(sys.argv[0])
    script = program.suffix == ".py" and program.stem != "__main__"
    arguments = [*(("python", sys.argv[0]) if script else (program.name,)), *sys.argv[1:]]
    commit = _commit()
    return {
        "command": shlex.join(arguments),
        "versions": f"{packages}, Python {platform.python_version()}",
        **({"commit": commit} if commit else {}),
        "machine": f"{_processor()}, {platform.system()} {platform.machine()}",
        "date": datetime.now(UTC).strftime("%Y-%m-%d"),
    }


def header(extra: Mapping[str, object]) -> str:
    """Return the provenance and `extra` as lines of a Markdown list."""
    made = provenance()
    entries = {**made, "command": f"`{made['command']}`", **extra}
    lines = [f"- {name}: {value}" for name, value in entries.items()]
    return "\n".join(lines) + "\n"


def versions(packages: Sequence[str]) -> str:
    """Return the names of packages with the versions that are installed."""
    return ", ".join(f"{name} {_version(name)}" for name in packages)


@lru_cache(maxsize=1)
def _commit() -> str:
    """Return the commit of the checkout that runs, with "changed" if files differ from it.

    Empty where the library is installed, or git is missing.
    """
    top = Path(__file__).resolve().parents[2]
    if not ((top / ".git").exists() and (top / "pyproject.toml").exists()):
        return ""
    words = ("git", "--no-optional-locks", "-C", str(top), "describe", "--always", "--dirty")
    try:
        done = subprocess.run(
            [*words, "--exclude=*", f"--abbrev={_COMMIT_DIGITS}"],
            capture_output=True,
            text=True,
            check=True,
            timeout=_GIT_SECONDS,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip().replace("-dirty", ", changed")


def _version(name: str) -> str:
    """Return the version of a package that is installed, or say that it is not."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "(not installed)"


def _processor() -> str:
    """Return the name of the processor, as the system has it."""
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or "unknown processor"
