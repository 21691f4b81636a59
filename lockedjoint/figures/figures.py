"""Figures of values of the library, and figures by name, with what each is made from.

`FIGURES` has the figures of ``lockedjoint figure`` by name: each solves problems, or takes what
is given, and draws. `plot` draws a value that a user has: `_figure` chooses the function by the
value's type. To add a figure, write a function of an `Effort` that returns a `Picture`, or one
of a value that returns matplotlib's figure, in a file of this folder, and name it here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import singledispatch
from pathlib import Path
from typing import TYPE_CHECKING

from lockedjoint.figures import arms, manipulator, optima, robots, singular_values
from lockedjoint.figures.style import (
    Look,
    Picture,
    content,
    figure_class,
    kind_of,
    looking,
    read_look,
)
from lockedjoint.formulations.io.files import prepare_file, write_bytes
from lockedjoint.formulations.io.objects import Brief
from lockedjoint.formulations.measures.assessment import Assessment, measure
from lockedjoint.formulations.solving.outcome import Outcome, Record
from lockedjoint.nlp.errors import InputError, as_path, of_kind
from lockedjoint.paths.plan import PathPlan
from lockedjoint.robots.robot_assessment import RobotAssessment
from lockedjoint.synthesis.manipulator import Manipulator
from lockedjoint.workspaces.kept_cubes import KeptCubes
from lockedjoint.workspaces.workspace import Workspace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class FigureKind:
    """A kind of figure."""

    #: Computes the numbers with an `Effort`, and draws them.
    make: Callable[..., Picture]
    #: Number of random starts of each problem, if the user names none.
    starts: int
    #: Name of the argument of `make` that is shown instead of solving, ``jacobian`` or
    #: ``store``; empty if there is none.
    takes: str = ""


#: Figures by name. More starts take longer, and may find better answers; figure-3 needs them to
#: find members of a family near to eight angles, and optima to count where they end.
FIGURES: Mapping[str, FigureKind] = {
    "figure-1": FigureKind(arms.figure_1, 5),
    "figure-3": FigureKind(arms.figure_3, 100),
    "seven-axes": FigureKind(arms.seven_axes, 5, "jacobian"),
    "singular-values": FigureKind(singular_values.make, 5, "jacobian"),
    "trade-off": FigureKind(optima.trade_off, 5),
    "optima": FigureKind(optima.make, 50, "store"),
}


@dataclass(frozen=True, eq=False, repr=False)
class Plot(Brief):
    """A figure that notebooks show and `save` writes.

    Attributes
    ----------
    figure
        Matplotlib's figure.
    look
        The size, title and settings that were asked for.
    """

    figure: Figure
    look: Look

    def save(self, file: str | Path) -> Path:
        """Write the figure: SVG, PNG, or PDF with TrueType fonts, by the file's name.

        Raises
        ------
        FileError
            If the name ends otherwise, or the file cannot be written.
        """
        target = prepare_file(as_path("file", file), "file")
        with looking(self.look):
            drawn = content(self.figure, kind_of(target))
        write_bytes(target, drawn)
        return target

    def _repr_svg_(self) -> str:
        """Return the figure as notebooks show it."""
        with looking(self.look):
            return content(self.figure, "svg").decode()


def plot(
    value: object,
    *,
    size: str | None = None,
    title: bool = True,
    style: str | Path | None = None,
    ax: Axes | None = None,
) -> Plot:
    """Draw a value where a picture says more than numbers.

    Parameters
    ----------
    value
        An `Assessment`, a `RobotAssessment` or a `Record`: what each failure leaves, as bars.
        An `Outcome`: where its starts end. A `Manipulator`: the arm in space, from two sides.
        A `PathPlan` or a `Workspace`: as their commands draw them.
    size
        Width and height: ``"16x10"`` in cm, ``"6.3x4in"`` in inches.
    title
        Whether the title of the whole figure is drawn.
    style
        A matplotlib style file.
    ax
        Matplotlib's axes, to draw there in the style of their figure instead of on a new
        figure; of an `Assessment`, a `RobotAssessment` or a `Record` alone, and without a size
        and a style.

    Returns
    -------
    Plot
        Notebooks show it; ``.save("figure.pdf")`` writes it; ``.figure`` is Matplotlib's.

    Raises
    ------
    InputError
        If there is no figure of such a value, an argument is not allowed, or Matplotlib is
        missing.
    NothingFoundError
        If no start of an outcome passes the check.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.plot(lj.measure([[1, 0, 1], [0, 1, 1]]), size="8x6").save("bars.pdf").name
    'bars.pdf'
    """
    figure_class()
    of_kind("title", title, bool, "true or false")
    look = read_look(size, title, style)
    if ax is not None:
        return Plot(_on_axes(ax, value, look), look)
    with looking(look):
        return Plot(_figure(value), look)


def _on_axes(axes: Axes, value: object, look: Look) -> Figure:
    """Draw a value on a user's axes and return their figure; InputError if that cannot be."""
    measured = measure(value.jacobian) if isinstance(value, Record) else value
    if not isinstance(measured, Assessment | RobotAssessment):
        allowed = "none but for an Assessment, a RobotAssessment or a Record"
        raise InputError("ax", f"given with a value of type {type(value).__name__}", allowed)
    if look.size is not None or look.settings:
        raise InputError("ax", "given with a size or a style", "either axes, or a new figure")
    figure = axes.get_figure(root=True)
    if figure is None:
        raise InputError("ax", "axes without a figure", "axes of a figure")
    singular_values.draw_bars(axes, measured, axes.get_window_extent().width / figure.dpi)
    if not look.title:
        axes.set_title("", loc="left")
    axes.legend()
    return figure


@singledispatch
def _figure(value: object) -> Figure:
    """Return the figure of a value of a type below; InputError if it has another type."""
    allowed = (
        "an Assessment, RobotAssessment, Record, Outcome, Manipulator, PathPlan, Workspace or "
        "KeptCubes"
    )
    raise InputError("value", f"of type {type(value).__name__}", allowed)


_figure.register(Assessment, singular_values.bars)
_figure.register(RobotAssessment, singular_values.bars)
_figure.register(Manipulator, manipulator.figure)
_figure.register(PathPlan, robots.draw_path)
_figure.register(Workspace, robots.draw_workspace)
_figure.register(KeptCubes, robots.draw_kept)
_figure.register(Record, lambda value: singular_values.bars(measure(value.jacobian)))
_figure.register(Outcome, lambda value: optima.draw(optima.ends(value.case.name, value)))
