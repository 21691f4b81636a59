"""Jacobians from files: text, NPY, NPZ or JSON.

A file is read by the reader of its suffix, which returns matrices, each with a name;
`as_jacobian` then checks that each is one: shape (m, n) with n > m, finite. Files may come from
strangers.
"""

import io
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations.io.files import MOST_BYTES, load_json, read_bytes, real_in
from lockedjoint.formulations.measures import as_jacobian
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import FileError, InputError, as_path, printable

#: A Jacobian, shape (m, n), and its name.
Named = tuple[str, FloatArray]
#: A reader makes matrices, each with a name, of a file's path and content.
Reader = Callable[[Path, bytes], list[tuple[str, npt.ArrayLike]]]
# Number of columns up to which a first row 0, 1 or 1, 2 is taken for one of J.
_FEW_COLUMNS = 2
#: How the name of a Jacobian ends that a solver returned, and that is no answer.
NO_ANSWER = ": no answer"


def read_jacobians(path: Path | str) -> list[Named]:
    r"""Read every Jacobian of a file, each with a name.

    Parameters
    ----------
    path
        ``.csv``, ``.tsv`` or ``.txt`` (one row of J per line, numbers separated by commas,
        semicolons, tabs or blanks; comments after ``#`` are left out, and so is a header line,
        which has no number at all),
        ``.npy``, ``.npz`` (one Jacobian an array, by its name), or ``.json`` (rows; an object
        with the key ``jacobian``; or a list of such objects). After ``#`` may stand the number
        of the only one that is wanted, counted from 0: ``jacobians.json#2``.

    Raises
    ------
    FileError
        If the file cannot be read or is not of one of these kinds.
    InputError
        If what it holds is not a Jacobian, or it has none of that number.

    Examples
    --------
    >>> from pathlib import Path
    >>> import lockedjoint as lj
    >>> _ = Path("planar.csv").write_text("1,0,1\n0,1,1\n")
    >>> [(name, jacobian)] = lj.read_jacobians("planar.csv")
    >>> jacobian.shape
    (2, 3)
    """
    path, number = with_number(as_path("path", path))
    _reader(path)  # a wrong name is refused before the file is read
    return numbered(jacobians_in(path, read_bytes(path)), path, number)


def numbered(found: list[Named], path: Path, number: int | None) -> list[Named]:
    """Return the Jacobians of a file, or the one of a number; InputError if there is none."""
    if number is not None and number >= len(found):
        allowed = f"0 to {len(found) - 1}: which of the {len(found)} Jacobians in {path}"
        raise InputError("number of the Jacobian", number, allowed)
    return found if number is None else [found[number]]


def jacobians_in(path: Path, content: bytes) -> list[Named]:
    """Return every Jacobian of the content of a file; see `read_jacobians`."""
    reader = _reader(path)
    if not content.strip():
        raise FileError("file", str(path), "a file that is not empty")
    return [(name, as_jacobian(matrix, str(path))) for name, matrix in reader(path, content)]


def only_jacobian(path: Path) -> Named:
    """Read one Jacobian of a file and its name: the only one, or the one that is numbered.

    Raises
    ------
    InputError
        If the file holds several and no number is given, or none has that number.
    """
    return the_only(read_jacobians(path), path)


def the_only(jacobians: list[Named], path: Path) -> Named:
    """Return the only Jacobian of a file; InputError if there are several."""
    if len(jacobians) > 1:
        many = (
            f"{path}#0 to {path}#{len(jacobians) - 1}, for it holds {len(jacobians)} Jacobians"
        )
        raise InputError("file", str(path), many)
    return jacobians[0]


def is_jacobian_file(path: Path) -> bool:
    """Whether a file has the name of one of Jacobians; a table of a robot may have it, too."""
    return with_number(path)[0].suffix.lower() in _READERS


def _reader(path: Path) -> Reader:
    """Return the reader of a file by its suffix; FileError if there is none."""
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise FileError("file", str(path), "a name that ends in " + ", ".join(_READERS))
    return reader


def with_number(path: Path) -> tuple[Path, int | None]:
    """Return a path without the number that may stand after it, and the number."""
    name, hash_, number = path.name.rpartition("#")
    if hash_ and number.isdecimal() and number.isascii() and not path.exists():
        return path.with_name(name), int(number)
    return path, None


def _read_text(path: Path, content: bytes) -> list[tuple[str, npt.ArrayLike]]:
    """Read a row of J per line; a first line without any number is a header."""
    rows: list[list[float]] = []
    texts: list[list[str]] = []
    try:
        lines = content.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise FileError("file", str(path), "rows of numbers, in UTF-8") from None
    header = False
    for number, line in enumerate(lines, start=1):
        cells = _cells(line.partition("#")[0])
        values = [_value(cell) for cell in cells]
        if not (rows or header) and cells and not any(value is not None for value in values):
            header = True
            continue
        row = [value for value in values if value is not None]
        if len(row) < len(cells):
            cell = cells[values.index(None)]
            allowed = "a number; decimals have a point, or a comma where ; separates"
            allowed += "; a header has no number, and rows have no names"
            raise InputError(f"line {number} of {path}", cell or "an empty cell", allowed)
        if rows and row and len(row) != len(rows[0]):
            allowed = f"{len(rows[0])}, as in the rows before"
            raise InputError(
                f"line {number} of {path}", f"a row of {len(row)} numbers", allowed
            )
        rows += [row] if row else []
        texts += [cells] if row else []
    if not rows:
        raise FileError("file", str(path), "one with rows of numbers")
    if _counts_columns(*texts):
        allowed = "a row of J; put # before numbers of columns, or write 1.0 for a 1 of J"
        raise InputError(f"first row of {path}", ", ".join(texts[0]), allowed)
    return [(path.name, rows)]


def _cells(line: str) -> list[str]:
    """Return the cells of a line, separated by semicolons, else by commas, else by blanks."""
    if ";" in line:
        return [cell.strip().replace(",", ".") for cell in line.split(";")]
    return [cell.strip() for cell in line.split(",")] if "," in line else line.split()


def _counts_columns(first: list[str], *others: list[str]) -> bool:
    """Whether the first row reads 0, 1, 2, … or 1, 2, 3, …, as tables number their columns.

    Small examples may begin so, too, but they have whole numbers in the other rows as well.
    """
    numbered_from = (list(map(str, range(begin, begin + len(first)))) for begin in (0, 1))
    whole = all(cell.lstrip("+-").isdecimal() for cells in others for cell in cells)
    return len(first) > _FEW_COLUMNS and first in numbered_from and not whole


def _value(cell: str) -> float | None:
    """Return the number in a cell, None if there is none."""
    try:
        return real_in(cell)
    except ValueError:
        return None


def _read_numpy(path: Path, content: bytes) -> list[tuple[str, npt.ArrayLike]]:
    """Read the array of an NPY file, or all arrays of an NPZ file by their names."""
    try:
        with np.errstate(all="ignore"):
            loaded = np.load(io.BytesIO(content), allow_pickle=False)
        if isinstance(loaded, np.ndarray):
            return [(path.name, loaded)]
        packed = loaded.zip.infolist()
        if packed and sum(member.file_size for member in packed) <= MOST_BYTES:
            arrays = [(printable(name), loaded[name]) for name in loaded.files]
            if all(isinstance(array, np.ndarray) for _, array in arrays):
                return arrays
    except Exception:  # NumPy and zipfile raise more kinds of them than they document
        pass
    size = f"of at most {MOST_BYTES // 10**6} MB"
    raise FileError("file", str(path), f"arrays as NumPy saves them, without pickles, {size}")


def _read_json(path: Path, raw: bytes) -> list[tuple[str, npt.ArrayLike]]:
    """Read rows of J, an object with the key ``jacobian``, or a list of such objects."""
    content = load_json(raw, path)
    if isinstance(content, dict):
        content = [content]
    if not isinstance(content, list) or not content:
        raise FileError("file", str(path), "rows of numbers, or objects with 'jacobian'")
    if not isinstance(content[0], dict):
        return [(path.name, _numbers(content, path))]
    if not all(
        isinstance(described, dict) and "jacobian" in described for described in content
    ):
        raise InputError(f"an object in {path}", "without it", "the key 'jacobian'")
    return [(_name(described), _numbers(described["jacobian"], path)) for described in content]


def _numbers(rows: Any, path: Path) -> Any:
    """Return rows of numbers; InputError where something else is among them."""
    listed = isinstance(rows, list) and all(isinstance(row, list) for row in rows)
    if not listed or any(type(entry) not in (int, float) for row in rows for entry in row):
        raise InputError(f"a Jacobian in {path}", "something else", "rows of numbers")
    if len({len(row) for row in rows}) != 1:
        raise InputError(f"a Jacobian in {path}", "ragged", "rows of one length")
    return rows


def _name(described: Mapping[str, object]) -> str:
    """Return the name of an object's Jacobian; it ends in `NO_ANSWER` if it is none."""
    parts = (described.get(key) for key in ("formulation", "variant", "model"))
    name = " ".join(str(part) for part in parts if part) or "jacobian"
    verdict = described.get("verdict")  # of `solve` and `compare`: what kind of answer it is
    if not verdict:
        return name
    return f"{name}, {verdict}" if verdict == "solved" else f"{name}, {verdict}{NO_ANSWER}"


_READERS: Mapping[str, Reader] = MappingProxyType(
    {
        **dict.fromkeys((".csv", ".tsv", ".txt"), _read_text),
        **dict.fromkeys((".npy", ".npz"), _read_numpy),
        ".json": _read_json,
    }
)
