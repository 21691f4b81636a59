"""Figures: one style for all of them, and the content of files, the same bytes each time.

Needs matplotlib (the extra `figures`), which is imported on the first figure.
Files are SVG, PNG or PDF. `look` says how a user changes size, title and style.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from formulations.plot.look import Look, current_look
from nlp.errors import FileError, InputError, MissingLibraryError

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
        raise MissingLibraryError("matplotlib") from None
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

    look = current_look()
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
    settings = {**_SETTINGS, **current_look().settings, **_WRITING}
    with style.context(["default", settings]):
        if current_look() == Look():
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
