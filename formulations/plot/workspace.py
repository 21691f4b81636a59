"""What failures leave of a robot's workspace: the plane, or two sections of the space.

And what the robots of several Jacobians keep, against their worst case where they are optimal.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from formulations.kinematics.serial_arm import Bits
from formulations.plot.style import (
    BLUE,
    INK,
    ORANGE,
    PALE,
    PAPER,
    SMALL,
    TITLE,
    VERMILION,
    styled,
)
from formulations.workspaces.workspace import Workspace
from nlp.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LEGEND = ("physical limits", "artificial limits", "kept after any failure")


def draw(found: Workspace) -> Figure:
    """Draw what is reached, and what of it is kept.

    Parameters
    ----------
    found
        The workspace of a planar arm, which is drawn whole, or of a spatial one: its section
        through the axis of the first joint, and that across it where most is kept.

    Returns
    -------
    matplotlib.figure.Figure
    """
    sets = found.sets
    layers = [sets.before(found.arm.physical), sets.before(found.limits), found.voxels]
    flat = found.dimension == 2
    with styled(4.6 if flat else 7.4, 4.6 if flat else 4.0) as figure:
        unit = "m²" if flat else "m³"
        share = 100 * found.size / found.physical if found.physical else 0.0
        title = f"{found.size:.3g} {unit} kept, {share:.0f} % of what is reached"
        figure.suptitle(title, fontsize=TITLE)
        if flat:
            _section(figure.subplots(), found, layers, (0, 1))
        else:
            left, right = figure.subplots(1, 2)
            kept = layers[2] if layers[2].any() else layers[0]
            across = -int(sets.corner[1])
            level = int(np.argmax(kept.sum(axis=(0, 1))))
            _section(left, found, [one[:, across] for one in layers], (0, 2))
            _section(right, found, [one[:, :, level] for one in layers], (0, 1))
            for axes, axis, place in ((left, 1, across), (right, 2, level)):
                height = (place + sets.corner[axis]) * sets.voxel
                axes.set_title(f"{'xyz'[axis]} = {height:.2f} m", fontsize=SMALL)
        from matplotlib.patches import Patch

        colours = (PALE, BLUE, ORANGE)
        patches = [
            Patch(color=one, label=name) for one, name in zip(colours, _LEGEND, strict=True)
        ]
        columns = 2 if flat else 3  # as many as there is room for
        figure.legend(handles=patches, loc="outside lower center", ncols=columns, frameon=False)
    return figure


class Ordered(Protocol):
    """What is drawn of a Jacobian: see `results.workspaces.orders.OrderRow`."""

    @property
    def worst_case_sigma(self) -> float:
        """Where the Jacobian is designed."""

    @property
    def kept(self) -> float:
        """What its best order keeps."""

    @property
    def error(self) -> float:
        """How far that may be off."""

    @property
    def middle(self) -> float:
        """What the median order keeps."""

    @property
    def front(self) -> str:
        """``yes`` if no other Jacobian has a larger worst case and keeps as much."""


def draw_orders(rows: Sequence[Ordered], spread: Sequence[FloatArray]) -> Figure:
    """Draw what robots keep over a workspace against their worst case at one configuration.

    Parameters
    ----------
    rows
        One for each Jacobian: its best order.
    spread
        What random orders of each keep.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with styled(7.4, 4.2) as figure:
        axes = figure.subplots()
        axes.set_title("Robots of seven joints: 5040 orders of each Jacobian")
        sigmas = [one.worst_case_sigma for one in rows]
        for sigma, values in zip(sigmas, spread, strict=True):
            low, high = np.quantile(values, [0.05, 0.95])
            axes.vlines(sigma, low, high, color=PALE, lw=7)
        axes.scatter([], [], color=PALE, marker="s", label="nine of ten random orders")
        middles = [one.middle for one in rows]
        axes.scatter(
            sigmas, middles, color=INK, marker="_", s=60, label="median order", zorder=3
        )
        for kind, colour, label in (
            ("no", BLUE, "best order found"),
            ("yes", VERMILION, "the same, not dominated"),
        ):
            some = [one for one in rows if one.front == kind]
            x, y = [one.worst_case_sigma for one in some], [one.kept for one in some]
            bars = [one.error for one in some]
            axes.errorbar(x, y, bars, color=colour, fmt="o", ms=4, label=label)
        axes.set_xlabel("worst-case σ where the Jacobian is designed")
        axes.set_ylabel("volume kept, limits ±20° (lever arms³)")
        axes.set_ylim(bottom=0)
        figure.legend(loc="outside lower center", ncols=2, frameon=False)
    return figure


def _section(axes: Axes, found: Workspace, layers: list[Bits], shown: tuple[int, int]) -> None:
    from matplotlib.colors import ListedColormap

    sets = found.sets
    level = np.max([(k + 1) * one for k, one in enumerate(layers)], axis=0)
    first, second = ((sets.corner[k] - 0.5) * sets.voxel for k in shown)
    rows, columns = level.shape
    extent = (first, first + rows * sets.voxel, second, second + columns * sets.voxel)
    colours = ListedColormap([PAPER, PALE, BLUE, ORANGE])
    axes.imshow(
        level.T,
        origin="lower",
        extent=extent,
        cmap=colours,
        vmin=0,
        vmax=3,
        interpolation="nearest",
    )
    axes.set_xlabel(f"{'xyz'[shown[0]]} (m)")
    axes.set_ylabel(f"{'xyz'[shown[1]]} (m)")
