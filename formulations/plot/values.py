"""`plot`: the figure of a value of the library, for notebooks and files."""

from __future__ import annotations

from dataclasses import dataclass
from functools import singledispatch
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING

from formulations.measures.assessment import Assessment, measure
from formulations.paths.plan import PathPlan
from formulations.plot import optima, path, workspace
from formulations.plot.look import Look, looking, read_size, read_style
from formulations.plot.manipulator import figure as drawing
from formulations.plot.picture import NothingFoundError
from formulations.plot.style import (
    INK,
    PALE,
    VERMILION,
    beside,
    content,
    figure_class,
    kind_of,
    styled,
    without_frame,
)
from formulations.realise.manipulator import Manipulator
from formulations.robots.robot_assessment import RobotAssessment
from formulations.solving.outcome import Outcome
from formulations.solving.record import Record
from formulations.workspaces.workspace import Workspace
from nlp.errors import InputError
from nlp.files import prepare_file, write_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# More sets of failed joints than this are not told apart on a page: the worst ones are drawn.
_MOST_BARS = 60


@dataclass(frozen=True, eq=False)
class Plot:
    """A figure that notebooks show and `save` writes.

    Attributes
    ----------
    figure
        Matplotlib's.
    look
        How it was asked to look.
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
        target = prepare_file(Path(file), "file")
        with looking(self.look):
            drawn = content(self.figure, kind_of(target))
        write_bytes(target, drawn)
        return target

    def _repr_svg_(self) -> str:
        with looking(self.look):
            return content(self.figure, "svg").decode()


def plot(
    value: object,
    *,
    size: str | None = None,
    title: bool = True,
    style: str | Path | None = None,
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
    look = Look(
        None if size is None else read_size(size, "size"),
        title,
        {} if style is None else read_style(Path(style), "style"),
    )
    with looking(look):
        return Plot(_figure(value), look)


@singledispatch
def _figure(value: object) -> Figure:
    allowed = (
        "an Assessment, RobotAssessment, Record, Outcome, Manipulator, PathPlan or Workspace"
    )
    raise InputError("value", f"of type {type(value).__name__}", allowed)


_figure.register(Manipulator, drawing)
_figure.register(PathPlan, path.draw)
_figure.register(Workspace, workspace.draw)


@_figure.register(Record)
def _(value: Record) -> Figure:
    return _figure(measure(value.jacobian))


@_figure.register(Assessment)
def _(value: Assessment) -> Figure:
    sets = combinations(range(value.joints), value.locked)
    names = [", ".join(map(str, joints)) for joints in sets]
    bars = dict(zip(names, value.locked_sigmas, strict=True))
    return _bars(bars, value.sigma_bound, value.locked)


@_figure.register(RobotAssessment)
def _(value: RobotAssessment) -> Figure:
    bars = {", ".join(one.joints): one.sigma for one in value.failures}
    return _bars(bars, value.sigma_bound, value.locked)


@_figure.register(Outcome)
def _(value: Outcome) -> Figure:
    table = optima.ends(value.case.name, value)
    if not table["counted"].any():
        raise NothingFoundError("No start passes the check; ask for more starts.")
    return optima.draw(table)


def _bars(sigmas: dict[str, float], bound: float, locked: int) -> Figure:
    """Draw what each failure leaves, below the bound (6) and down to the worst case."""
    worst = min(sigmas.values())
    shown = sigmas
    if len(sigmas) > _MOST_BARS:
        shown = dict(sorted(sigmas.items(), key=lambda one: one[1])[:_MOST_BARS])
    with styled(2.2 + 0.3 * max(len(shown), 8), 3.4) as figure:
        axes = figure.subplots()
        fewer = "" if shown is sigmas else f", the worst {len(shown)} of {len(sigmas)} failures"
        axes.set_title(f"σ that each failure leaves{fewer}")
        colours = [VERMILION if one <= worst * (1 + 1e-6) else PALE for one in shown.values()]
        axes.bar(range(len(shown)), list(shown.values()), 0.7, color=colours)
        axes.axhline(bound, color=INK, lw=0.6, ls=(0, (4, 3)))
        # Beside the panel, where no bar is.
        end = ("axes fraction", "data")
        beside(axes, (1, bound), f"bound (6)\n{bound:.4f}", (4, 0), color=INK, xycoords=end)
        text = f"worst case {worst:.4f}"
        axes.set_xlabel("joint that locks" if locked == 1 else "joints that lock")
        axes.set_ylabel("smallest singular value")
        long = max(map(len, shown)) > 3
        axes.set_xticks(range(len(shown)), list(shown), rotation=90 if long else 0)
        axes.annotate(
            text,
            (1, 1),
            xycoords="axes fraction",
            xytext=(0, 3),
            textcoords="offset points",
            color=VERMILION,
            ha="right",
            va="bottom",
        )
        axes.set_ylim(0, 1.12 * max(bound, *shown.values()))
        without_frame(axes, "left", "bottom")
    return figure
