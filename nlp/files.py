"""Files read and written whole, or not at all."""

import json
import os
import stat
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any
from uuid import uuid4

from nlp.errors import FileError

# Files that are read at once are smaller than this.
MOST_BYTES = 200_000_000


def prepare_folder(folder: Path, name: str = "output folder") -> Path:
    """Create the folder if it is not there and make sure that it can be written to.

    Raises
    ------
    FileError
        If it cannot be created or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as reason:
        raise FileError(name, str(folder), f"a folder to write to ({_why(reason)})") from None
    return folder


def read_bytes(path: Path, name: str = "file", most: int = MOST_BYTES) -> bytes:
    """Return the content of a file.

    Raises
    ------
    FileError
        If it cannot be read, is no regular file (a device or a pipe may never end), or has
        more than `most` bytes.
    """
    try:
        about = path.stat()
        if stat.S_ISREG(about.st_mode) or stat.S_ISDIR(about.st_mode):  # reading says why not
            if about.st_size > most:
                raise FileError(name, str(path), f"a file of at most {most} bytes")
            return path.read_bytes()
    except (OSError, ValueError) as reason:
        if isinstance(reason, FileError):
            raise
        why = _why(reason) if isinstance(reason, OSError) else reason
        raise FileError(name, str(path), f"a file that can be read ({why})") from None
    raise FileError(name, str(path), "a regular file")


def load_json(content: bytes, path: Path) -> Any:
    """Return the value of a JSON text; FileError, which names the path, if it is none."""
    try:
        return json.loads(content.decode("utf-8-sig"))  # bytes could be UTF-16, too
    except json.JSONDecodeError as reason:
        why = str(reason)
    except UnicodeDecodeError:
        why = "it is not in UTF-8"
    except (ValueError, RecursionError):
        why = "a number is too long, or it is nested too deeply"
    raise FileError("file", str(path), f"valid JSON ({why})")


def write_text(path: Path, text: str) -> None:
    """Write a file so that readers see the old content or the new, never a part.

    Raises
    ------
    FileError
        If the file cannot be written; nothing is left behind.
    """
    write_bytes(path, text.encode())


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file of bytes; see `write_text`."""
    part = path.with_name(f".{path.name}.{uuid4().hex}")
    try:
        with part.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as reason:
        raise FileError("file", str(path), f"a path to write to ({_why(reason)})") from None
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)  # only still there if something went wrong


def _why(reason: OSError) -> str:
    return (reason.strerror or str(reason)).lower()
