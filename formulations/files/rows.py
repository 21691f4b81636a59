"""Tables read back as the rows that were written."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from nlp.errors import FileError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Line = TypeVar("Line", bound=DataclassInstance)

# By the annotation of a row's field; an empty cell of numbers is NaN, as it was written.
_READERS: Mapping[str, Callable[[str], Any]] = {
    "str": str,
    "int": int,
    "float": lambda text: float(text or "nan"),
}


def read_rows(path: Path, kind: type[Line]) -> list[Line]:
    """Read a CSV file whose columns are, among others, the fields of a dataclass.

    Parameters
    ----------
    path
        The file.
    kind
        A dataclass of texts and numbers; fields of other types are made from their text as
        `kind` makes them.

    Raises
    ------
    FileError
        If the file cannot be read, a column is missing or a cell is not of its type.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return [_row(line, kind) for line in csv.DictReader(file)]
    except OSError:
        raise FileError("table", str(path), "a file that can be read") from None
    except (KeyError, ValueError, TypeError, csv.Error):
        allowed = f"a table with the columns of this version's {kind.__module__}"
        raise FileError("table", str(path), allowed) from None


def _row(line: Mapping[str, str], kind: type[Line]) -> Line:
    return kind(**{one.name: _value(line[one.name], str(one.type)) for one in fields(kind)})


def _value(text: str, kind: str) -> Any:
    return _READERS.get(kind, str)(text)
