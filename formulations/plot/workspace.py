"""What failures leave of a robot's workspace: the plane, or two sections of the space."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from formulations.kinematics.serial_arm import Bits
from formulations.plot.style import BLUE, ORANGE, PALE, PAPER, SMALL, styled
from formulations.workspaces.workspace import Workspace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LEGEND = {"physical limits": PALE, "artificial limits": BLUE, "kept after any failure": ORANGE}


def draw(workspace: Workspace) -> Figure:
    """Draw what is reached, and what of it is kept.

    Parameters
    ----------
    workspace
        That of a planar arm, which is drawn whole, or of a spatial one: its section
        through the axis of the first joint, and that across it where most is kept.

    Returns
    -------
    matplotlib.figure.Figure
    """
    sets = workspace.sets
    layers = [
        sets.before(workspace.arm.physical),
        sets.before(workspace.limits),
        workspace.voxels,
    ]
    flat = workspace.dimension == 2
    with styled(*((4.6, 4.6) if flat else (7.4, 4.0))) as figure:
        from matplotlib.patches import Patch

        unit = "m²" if flat else "m³"
        share = f"{100 * workspace.share:.0f} % of what is reached"
        figure.suptitle(f"{workspace.size:.3g} {unit} kept, {share}")
        if flat:
            _section(figure.subplots(), workspace, layers, (0, 1))
        else:
            left, right = figure.subplots(1, 2)
            most = layers[2] if layers[2].any() else layers[0]
            across = -int(sets.corner[1])
            level = int(np.argmax(most.sum(axis=(0, 1))))
            _section(left, workspace, [layer[:, across] for layer in layers], (0, 2))
            _section(right, workspace, [layer[:, :, level] for layer in layers], (0, 1))
            for axes, axis, place in ((left, 1, across), (right, 2, level)):
                height = (place + sets.corner[axis]) * sets.voxel
                axes.set_title(f"{'xyz'[axis]} = {height:.2f} m", fontsize=SMALL)
        patches = [Patch(color=colour, label=name) for name, colour in _LEGEND.items()]
        columns = 2 if flat else 3  # as many as there is room for
        figure.legend(handles=patches, loc="outside lower center", ncols=columns)
    return figure


def _section(
    axes: Axes, workspace: Workspace, layers: list[Bits], shown: tuple[int, int]
) -> None:
    from matplotlib.colors import ListedColormap

    sets = workspace.sets
    level = np.max([(k + 1) * layer for k, layer in enumerate(layers)], axis=0)
    first, second = ((sets.corner[k] - 0.5) * sets.voxel for k in shown)
    rows, columns = level.shape
    extent = (first, first + rows * sets.voxel, second, second + columns * sets.voxel)
    colours = ListedColormap([PAPER, *_LEGEND.values()])
    axes.imshow(level.T, origin="lower", extent=extent, cmap=colours, vmin=0, vmax=3)
    axes.set_xlabel(f"{'xyz'[shown[0]]} (m)")
    axes.set_ylabel(f"{'xyz'[shown[1]]} (m)")
