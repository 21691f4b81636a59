"""The 7R max-min optimum as seven axes tangent to a sphere.

A revolute joint with |v| = |ω| = 1 has its axis at the distance 1 from the end effector: a
tangent of the unit sphere about it. The order of the joints does not matter here.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from formulations import max_min, measures
from formulations.figures.picture import Picture, Request, best
from formulations.files.figure import BLUE, GREY, INK, PALE, SMALL, TITLE, VERMILION, styled
from formulations.realise.from_jacobian import realise
from formulations.realise.manipulator import Manipulator
from formulations.realise.projection import View, clear_views, clearest
from formulations.solving.setup import Setup
from nlp.arrays import FloatArray
from nlp.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH, HEIGHT = 8.4, 4.6
# Half the length of a drawn axis; where its name stands: in radii. Room about axes.
REACH, NAME, ROOM = 0.62, 0.7, 1.07
PIECES = 200
SHADES = 30


def make(request: Request) -> Picture:
    """Solve, or take the Jacobian given, and draw its axes from two sides."""
    matrix = _matrix(request)
    arm = realise(matrix)
    if np.any(arm.prismatic):
        raise InputError("--jacobian", "with a prismatic joint", "revolute joints only")
    distances = np.linalg.norm(arm.points - arm.end_effector, axis=1)
    with styled(WIDTH, HEIGHT) as figure:
        tangent = np.ptp(distances) < 1e-3 * np.max(distances)
        what = "axes tangent to a sphere" if tangent else "axes, and the sphere of their mean"
        sigma = measures.worst_case_sigma(matrix)
        number = "Seven" if arm.joints == 7 else str(arm.joints)
        figure.suptitle(
            f"{number} {what}: σ ≥ {sigma:.4f} whichever joint locks",
            fontsize=TITLE,
        )
        panels = figure.subplots(1, 2)
        for axes, view, side in zip(
            panels, clear_views(arm), ("from one side", "a quarter turn on"), strict=True
        ):
            _draw(axes, arm, view, float(np.mean(distances)))
            axes.set_title(side, fontsize=SMALL, color=GREY, loc="center", y=-0.02)
    table = pd.DataFrame(
        {
            "joint": range(arm.joints),
            "direction": arm.directions.tolist(),
            "nearest_point": (arm.points - arm.end_effector).tolist(),
            "distance": distances,
            "sigma_when_locked": measures.locked_singular_values(matrix),
        }
    )
    return Picture(figure, table)


def _matrix(request: Request) -> FloatArray:
    if request.jacobian is None:
        return best(Setup(max_min.NAME, "unit-revolute"), request)
    if request.jacobian.shape[0] != 6:
        shape = "×".join(map(str, request.jacobian.shape))
        raise InputError("--jacobian", f"of shape {shape}", "6 rows, for seven-axes")
    return request.jacobian


def _draw(axes: Axes, arm: Manipulator, view: View, radius: float) -> None:
    _sphere(axes, view, radius)
    near = view.project(arm.points - arm.end_effector)
    directions = radius * view.project(arm.directions)
    for point, direction in zip(near, directions, strict=True):
        _axis(axes, point, direction, radius)
    _names(axes, near, directions)
    axes.plot(0, 0, "+", ms=6, mew=0.8, color=GREY, zorder=2)
    axes.set_aspect("equal")
    axes.set_axis_off()
    # The same for both panels: how far axes reach in space.
    half = ROOM * float(np.max(np.hypot(np.linalg.norm(near, axis=1), REACH * radius)))
    axes.set_xlim(-half, half)
    axes.set_ylim(-half, half)


def _sphere(axes: Axes, view: View, radius: float) -> None:
    """Draw a ball lit from the upper left, and its equator."""
    from matplotlib.patches import Circle

    for k in range(SHADES):
        part = k / SHADES
        shade = 0.90 + 0.09 * part**0.7
        middle = (-0.3 * part * radius, 0.3 * part * radius)
        disc = Circle(middle, (1 - part) * radius, lw=0, zorder=0)
        disc.set_facecolor((shade - 0.01, shade, shade + 0.01))
        axes.add_patch(disc)
    axes.add_patch(Circle((0, 0), radius, fill=False, ec=PALE, lw=0.6, zorder=1))
    turn = np.linspace(0, 2 * np.pi, 121)
    circle = np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
    equator = radius * view.project(circle)
    for there, colour in ((equator[:, 2:] >= 0, GREY), (equator[:, 2:] < 0, PALE)):
        x, y, _ = np.where(there, equator, np.nan).T
        axes.plot(x, y, color=colour, lw=0.5, zorder=1)


def _axis(axes: Axes, point: FloatArray, direction: FloatArray, radius: float) -> None:
    """Draw a tangent and the point where it touches, pale where the ball is in front."""
    from matplotlib.collections import LineCollection

    line = point + np.linspace(-REACH, REACH, PIECES + 1)[:, None] * direction
    middle = (line[:-1] + line[1:]) / 2
    hidden = (np.hypot(middle[:, 0], middle[:, 1]) < radius) & (middle[:, 2] < 0)
    cuts = [0, *(np.flatnonzero(hidden[1:] != hidden[:-1]) + 1).tolist(), PIECES]
    pieces = [line[[start, end], :2] for start, end in pairwise(cuts)]
    shades = [(BLUE, 0.3 if hidden[start] else 1.0) for start in cuts[:-1]]
    depth = 3 if point[2] >= 0 else 2
    axes.add_collection(
        LineCollection(pieces, colors=shades, lw=1.5, capstyle="butt", zorder=depth)
    )
    [dot] = axes.plot(point[0], point[1], "o", ms=6, mec="white", mew=0.8, zorder=depth + 0.5)
    dot.set_markerfacecolor(VERMILION if point[2] >= 0 else "#EDBFA0")


def _names(axes: Axes, near: FloatArray, directions: FloatArray) -> None:
    """Write each joint's number at the end of its axis that is farther from all others."""
    steps = np.linspace(-REACH, REACH, 9)[:, None]
    lines = (near[:, None] + steps * directions[:, None])[..., :2]
    taken: list[FloatArray] = []
    for i, (point, direction) in enumerate(zip(near, directions, strict=True)):
        foreshortened = float(np.hypot(direction[0], direction[1]) / np.linalg.norm(direction))
        reach = REACH + (NAME - REACH) / max(foreshortened, 0.2)
        ends = np.array([point - reach * direction, point + reach * direction])[:, :2]
        others = np.vstack([*(line for k, line in enumerate(lines) if k != i), *taken])
        place = clearest(ends, others)
        taken.append(place[None])
        axes.text(place[0], place[1], str(i), color=INK, ha="center", va="center")
