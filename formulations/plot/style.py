"""Figures: one style for all of them, and the content of files, the same bytes each time.

Needs matplotlib (the extra `figures`), which is imported on the first figure.
Files are SVG, PNG or PDF. A `Look` changes size, title and style of all figures that are drawn
within `looking`.
"""

from __future__ import annotations

import ast
import io
import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from nlp.errors import FileError, InputError, MissingLibraryError
from nlp.files import read_bytes, real_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = ("svg", "png", "pdf")
# Okabe and Ito's colours, which colour-blind readers can distinguish, and greys.
ORANGE, BLUE, VERMILION = "#E69F00", "#0072B2", "#D55E00"
INK, GREY, PALE, PAPER = "#333333", "#7A8087", "#C8CDD2", "#F5F7F9"
# Font sizes in points: of titles, of labels, of small print.
TITLE, LABEL, SMALL = 11.0, 9.5, 8.0

# The font comes with Matplotlib, so that files are the same everywhere.
_SETTINGS: Mapping[str, object] = MappingProxyType(
    {
        "font.family": "sans-serif",
        "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial", "sans-serif"],
        "font.size": LABEL,
        "text.color": INK,
        "axes.edgecolor": GREY,
        "axes.labelcolor": INK,
        "axes.labelsize": LABEL,
        "axes.linewidth": 0.6,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.titlelocation": "left",
        "axes.titlesize": TITLE,
        "axes.titlecolor": INK,
        "xtick.color": GREY,
        "ytick.color": GREY,
        "xtick.labelcolor": INK,
        "ytick.labelcolor": INK,
        "xtick.labelsize": SMALL,
        "ytick.labelsize": SMALL,
        "xtick.major.width": 0.6,
        "ytick.major.width": 0.6,
        "xtick.major.size": 3.0,
        "ytick.major.size": 3.0,
        "figure.constrained_layout.use": True,
    }
)

# PDF files carry their fonts as TrueType, which publishers ask for; SVG files their text as
# text.
_WRITING: Mapping[str, object] = MappingProxyType(
    {"svg.hashsalt": "lockedjoint", "svg.fonttype": "none", "pdf.fonttype": 42}
)
_CM = 2.54
# Least and largest width and height in cm: what can be read, and what memory holds.
_SMALLEST, _LARGEST = 2.0, 100.0
# Groups of settings that a style file may change: how a figure looks, never what is run or
# opened. `text.usetex` would run LaTeX.
_LOOKS = re.compile(
    r"(axes|axes3d|polaraxes|font|grid|hatch|image|legend|lines|markers|mathtext|patch|scatter"
    r"|errorbar|hist|xtick|ytick|figure\.(facecolor|edgecolor|titlesize|titleweight|labelsize"
    r"|labelweight|constrained_layout)|text\.color)\b"
)
_MOST_STYLE = 100_000  # bytes
_LITERAL = (
    *(ast.Expression, ast.Call, ast.keyword, ast.List, ast.Tuple, ast.Constant),
    *(ast.BinOp, ast.Add, ast.Load),
)


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


def read_style(path: Path, argument: str = "--style") -> tuple[dict[str, object], list[str]]:
    """Read a matplotlib style file, as data: nothing in it is run, and no file is opened.

    Parameters
    ----------
    path
        Lines ``name: value``.
    argument
        What errors call it.

    Returns
    -------
    settings
        Those that say how a figure looks.
    left_out
        Names of the others, such as ``savefig.dpi`` and ``text.usetex``; sorted.

    Raises
    ------
    InputError
        If the file cannot be read, matplotlib does not know a setting or its value, or is
        missing.
    """
    figure_class()
    from matplotlib import RcParams, rcParamsDefault

    settings: dict[str, object] = {}
    left_out: set[str] = set()
    try:
        lines = read_bytes(path, argument, _MOST_STYLE).decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise FileError(argument, str(path), "a text in UTF-8") from None
    for number, line in enumerate(lines, 1):
        # A '#' in quotation marks is a colour, else a comment, as matplotlib reads it.
        name, colon, value = (
            part.strip()
            for part in re.sub(r"""((["']).*?\2)|#.*""", r"\1", line).partition(":")
        )
        if not (name or colon):
            continue
        where = f"line {number} of {path}: {name}"
        if not colon or name not in rcParamsDefault:
            raise FileError(argument, where, "settings of matplotlib, one NAME: VALUE a line")
        if not _LOOKS.match(name):
            left_out.add(name)
            continue
        if len(value) > 1 and value[0] == value[-1] and value[0] in "\"'":
            value = value[1:-1]
        if name == "axes.prop_cycle" and not _is_literal_cycle(value):
            raise FileError(argument, where, "cycler(NAME, [VALUE, …]) without other code")
        try:
            settings |= {str(known): one for known, one in RcParams({name: value}).items()}
        except (ValueError, TypeError, KeyError):
            raise FileError(argument, where, "a value that matplotlib takes") from None
    return settings, sorted(left_out)


def _is_literal_cycle(text: str) -> bool:
    """Whether it is a sum of calls of ``cycler`` with literals: matplotlib evaluates it."""
    try:
        nodes = list(ast.walk(ast.parse(text.strip(), mode="eval")))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return False
    names = [node for node in nodes if isinstance(node, ast.Name)]
    called = [node.func for node in nodes if isinstance(node, ast.Call)]
    return (
        len(text) < 2000
        and all(isinstance(node, (*_LITERAL, ast.Name)) for node in nodes)
        and all(node.id == "cycler" and node in called for node in names)
        and bool(names)
    )


def figure_class() -> type[Figure]:
    """Return Matplotlib's class of figures.

    Raises
    ------
    MissingLibraryError
        If Matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingLibraryError("matplotlib", "figures") from None
    return Figure


@contextmanager
def styled(width: float, height: float) -> Iterator[Figure]:
    """Give a new figure to draw on, in this style whatever the user's own settings are.

    Parameters
    ----------
    width, height
        In inches, unless `looking` asks for others.

    Raises
    ------
    MissingLibraryError
        If Matplotlib is not installed.
    """
    new_figure = figure_class()
    from matplotlib import style

    look = _look.get()
    with style.context(["default", dict(_SETTINGS), dict(look.settings)]):
        figure = new_figure(figsize=look.size or (width, height))
        yield figure
        if not look.title:
            _untitle(figure)


def _untitle(figure: Figure) -> None:
    """Take away the title of the whole figure, and the room that it takes."""
    if figure.get_suptitle():
        figure.suptitle("").set_in_layout(False)
    elif len(figure.axes) == 1:
        for side in ("left", "center", "right"):
            figure.axes[0].set_title("", loc=side)


def without_frame(axes: Axes, *kept: str) -> None:
    """Hide the lines around axes but those kept: ``left``, ``bottom``; ticks go with them."""
    for side, spine in axes.spines.items():
        spine.set_visible(side in kept)
    if "left" not in kept:
        axes.tick_params(axis="y", length=0)
    if "bottom" not in kept:
        axes.tick_params(axis="x", length=0)


def beside(
    axes: Axes, point: tuple[float, float], text: str, by: tuple[float, float], **style: Any
) -> None:
    """Write text beside a point of the data, on the side that it is moved to.

    Parameters
    ----------
    axes, point, text
        Where, and what.
    by
        How far the text is moved to the right and up, in points.
    style
        Other properties of the text, as Matplotlib names them.
    """
    right, up = by
    aligned: dict[str, Any] = {
        "ha": "right" if right < 0 else "left",
        "va": "bottom" if up > 0 else "top" if up < 0 else "center",
    }
    axes.annotate(text, point, xytext=by, textcoords="offset points", **{**aligned, **style})


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
        If the kind is not one of `FORMATS`, or the figure cannot be drawn with the settings of
        a style file.
    """
    if kind not in FORMATS:
        raise InputError("kind of figure", kind, ", ".join(FORMATS))
    from matplotlib import style

    written = io.BytesIO()
    undated = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {}}[kind]
    # Names of fonts are resolved when a file is written: the settings are those of drawing.
    settings = {**_SETTINGS, **_look.get().settings, **_WRITING}
    with style.context(["default", settings]):
        if _look.get() == Look():
            figure.savefig(written, format=kind, dpi=200, metadata=undated)
        else:
            _saved_as_asked(figure, written, format=kind, dpi=200, metadata=undated)
    return written.getvalue()


def _saved_as_asked(figure: Figure, written: io.BytesIO, **settings: Any) -> None:
    """Save a figure; refuse a size or a style with which it cannot be drawn."""
    with warnings.catch_warnings():
        warnings.filterwarnings("error", "constrained_layout not applied")
        try:
            figure.savefig(written, **settings)
        except UserWarning:
            allowed = "a --size and a --style with room for the panels beside their text"
            raise InputError("size of the figure", "too small", allowed) from None
        except (ValueError, RuntimeError, OverflowError) as error:
            allowed = f"settings with which the figure can be drawn ({error})"
            raise InputError("--style", "given", allowed) from None
