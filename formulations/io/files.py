"""Files: read within a limit, written whole or not at all, and refused before any work."""

import csv
import json
import os
import re
import stat
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import Any, TypeVar
from uuid import uuid4

from lockedjoint.formulations.io.escaping import csv_cell
from lockedjoint.nlp.errors import FileError

Target = TypeVar("Target", Path, Path | None)

# The first bytes of a store of records, an SQLite file.
_SQLITE = b"SQLite format 3\0"
#: The largest number of bytes of a file that is read at once.
MOST_BYTES = 200_000_000
# Number of characters of a file's name that its unfinished copy keeps: names have 255 at most.
_KEPT_CHARACTERS = 100
# Numbers in a text: `int` and `float` would take underscores and digits of other scripts, too.
_WHOLE = re.compile(r"\s*[+-]?[0-9]{1,30}\s*", re.ASCII)
_REAL = re.compile(
    r"\s*[+-]?(([0-9]+([.][0-9]*)?|[.][0-9]+)(e[+-]?[0-9]+)?|inf|infinity|nan)\s*",
    re.ASCII | re.IGNORECASE,
)


def prepare_folder(folder: Path, name: str = "output folder") -> Path:
    """Create a folder if it is not there; FileError if it cannot be written to."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as reason:
        raise FileError(name, str(folder), f"a folder to write to ({_why(reason)})") from None
    return folder


def prepare_file(
    path: Target, name: str = "--out", inputs: Iterable[Path | None] = ()
) -> Target:
    """Make sure, before any work, that a file can be written; create its folder if missing.

    None if nothing is to be written. A symbolic link stands for its target, also if that does
    not exist. FileError if it is one of the `inputs`, files that the same command reads or
    writes, if it is a folder or a store of records, or if it cannot be written to.
    """
    if path is None:
        return path
    target = _destination(path, name)
    if _is_special(target):
        return path
    for other in inputs:
        if other is not None and _same(target, other):
            raise FileError(name, str(path), f"another file than {other}, which is in use")
    if target.exists() and not os.access(target, os.W_OK):
        raise FileError(name, str(path), "a file that is not write-protected")
    prepare_folder(target.parent, f"folder of {name}")
    return path


def read_bytes(path: Path, name: str = "file", most: int = MOST_BYTES) -> bytes:
    """Return the content of a file.

    FileError if it cannot be read, is no regular file (a device or a pipe may never end), or
    has more than `most` bytes.
    """
    try:
        about = path.stat()
        if not (stat.S_ISREG(about.st_mode) or stat.S_ISDIR(about.st_mode)):
            allowed = "a regular file"
        elif about.st_size > most:
            allowed = f"a file of at most {most} bytes"
        else:
            return path.read_bytes()  # of a folder it says why not
    except (OSError, ValueError) as reason:
        allowed = f"a file that can be read ({_why(reason)})"
    raise FileError(name, str(path), allowed)


def load_json(content: bytes, path: Path) -> Any:
    """Return the value of a JSON text; FileError, which names the path, if it is none."""

    def distinct(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        """Return an object of JSON; KeyError if a key is given twice."""
        values = dict(pairs)
        if len(values) < len(pairs):
            raise KeyError
        return values

    try:
        text = content.decode("utf-8-sig")  # bytes could be UTF-16, too
        return json.loads(text, object_pairs_hook=distinct)
    except KeyError:
        why = "a key is given twice in one object"
    except json.JSONDecodeError as reason:
        why = str(reason)
    except UnicodeDecodeError:
        why = "it is not in UTF-8"
    except (ValueError, RecursionError):
        why = "a number is too long, or it is nested too deeply"
    raise FileError("file", str(path), f"valid JSON ({why})")


def whole_in(text: str) -> int:
    """Return the whole number that a text is, of at most 30 digits; ValueError if none."""
    if not _WHOLE.fullmatch(text):
        raise ValueError("no whole number")
    return int(text)


def real_in(text: str) -> float:
    """Return the number that a text is, NaN and infinity included; ValueError if none."""
    if not _REAL.fullmatch(text):
        raise ValueError("no number")
    return float(text)


def csv_text(lines: Iterable[Iterable[object]]) -> str:
    """Return lines of a table as CSV, without formulas: see `escaping.csv_cell`."""
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([csv_cell(cell) for cell in line] for line in lines)
    return text.getvalue()


def write_text(path: Path, text: str) -> None:
    """Write a file so that readers see the old content or the new, never a part.

    The target of a symbolic link is replaced, and the link kept. Devices and pipes are written
    to as they are. FileError if the file cannot be written; nothing is left behind.
    """
    write_bytes(path, text.encode())


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file of bytes; see `write_text`."""
    target = _destination(path, "file")
    special = _is_special(target)
    unfinished = f".{target.name[:_KEPT_CHARACTERS]}.{uuid4().hex}"
    part = target if special else target.with_name(unfinished)
    try:
        with part.open("wb" if special else "xb") as file:
            file.write(content)
            if not special:
                file.flush()
                os.fsync(file.fileno())
        if not special:
            part.replace(target)
    except OSError as reason:
        raise FileError("file", str(path), f"a path to write to ({_why(reason)})") from None
    finally:
        if not special:
            with suppress(OSError):
                part.unlink(missing_ok=True)  # it is there only if something went wrong


def write_json(path: Path, values: object) -> None:
    """Write values as JSON; see `write_text`."""
    write_text(path, json.dumps(values, indent=1) + "\n")


def _destination(path: Path, name: str) -> Path:
    """Return the file that a path leads to; FileError if it must not be replaced."""
    try:
        target = Path(os.path.realpath(path))  # it fails if the working folder is gone
        with suppress(FileNotFoundError):
            target.stat()
    except (OSError, ValueError) as reason:
        raise FileError(name, str(path), f"a path to write to ({_why(reason)})") from None
    if target.is_dir():
        raise FileError(name, str(path), "a file to write to, not a folder")
    if _is_store(target):
        raise FileError(name, str(path), "a file that is not a store of records")
    return target


def _is_special(path: Path) -> bool:
    """Whether a path is a device, a pipe or a socket, in whose place no file is put."""
    return path.exists() and not path.is_file()


def _is_store(path: Path) -> bool:
    """Whether a file is a store, which may hold hours of solving."""
    if not path.is_file():  # a pipe would block
        return False
    try:
        with path.open("rb") as file:
            return file.read(len(_SQLITE)) == _SQLITE
    except OSError:
        return False


def _same(path: Path, other: Path) -> bool:
    """Whether two paths lead to one file, also to one that does not exist yet."""
    try:
        return path.samefile(other)
    except (OSError, ValueError):  # one of them does not exist: same name, or different files
        return path == Path(os.path.realpath(other))


def _why(reason: OSError | ValueError) -> str:
    """Return in words what the system says of a file."""
    return (getattr(reason, "strerror", None) or str(reason)).lower()
