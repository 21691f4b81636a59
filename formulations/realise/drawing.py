"""Drawings of manipulators: axes as thin lines, links as thick segments, with labels.

Needs matplotlib (`pip install lockedjoint[figures]`), which is imported on the first drawing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from formulations.files.figure import content, figure_class
from formulations.realise.manipulator import Manipulator
from formulations.realise.projection import View, clear_views
from formulations.realise.strokes import Strokes
from nlp.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def figure(manipulator: Manipulator) -> Figure:
    """Return a drawing: planar arms in their plane, others from two sides.

    Raises
    ------
    InputError
        If matplotlib is not installed.
    """
    views = clear_views(manipulator)
    drawn = figure_class()(figsize=(4.2 * len(views), 4.2), layout="constrained")
    for axes, one in zip(drawn.subplots(1, len(views), squeeze=False)[0], views, strict=True):
        draw(manipulator, axes, one)
    return drawn


def render(manipulator: Manipulator, kind: str = "svg") -> bytes:
    """Return the drawing as the content of a file; the same bytes each time.

    Raises
    ------
    InputError
        If the kind is not svg, png or pdf, or matplotlib is not installed.
    """
    return content(figure(manipulator), kind)


def draw(
    manipulator: Manipulator,
    axes: Axes,
    view: View | None = None,
    labels: Sequence[str] | None = None,
    columns: bool = True,
    weight: float = 1.0,
) -> None:
    """Draw a manipulator into axes of a matplotlib figure.

    Parameters
    ----------
    manipulator, axes
        What is drawn, and where.
    view
        From where; chosen for clarity if left out.
    labels
        Names of the joints, from the base; their numbers, counted from 0, if left out.
    columns
        Whether the columns of a planar arm's Jacobian are drawn at the end effector,
        all shortened alike.
    weight
        Factor of the line widths; below 1 in small panels, where names stand farther off.

    Raises
    ------
    InputError
        If there are not as many labels as joints.
    """
    view = view or clear_views(manipulator)[0]
    names = [str(i) for i in range(manipulator.joints)] if labels is None else list(labels)
    if len(names) != manipulator.joints:
        raise InputError("labels", names, f"one for each of the {manipulator.joints} joints")
    strokes = Strokes(manipulator, axes, view, weight)
    if not manipulator.task.in_plane:
        strokes.sphere()
        strokes.axis_lines()
    strokes.bodies()
    if manipulator.task.in_plane and columns:
        strokes.columns(names)
    strokes.ground()
    strokes.links()
    strokes.tip()
    strokes.names(names)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.margins(0.06)
