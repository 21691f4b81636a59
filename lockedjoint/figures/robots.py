"""What failures leave of a robot's path, and of its workspace.

What comes in: a `PathPlan`, a `Workspace` on a grid of voxels, or `KeptCubes`, which are kept
for certain. What goes out: a figure of matplotlib, in inches. Positions are in metres. σ is the
least singular value of the Jacobian after the worst failure, without a unit. A joint *survives*
at a sample of a path if the path can be finished after it has locked there. A voxel is a cube
of the grid, and voxel (i, j, l) has its middle at (corner + (i, j, l)) times the edge `voxel`.
In the plane there are squares.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lockedjoint.figures import style
from lockedjoint.figures.style import BLUE, GREY, ORANGE, PALE, PAPER, SMALL, styled
from lockedjoint.kinematics.serial_chain import Bits, physical_ranges
from lockedjoint.paths.plan import PathPlan
from lockedjoint.workspaces.kept_cubes import KeptCubes
from lockedjoint.workspaces.workspace import Workspace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# The colours of a workspace: each of these sets is within the one before.
_LEGEND = {"physical limits": PALE, "artificial limits": BLUE, "kept after any failure": ORANGE}
# The colours of cubes.
_CERTAIN = {"kept for certain": ORANGE, "not known": PAPER}
# A section is this far beside the middle of a layer, as cubes end at the middle: it is less
# than the edge of any cube, and more than rounding.
_BESIDE_M = 1e-9
# A sample is at a waypoint if its place differs from a whole number by this at most.
_AT_WAYPOINT = 1e-9
# The width and height of the figure of a path, in inches.
_PATH_INCHES = (6.5, 4.6)
# Those of the figure of a planar arm.
_FLAT_INCHES = (4.6, 4.6)
# Those of the figure of an arm in space, which has two sections.
_SPATIAL_INCHES = (7.4, 4.0)
# The height of a joint's row below a path, if the plots above have a height of 2, or of 1.
_ROW_HEIGHT = 0.35
# Ticks of the number of joints are one apart below this number, and two apart from it on.
_MANY_JOINTS = 6
# The room above the number of all joints, in joints.
_ROOM_ABOVE = 0.3
# The axes of squares reach to this factor of the farthest middle.
_AROUND = 1.05


def draw_path(plan: PathPlan) -> Figure:
    """Draw σ and the survivors along a path, beside those of the minimum-norm trajectory.

    The panels show σ, the number of joints that survive, and when each of them does.
    """
    times, count = plan.times, len(plan.joints)
    with styled(*_PATH_INCHES) as figure:
        from matplotlib.colors import ListedColormap

        low = style.is_low(figure)  # the panel in the middle is left out
        ratios = [1, _ROW_HEIGHT * count] if low else [2, 2, _ROW_HEIGHT * count]
        panels = figure.subplots(len(ratios), 1, sharex=True, height_ratios=ratios)
        above, middle, below = panels[0], None if low else panels[1], panels[-1]
        colours: dict[str, str] = {}
        for trajectory, colour, name in (
            (plan.minimum_norm, GREY, "minimum norm"),
            (plan.planned, BLUE, "planned"),
        ):
            if trajectory is not None:
                above.plot(times, trajectory.sigma, color=colour, lw=1.5)
                colours[name] = colour
                if middle:
                    middle.plot(times, trajectory.survives.sum(axis=1), color=colour, lw=1.5)
        above.set_title("worst-case σ")
        above.set_ylim(bottom=0)
        style.legend(figure, colours, 2, above=True)
        if middle:
            middle.set_title("number of joints that may lock")
            middle.set_ylim(0, count + _ROOM_ABOVE)
            middle.set_yticks(range(0, count + 1, 1 if count < _MANY_JOINTS else 2))
        # A cell for each joint and each sample, and white between the joints.
        edges = np.concatenate([times[:1], (times[1:] + times[:-1]) / 2, times[-1:]])
        rows, filled = np.arange(count + 1) - 0.5, ListedColormap([PALE, BLUE])
        below.pcolormesh(edges, rows, plan.planned.survives.T, cmap=filled, vmin=0, vmax=1)
        below.hlines(rows, edges[0], edges[-1], color="white", lw=4)
        names = [style.label(name) for name in plan.joints]
        below.set_yticks(range(count), names, **style.LITERAL)
        below.invert_yaxis()
        below.set_title("when each joint may lock (blue)")
        below.set_xlabel("time (s)")
        for value in plan.times[np.abs(plan.places - np.round(plan.places)) < _AT_WAYPOINT]:
            below.axvline(value, color=GREY, lw=0.5, ls=":")
        return figure


def draw_workspace(workspace: Workspace) -> Figure:
    """Draw what is reached, and what of it is kept.

    That of a planar arm is drawn whole; of a spatial one its section through the axis of the
    first joint, and that across it where most is kept.
    """
    # Each layer has truth values by voxel: what is reached before any failure within the
    # physical limits, within the artificial ones, and what is kept.
    sets = workspace.sets
    within = (physical_ranges(workspace.arm), workspace.limits)
    layers = [*map(sets.before, within), workspace.voxels]
    flat = workspace.dimension == 2
    with styled(*(_FLAT_INCHES if flat else _SPATIAL_INCHES)) as figure:
        unit = "m²" if flat else "m³"
        share = f"{100 * workspace.share:.0f} % of what is reached"
        figure.suptitle(f"{workspace.size:.3g} {unit} kept, {share}")
        if flat:
            _section(figure.subplots(), workspace, layers, (0, 1))
        else:
            left, right = figure.subplots(1, 2)
            most = layers[2] if layers[2].any() else layers[0]
            # The layer with y = 0, and that across z which has most voxels.
            across = -int(sets.corner[1])
            level = int(np.argmax(most.sum(axis=(0, 1))))
            _section(left, workspace, [layer[:, across] for layer in layers], (0, 2))
            _section(right, workspace, [layer[:, :, level] for layer in layers], (0, 1))
            for axes, axis, place in ((left, 1, across), (right, 2, level)):
                height = (place + sets.corner[axis]) * sets.voxel
                axes.set_title(f"{'xyz'[axis]} = {height:.2f} m", fontsize=SMALL)
        style.legend(figure, _LEGEND, 2 if flat else 3)  # as many as there is room for
    return figure


def _section(
    axes: Axes, workspace: Workspace, layers: list[Bits], shown: tuple[int, int]
) -> None:
    """Draw a section of the three sets of `_LEGEND`.

    `layers` has truth values by voxel, shape (a, b), for each set; `shown` are the numbers of
    the axes, 0 to 2 for x, y, z, that a and b run along.
    """
    from matplotlib.colors import ListedColormap

    sets = workspace.sets
    # A voxel has the number of the last set that it is in, and 0 outside.
    level = np.max([(k + 1) * layer for k, layer in enumerate(layers)], axis=0)
    first, second = ((sets.corner[k] - 0.5) * sets.voxel for k in shown)
    rows, columns = level.shape
    extent = (first, first + rows * sets.voxel, second, second + columns * sets.voxel)
    colours = ListedColormap([PAPER, *_LEGEND.values()])
    image = axes.imshow(level.T, origin="lower", extent=extent, cmap=colours, vmin=0, vmax=3)
    image.set_interpolation("nearest")
    axes.set_xlabel(f"{'xyz'[shown[0]]} (m)")
    axes.set_ylabel(f"{'xyz'[shown[1]]} (m)")


def draw_kept(cubes: KeptCubes) -> Figure:
    """Draw the cubes that are kept for certain.

    Those of a planar arm are drawn whole; of a spatial one two sections, where most is kept.
    """
    flat = cubes.centre.shape[1] == 2
    unit = "m²" if flat else "m³"
    with styled(*(_FLAT_INCHES if flat else _SPATIAL_INCHES)) as figure:
        figure.suptitle(f"at least {cubes.size:.3g} {unit} kept")
        if flat:
            _squares(figure.subplots(), cubes, (0, 1))
        else:
            for axes, axis in zip(figure.subplots(1, 2), (1, 2), strict=True):
                place = _fullest(cubes, axis)
                _squares(axes, _cut(cubes, axis, place), (0, 3 - axis))
                axes.set_title(f"{'xyz'[axis]} = {place:.2f} m", fontsize=SMALL)
        style.legend(figure, _CERTAIN, 2)
    return figure


def _fullest(cubes: KeptCubes, axis: int) -> float:
    """Return where along an axis, in metres, most is kept, beside the ends of all cubes.

    Layers are as thick as the largest cube; of the fullest one this is the middle.
    """
    edge = 2 * cubes.half_width.max()
    layers, own = np.unique(np.floor(cubes.centre[:, axis] / edge), return_inverse=True)
    fullest = layers[np.argmax(np.bincount(own, cubes.half_width**3))]
    return float((fullest + 0.5) * edge + _BESIDE_M)


def _cut(cubes: KeptCubes, axis: int, place: float) -> KeptCubes:
    """Return the cubes that a plane across an axis goes through, at a place in metres."""
    return cubes[np.abs(cubes.centre[:, axis] - place) < cubes.half_width]


def _squares(axes: Axes, cubes: KeptCubes, shown: tuple[int, int]) -> None:
    """Draw a side of each cube, along two axes by their numbers, 0 to 2 for x, y, z."""
    from matplotlib.collections import PolyCollection

    axes.set_facecolor(PAPER)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    squares = cubes.centre[:, None, shown] + cubes.half_width[:, None, None] * corners
    drawn = PolyCollection(squares, facecolor=ORANGE, edgecolor="white", linewidth=0.1)
    drawn.set_rasterized(True)  # there are too many for a file of lines
    axes.add_collection(drawn)
    far = _AROUND * np.abs(cubes.centre[:, shown]).max()
    axes.set(xlim=(-far, far), ylim=(-far, far), aspect="equal")
    axes.set_xlabel(f"{'xyz'[shown[0]]} (m)")
    axes.set_ylabel(f"{'xyz'[shown[1]]} (m)")
