"""The parts of a drawing of a manipulator, and which lies above which."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from formulations.files.figure import BLUE, INK, ORANGE, PALE, PAPER, VERMILION
from formulations.realise.manipulator import Manipulator
from formulations.realise.projection import View, clearest
from nlp.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINK, AXIS, TIP = ORANGE, BLUE, VERMILION
# Half the length of a drawn axis and of a joint's body, in parts of the drawing's radius.
AXIS_REACH, BODY_REACH = 0.42, 0.06
# Columns are drawn to this part of their length, inside most arms.
COLUMN_SHARE = 0.3
PIECES = 24
# Layers: links lie one above the other from here.
FLOOR, LINES, LINKS, JOINTS, LETTERS = 0, 5, 10, 40, 60


class Strokes:
    """Draws one manipulator, seen from one side, into axes of a matplotlib figure.

    Parameters
    ----------
    manipulator, axes, view
        What is drawn, where, and from which side.
    weight
        Factor of the widths of links and joints; 1 in a figure of their own.
    """

    def __init__(
        self, manipulator: Manipulator, axes: Axes, view: View, weight: float = 1.0
    ) -> None:
        self._arm, self._axes, self._view, self._weight = manipulator, axes, view, weight
        self._tip = view.project(manipulator.end_effector)
        self._joints = view.project(manipulator.points)
        away = np.linalg.norm(manipulator.points - manipulator.end_effector, axis=1)
        self._radius = float(np.max(away)) or 1.0
        self._ball = _common_lever(manipulator)

    def sphere(self) -> None:
        """Draw the sphere that all axes touch, if there is one: its rim and its equator."""
        if self._ball == 0:
            return
        turn = np.linspace(0, 2 * np.pi, 181)
        circle = self._ball * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(181)])
        rim = self._tip + circle
        self._axes.fill(rim[:, 0], rim[:, 1], color=PAPER, lw=0, zorder=FLOOR)
        self._axes.plot(rim[:, 0], rim[:, 1], color=PALE, lw=0.8, zorder=FLOOR + 1)
        equator = self._view.project(self._arm.end_effector + circle)
        front = equator[:, 2] >= self._tip[2]
        for part, style in ((front, "-"), (~front, (0, (2, 3)))):
            line = np.where(part[:, None], equator[:, :2], np.nan)
            self._axes.plot(
                line[:, 0], line[:, 1], color=PALE, lw=0.6, ls=style, zorder=FLOOR + 1
            )

    def axis_lines(self) -> None:
        """Draw axes, paler where they are behind the sphere about the end effector."""
        from matplotlib.collections import LineCollection

        for start, end in self._axis_ends(1.0):
            line = self._view.project(np.linspace(start, end, PIECES + 1))
            middle = (line[:-1] + line[1:]) / 2 - self._tip
            inside = np.hypot(middle[:, 0], middle[:, 1]) < self._ball
            shades = [(AXIS, 0.35 if one else 1.0) for one in inside & (middle[:, 2] < 0)]
            pieces = list(np.stack([line[:-1, :2], line[1:, :2]], axis=1))
            self._axes.add_collection(
                LineCollection(pieces, colors=shades, lw=0.9, zorder=LINES)
            )
            self._axes.update_datalim(line[:, :2])

    def links(self) -> None:
        """Draw far links first, each with a white rim: crossings show which is in front."""
        places = np.vstack([self._joints, self._tip])
        starts, ends = places[:-1], places[1:]
        for rank, i in enumerate(np.argsort(starts[:, 2] + ends[:, 2], kind="stable")):
            layer = LINKS + rank / len(starts) * (JOINTS - LINKS)
            link = ends[i] - starts[i]
            rim = np.array([starts[i] + 0.1 * link, ends[i] - 0.1 * link])
            self._line(rim, "white", 7.5, layer, "butt")
            self._line(np.array([starts[i], ends[i]]), LINK, 4.5, layer, "round")

    def bodies(self) -> None:
        """Draw a stub along each axis, hollow where the joint is prismatic.

        The revolute axes of a planar arm are seen end on, and drawn as circles.
        """
        in_plane = self._arm.task.in_plane
        outer, inner = (11.0, 8.0) if in_plane else (7.0, 4.0)
        half = BODY_REACH * self._radius * self._view.project(self._arm.directions)
        for point, reach, slides in zip(self._joints, half, self._arm.prismatic, strict=True):
            line = np.array([point - reach, point + reach])
            if slides or not in_plane:
                self._line(line, AXIS, outer, JOINTS, "butt")
            if slides:
                self._line(line, "white", inner, JOINTS, "butt")
            elif in_plane:
                [pin] = self._axes.plot(point[0], point[1], "o", zorder=JOINTS)
                pin.set(mfc="white", mec=AXIS, mew=1.6 * self._weight)
                pin.set_markersize(8.5 * self._weight)

    def ground(self) -> None:
        """Draw the ground that holds the first joint."""
        x, y = self._joints[0, :2]
        step = 0.05 * self._radius
        low = y - 1.9 * step
        for foot in (x - 1.2 * step, x + 1.2 * step):
            self._axes.plot([x, foot], [y, low], color=INK, lw=0.9, zorder=LINES)
        floor = np.linspace(x - 2 * step, x + 2 * step, 6)
        self._axes.plot(floor[[0, -1]], [low, low], color=INK, lw=0.9, zorder=LINES)
        for right in floor[1:]:
            hatch = [right, right - step / 2], [low, low - step / 2]
            self._axes.plot(*hatch, color=INK, lw=0.6, zorder=LINES)

    def columns(self, names: Sequence[str]) -> None:
        """Draw the velocities that the joints give the end effector, shortened alike."""
        for name, column in zip(names, self._arm.full_jacobian()[:3].T, strict=True):
            shift = COLUMN_SHARE * self._view.project(column)[:2]
            size = float(np.linalg.norm(shift))
            if size == 0:
                continue
            start = self._tip[:2]
            arrow = {"arrowstyle": "-|>", "color": INK, "lw": 0.8, "shrinkA": 3}
            end = start + shift
            self._axes.annotate(
                "", (end[0], end[1]), (start[0], start[1]), arrowprops=arrow, zorder=JOINTS
            )
            place = start + shift * (1 + 0.13 * self._radius / size)
            self._text(place, f"$j_{{{name}}}$", INK, 9.0)

    def tip(self) -> None:
        """Draw the end effector."""
        x, y = self._tip[:2]
        size = 6.5 * self._weight
        self._axes.plot(x, y, "o", ms=size, mfc=TIP, mec="white", mew=1.2, zorder=JOINTS + 1)

    def names(self, names: Sequence[str]) -> None:
        """Write each joint's name where it is farthest from all that is drawn so far."""
        places = np.vstack([self._joints, self._tip])[:, :2]
        steps = np.linspace(0, 1, 9)[:, None]
        taken = [a + steps * (b - a) for a, b in pairwise(places)]
        taken.append(places[:1] - [0.0, 0.1 * self._radius])  # the ground
        if self._arm.task.in_plane:
            turn = np.radians(np.arange(0, 360, 30))
            around = np.column_stack([np.cos(turn), np.sin(turn)])
            choices = self._joints[:, None, :2] + 0.13 / self._weight * self._radius * around
        else:
            choices = self._view.project(self._axis_ends(1.14))[..., :2]
        for name, offered in zip(names, choices, strict=True):
            place = clearest(offered, np.vstack(taken))
            taken.append(place[None])
            self._text(place, name, AXIS, 10.0)

    def _axis_ends(self, share: float) -> FloatArray:
        """Both ends of each drawn axis, shape (n, 2, 3)."""
        reach = share * AXIS_REACH * self._radius * self._arm.directions
        return np.stack([self._arm.points - reach, self._arm.points + reach], axis=1)

    def _line(
        self, ends: FloatArray, colour: str, width: float, layer: float, cap: str
    ) -> None:
        self._axes.plot(
            ends[:, 0],
            ends[:, 1],
            color=colour,
            lw=width * self._weight,
            zorder=layer,
            solid_capstyle=cap,
        )

    def _text(self, place: FloatArray, text: str, colour: str, size: float) -> None:
        from matplotlib.patheffects import withStroke

        written = self._axes.text(
            float(place[0]), float(place[1]), text, color=colour, fontsize=size, zorder=LETTERS
        )
        written.set(ha="center", va="center")
        written.set_path_effects([withStroke(linewidth=2.5, foreground="white")])
        self._axes.update_datalim([(float(place[0]), float(place[1]))])


def _common_lever(manipulator: Manipulator) -> float:
    """Radius of the sphere about the end effector that all revolute axes touch; 0 if none."""
    columns = manipulator.full_jacobian()[:3, ~manipulator.prismatic]
    levers = np.linalg.norm(columns, axis=0)
    one = levers.size > 0 and float(np.ptp(levers)) < 1e-3 * float(np.max(levers))
    return float(np.mean(levers)) if one else 0.0
