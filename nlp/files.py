"""Files read and written whole, or not at all."""

import os
import tempfile
from contextlib import suppress
from pathlib import Path
from uuid import uuid4

from nlp.errors import FileError


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


def read_bytes(path: Path, name: str = "file", largest: int | None = None) -> bytes:
    """Return the content of a file; FileError if it cannot be read or has too many bytes."""
    try:
        with path.open("rb") as file:
            content = file.read(-1 if largest is None else largest + 1)
    except OSError as reason:
        allowed = f"a file that can be read ({_why(reason)})"
        raise FileError(name, str(path), allowed) from None
    if largest is not None and len(content) > largest:
        raise FileError(name, str(path), f"a file of at most {largest} bytes")
    return content


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
