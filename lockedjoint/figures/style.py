"""What all figures share: what they are made from, their style, and the content of files.

A figure is made in three steps. `solved` and `reached` solve the problems that it shows.
`styled` gives an empty figure of matplotlib, and the functions below it help to draw. `content`
makes the bytes of an SVG, PNG or PDF file, the same bytes each time. A `Look` is what a user
asks for: size, title and settings of matplotlib. It holds within `looking`.

Sizes of figures are inches, as matplotlib has them; users may give centimetres. Widths of lines
and offsets of texts are points, 1/72 inch. Matplotlib (the extra `figures`) is imported on the
first figure.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from threading import RLock
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

from lockedjoint.nlp.errors import (
    FileError,
    InputError,
    LockedJointError,
    MissingLibraryError,
    of_kind,
    one_of,
    shown,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from lockedjoint.formulations.solving.case import Case
    from lockedjoint.formulations.solving.effort import Effort
    from lockedjoint.formulations.solving.outcome import Outcome

# Formats of files, which are also the endings of their names. Another one needs an entry in
# `content`, too.
_FORMATS = ("svg", "png", "pdf")
# Colours of Okabe and Ito, which colour-blind readers can distinguish.
ORANGE = "#E69F00"
BLUE = "#0072B2"
VERMILION = "#D55E00"
# Greys, from dark to light. The style sheet `figures.mplstyle` has the first two, too: change
# them in both.
INK = "#333333"
GREY = "#7A8087"
PALE = "#C8CDD2"
PAPER = "#F5F7F9"
# Lines that are bounds have these dashes and gaps, in points.
DASHED = (0, (4, 3))
# Small print has this size, which follows `font.size`: a style file sets all sizes at once.
SMALL = "small"
# The largest number of characters of a joint's name. Longer names are cut, as labels beside
# the axes would leave no room for the panel.
_LONGEST_LABEL = 40
# A figure lower than this, in inches, has room for less: see `is_low`.
_LOW_INCHES = 3.2
# The resolution of PNG files, and of the parts of others that are pixels, in dots per inch. A
# larger one gives sharper and larger files.
_DOTS_PER_INCH = 200

# Our settings of matplotlib.
_SHEET = Path(__file__).with_name("figures.mplstyle")
# PDF files carry their fonts as TrueType, which publishers ask for; SVG files their text as
# text.
_WRITING = {"svg.hashsalt": "lockedjoint", "svg.fonttype": "none", "pdf.fonttype": 42}

# The lock of the thread that draws, see `_style`.
_ONE_AT_A_TIME = RLock()
# The number of centimetres in an inch.
_CM_PER_INCH = 2.54
# The least width and height that can be read, in centimetres. Error messages state it.
_SMALLEST_CM = 2.0
# The largest width and height that memory holds, in centimetres. Error messages state it.
_LARGEST_CM = 100.0
# The number of decimals to which sides are rounded before they are compared with these limits:
# 0.787… inches, computed from 2 cm, are then 2 cm.
_CM_DECIMALS = 9


@dataclass(frozen=True, eq=False)
class Picture:
    """A figure, and the numbers that it shows."""

    figure: Figure
    #: Lines of a table, by the names of columns: plain values, None for missing ones. The
    #: header of each figure's file says which columns there are.
    rows: list[dict[str, Any]]


class NothingFoundError(LockedJointError):
    """No start led to a Jacobian that passes the gate."""

    exit_status = 1


def solved(case: Case, effort: Effort) -> Outcome:
    """Solve a case from all starts, from one if the effort names no number.

    KeyboardInterrupt if the user interrupted.
    """
    from lockedjoint.formulations.solving.solve import run

    effort.progress(case.name)
    outcome = run(case, starts=effort.starts or 1, seed=effort.seed, workers=effort.workers)
    if not outcome.complete:
        raise KeyboardInterrupt
    return outcome


def reached(case: Case, effort: Effort) -> Outcome:
    """Solve a case as `solved` does; NothingFoundError if no start passes the gate."""
    outcome = solved(case, effort)
    if not outcome.reached:
        message = f"No start of {case.name} passes the check; ask for more starts."
        raise NothingFoundError(message)
    return outcome


@dataclass(frozen=True)
class Look:
    """How figures look, where that differs from the default."""

    #: Width and height in inches; None for the size that each figure has of its own.
    size: tuple[float, float] | None = None
    #: Whether the title of the whole figure is drawn. Titles that tell panels apart stay.
    title: bool = True
    #: Matplotlib's settings by name, which take the place of ours.
    settings: Mapping[str, object] = field(default_factory=dict)


# The look that holds now, in this thread; see `looking`.
_LOOK: ContextVar[Look] = ContextVar("look", default=Look())  # noqa: B039


@contextmanager
def looking(look: Look) -> Iterator[None]:
    """Draw and write all figures within this context with this look."""
    token = _LOOK.set(look)
    try:
        yield
    finally:
        _LOOK.reset(token)


def read_look(
    size: str | None, title: bool, style: str | Path | None, prefix: str = ""
) -> Look:
    """Read how a user wants figures to look; `prefix` begins the arguments' names in errors.

    The size is ``16x10`` or ``16x10cm`` for width and height in cm, ``6.3x4in`` for inches,
    each of 2 to 100 cm; a matplotlib style file has lines ``name: value``. InputError or
    FileError if one is something else, MissingLibraryError if a style needs matplotlib.
    """
    inches = None if size is None else _inches(size, f"{prefix}size")
    return Look(inches, title, {} if style is None else _settings(style, f"{prefix}style"))


def read_style(path: str | Path, argument: str) -> Look:
    """Read how figures look from a style file of matplotlib.

    Its ``figure.figsize`` is the size of a figure in inches, each side of 2 to 100 cm, and with
    ``figure.titlesize: 0`` there is no title of the whole figure. InputError or FileError if it
    has something else, MissingLibraryError without matplotlib.
    """
    settings = dict(_settings(path, argument))
    size: Any = settings.pop("figure.figsize", None)
    title = settings.get("figure.titlesize") != 0
    if not title:
        del settings["figure.titlesize"]
    if size is not None:
        width, height = (float(side) for side in size)
        if not _is_allowed(width, height):
            allowed = "each side 2 to 100 cm, which is 0.8 to 39.3 inches"
            raise InputError("figure.figsize", f"{width:g}, {height:g}", allowed)
        size = width, height
    return Look(size, title, settings)


def _is_allowed(width: float, height: float) -> bool:
    """Whether a width and a height, in inches, are from `_SMALLEST_CM` to `_LARGEST_CM`."""
    sides_cm = [round(_CM_PER_INCH * side, _CM_DECIMALS) for side in (width, height)]
    return all(_SMALLEST_CM <= side <= _LARGEST_CM for side in sides_cm)


def _inches(text: str, argument: str) -> tuple[float, float]:
    """Read a width and a height such as ``16x10cm``, in inches; else InputError."""
    number = r"\s*(\d+\.?\d*|\.\d+)\s*"
    of_kind(argument, text, str, "WIDTHxHEIGHT as text, such as 16x10")
    match = re.fullmatch(rf"{number}x{number}(cm|in)?", text, re.ASCII)
    factor = 1.0 if match and match[3] == "in" else _CM_PER_INCH
    width, height = (float(side) / factor for side in match.groups()[:2]) if match else (0, 0)
    if not _is_allowed(width, height):
        allowed = "WIDTHxHEIGHT in cm, each 2 to 100, such as 16x10, or in inches: 6.3x4in"
        raise InputError(argument, text, allowed)
    return width, height


def _settings(path: str | Path, argument: str) -> Mapping[str, object]:
    """Read the settings of a style file by name; FileError if matplotlib refuses one."""
    figure_class()  # raises MissingLibraryError without matplotlib
    from matplotlib import colormaps, rc_params_from_file, rcParams

    try:
        # Matplotlib passes over lines that it does not understand, with a warning.
        lines = Path(path).read_text(encoding="utf-8").splitlines()
        keys = [line.partition("#")[0].partition(":")[0].strip() for line in lines]
        for key in (key for key in keys if key and key not in rcParams):
            raise ValueError(f"{key} is no setting")
        settings = rc_params_from_file(path, fail_on_error=True, use_default_template=False)
        if (name := settings.get("image.cmap")) is not None and name not in colormaps:
            raise ValueError(f"image.cmap is {name}, which is no colormap")
        return {str(name): value for name, value in settings.items()}
    except (OSError, ValueError, TypeError, KeyError) as error:
        allowed = f"a style that matplotlib takes ({shown(str(error))})"
        raise FileError(argument, str(path), allowed) from None


def figure_class() -> type[Figure]:
    """Return Matplotlib's class of figures; MissingLibraryError if it is not installed."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingLibraryError("matplotlib") from None
    return Figure


@contextmanager
def _style(**more: object) -> Iterator[None]:
    """Set matplotlib: ours over its own settings, the user's style over ours, `more` over all.

    The settings are those of the whole process. Only one thread at a time changes them, so that
    none draws with those of another, and the user's own are there again in the end.
    """
    from matplotlib import style

    with _ONE_AT_A_TIME, style.context(["default", _SHEET, {**_LOOK.get().settings, **more}]):
        yield


@contextmanager
def styled(width: float, height: float) -> Iterator[Figure]:
    """Give a new figure to draw on, in this style whatever the user's own settings are.

    Width and height are in inches; a size of the `Look` takes their place. Its title is wrapped
    at the end, or taken away if the look has none: the title of the figure or, without one, of
    its only panel.
    """
    new_figure, look = figure_class(), _LOOK.get()
    with _style():
        figure = new_figure(figsize=look.size or (width, height))
        yield figure
        title = figure.get_suptitle()
        if title and look.title:
            figure.suptitle(title, wrap=True)
        elif title:
            figure.suptitle("").set_in_layout(False)
        elif len(figure.axes) == 1:
            axes = figure.axes[0]
            axes.set_title(axes.get_title("left") if look.title else "", wrap=True)


#: Properties of a text of strangers, which is drawn as it is: neither mathtext nor LaTeX.
LITERAL: Mapping[str, Any] = MappingProxyType({"parse_math": False, "usetex": False})


def label(name: str) -> str:
    """Return a name of strangers in printable characters, cut to `_LONGEST_LABEL`."""
    return shown(name, _LONGEST_LABEL) if name else ""


def is_low(figure: Figure) -> bool:
    """Whether a figure is so low, as in a column of a paper, that it has room for little."""
    return float(figure.get_figheight()) < _LOW_INCHES


def beside(
    axes: Axes, point: tuple[float, float], text: str, by: tuple[float, float], colour: str
) -> None:
    """Write text above or below a point of the data.

    The text is moved to the right and upwards by two lengths, `by`, in points: it stands above
    if the second is positive.
    """
    where: dict[str, Any] = {"xytext": by, "textcoords": "offset points"}
    axes.annotate(text, point, va="bottom" if by[1] > 0 else "top", color=colour, **where)


def legend(
    figure: Figure, colours: Mapping[str, str], columns: int, above: bool = False
) -> None:
    """Explain colours, by their meanings, in some columns below or above all panels."""
    from matplotlib.patches import Patch

    patches = [Patch(color=colour, label=name) for name, colour in colours.items()]
    place: Literal["outside upper center", "outside lower center"]
    place = "outside upper center" if above else "outside lower center"
    figure.legend(handles=patches, loc=place, ncols=columns)


def kind_of(path: Path) -> str:
    """Return the format that a file's name asks for, one of `_FORMATS`; else FileError."""
    kind = path.suffix.lower().removeprefix(".")
    if kind not in _FORMATS:
        endings = ", ".join(f".{form}" for form in _FORMATS)
        raise FileError("file", str(path), f"a name that ends in {endings}")
    return kind


def content(figure: Figure, kind: str) -> bytes:
    """Return a figure as the content of a file of one of the `_FORMATS`.

    InputError if it cannot be drawn in its size or with the settings of a style file.
    """
    one_of("kind of figure", kind, _FORMATS)
    written = io.BytesIO()
    # Dates would make the bytes differ each time.
    undated: Any = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {}}[kind]
    # Names of fonts are resolved when a file is written: the settings are those of drawing.
    with _style(**_WRITING), warnings.catch_warnings():
        warnings.filterwarnings("error", "constrained_layout not applied")
        # Names may be in any script; a box is drawn where the font has none of it.
        warnings.filterwarnings("ignore", "Glyph .* missing from")
        try:
            figure.savefig(written, format=kind, dpi=_DOTS_PER_INCH, metadata=undated)
        except UserWarning:
            allowed = "a size and a style with room for the panels beside their text"
            raise InputError("size of the figure", "too small", allowed) from None
        except (ValueError, RuntimeError, OverflowError) as error:
            if not _LOOK.get().settings:
                raise
            allowed = f"settings with which the figure can be drawn ({error})"
            raise InputError("style of the figure", "given", allowed) from None
    return _with_columns(written.getvalue()) if kind == "svg" else written.getvalue()


def _with_columns(svg: bytes) -> bytes:
    """Return an SVG file whose texts keep their blanks, so that columns stay in place."""
    rule = b'<style type="text/css">'
    return svg.replace(rule, rule + b"text{white-space: pre} ", 1)
