"""Figures as the content of files: SVG, PNG or PDF, the same bytes each time.

Needs matplotlib (`pip install lockedjoint[figures]`), which is imported on the first figure.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

from nlp.errors import FileError, InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("svg", "png", "pdf")


def figure_class() -> type[Figure]:
    """Return Matplotlib's figures.

    Raises
    ------
    InputError
        If Matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        allowed = "installed, for figures: pip install lockedjoint[figures]"
        raise InputError("matplotlib", "missing", allowed) from None
    return Figure


def kind_of(path: Path) -> str:
    """Return the format that a file's name asks for, one of `FORMATS`.

    Raises
    ------
    FileError
        If its name ends otherwise.
    """
    kind = path.suffix.lower().removeprefix(".")
    if kind not in FORMATS:
        endings = ", ".join(f".{one}" for one in FORMATS)
        raise FileError("file", str(path), f"a name that ends in {endings}")
    return kind


def content(figure: Figure, kind: str) -> bytes:
    """Return a figure as the content of a file.

    Raises
    ------
    InputError
        If the kind is not one of `FORMATS`.
    """
    if kind not in FORMATS:
        raise InputError("kind of figure", kind, ", ".join(FORMATS))
    from matplotlib import rc_context

    written = io.BytesIO()
    undated = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {}}[kind]
    with rc_context({"svg.hashsalt": "lockedjoint", "svg.fonttype": "none"}):
        figure.savefig(written, format=kind, dpi=200, metadata=undated)
    return written.getvalue()
