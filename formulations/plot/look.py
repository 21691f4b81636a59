"""How a user wants figures to look: their size, whether they have a title, a style file.

A `Look` holds for all figures that are drawn and written within `looking`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path

from nlp.errors import FileError, InputError, MissingLibraryError
from nlp.files import real_in

_CM = 2.54
# Least and largest width and height in cm: what can be read, and what memory holds.
_SMALLEST, _LARGEST = 2.0, 100.0


@dataclass(frozen=True)
class Look:
    """How figures look, where that differs from the default.

    Attributes
    ----------
    size
        Width and height in inches; None for each figure's own.
    title
        Whether the title of the whole figure is drawn. Those that tell panels apart stay.
    settings
        Matplotlib's settings over ours, from `read_style`.
    """

    size: tuple[float, float] | None = None
    title: bool = True
    settings: Mapping[str, object] = field(default_factory=dict)


_look: ContextVar[Look] = ContextVar("look", default=Look())  # noqa: B039


def current_look() -> Look:
    """Return the look of this context."""
    return _look.get()


@contextmanager
def looking(look: Look) -> Iterator[None]:
    """Draw and write all figures within this context with this look."""
    before = _look.set(look)
    try:
        yield
    finally:
        _look.reset(before)


def read_size(text: str, argument: str = "--size") -> tuple[float, float]:
    """Read a width and a height: ``16x10`` or ``16x10cm`` in cm, ``6.3x4in`` in inches.

    Returns
    -------
    tuple
        In inches.

    Raises
    ------
    InputError
        If it is something else, or less than 2 cm or more than 100 cm.
    """
    factor = 1.0 if text.endswith("in") else _CM
    parts = text.removesuffix("in" if text.endswith("in") else "cm").split("x")
    try:
        width, height = (real_in(part.strip()) / factor for part in parts)
    except ValueError:
        width = height = float("nan")
    sides = (round(_CM * one, 9) for one in (width, height))
    if not all(_SMALLEST <= one <= _LARGEST for one in sides):
        allowed = "WIDTHxHEIGHT in cm, each 2 to 100, such as 16x10, or in inches: 6.3x4in"
        raise InputError(argument, text, allowed)
    return width, height


def read_style(path: Path, argument: str = "--style") -> Mapping[str, object]:
    """Read the settings of a matplotlib style file.

    Matplotlib itself warns of names that it does not know.

    Parameters
    ----------
    path
        Lines ``name: value``.
    argument
        What errors call it.

    Raises
    ------
    FileError
        If the file cannot be read, or matplotlib does not take a value.
    MissingLibraryError
        If matplotlib is not installed.
    """
    try:
        from matplotlib import rc_params_from_file
    except ImportError:
        raise MissingLibraryError("matplotlib") from None
    try:
        settings = rc_params_from_file(path, fail_on_error=True, use_default_template=False)
        return {str(name): value for name, value in settings.items()}
    except (OSError, ValueError, TypeError, KeyError) as error:
        allowed = f"a style that matplotlib takes ({error})"
        raise FileError(argument, str(path), allowed) from None
