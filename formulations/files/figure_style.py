"""How figures look: colours, letters and lines, in one place for all of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType
from typing import TYPE_CHECKING

from formulations.files.figure import figure_class

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito's colours, told apart by colour-blind readers, and greys.
ORANGE, BLUE, VERMILION, GREEN = "#E69F00", "#0072B2", "#D55E00", "#009E73"
INK, GREY, PALE, PAPER = "#333333", "#7A8087", "#C8CDD2", "#F5F7F9"
# Sizes of letters, in points: of what a figure says, of its parts, of small print.
SAID, PART, SMALL = 11.0, 9.5, 8.0

# Letters are Matplotlib's own, so that files are the same everywhere.
_SETTINGS: Mapping[str, object] = MappingProxyType(
    {
        "font.family": "sans-serif",
        "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial", "sans-serif"],
        "font.size": PART,
        "text.color": INK,
        "axes.edgecolor": GREY,
        "axes.labelcolor": INK,
        "axes.labelsize": PART,
        "axes.linewidth": 0.6,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.titlelocation": "left",
        "axes.titlesize": SAID,
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


@contextmanager
def applied() -> Iterator[None]:
    """Draw in this style, whatever the reader's own settings of Matplotlib are.

    Raises
    ------
    InputError
        If Matplotlib is not installed.
    """
    figure_class()
    from matplotlib import style

    with style.context(["default", dict(_SETTINGS)]):
        yield


def without_frame(axes: Axes, *kept: str) -> None:
    """Hide the lines around axes but those kept: ``left``, ``bottom``; ticks go with them."""
    for side, spine in axes.spines.items():
        spine.set_visible(side in kept)
    if "left" not in kept:
        axes.tick_params(axis="y", length=0)
    if "bottom" not in kept:
        axes.tick_params(axis="x", length=0)
