"""Drawings of manipulators: axes as thin lines, links as thick segments, with labels.

A whole figure names its views, in parallel projection, and has the directions of the base's
frame, a scale and the column of the Jacobian that each joint contributes.

What comes in: a `Manipulator` of n joints, whose points and directions have the shape (n, 3),
metres and unit vectors. `View.project` turns them into points as they are seen: right, up and
depth, where a larger depth is nearer to the eye. The *radius* of a drawing is the largest
distance of a joint's point from the end effector: lengths of what is drawn are shares of it.
Widths of lines (``lw``) and sizes of markers (``ms``) are points, 1/72 inch.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lockedjoint.figures import style
from lockedjoint.figures.views import View, clear_views
from lockedjoint.kinematics.geometry import BoolArray
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.synthesis.from_jacobian import realise
from lockedjoint.synthesis.manipulator import Manipulator

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

# Links have this colour.
_LINK_COLOUR = style.ORANGE
# Axes of joints have this colour.
_AXIS_COLOUR = style.BLUE
# The end effector has this colour.
_TIP_COLOUR = style.VERMILION
# Width of a panel of a whole figure, in inches.
_PANEL_INCHES = 4.2
# Height of a whole figure without the table of columns, in inches.
_BARE_HEIGHT_INCHES = 4.83
# Height of a line of the table of columns, in inches: one for each joint.
_LINE_INCHES = 0.13
# Side of the small drawing, in inches.
_THUMBNAIL_INCHES = 3.4
# Number of decimals of the table of columns: smaller entries are shown as 0, without a sign.
_TABLE_DECIMALS = 12
# Share of empty space around a drawing.
_MARGIN_SHARE = 0.06
# Difference of lever arms, as a share of the largest one, up to which one sphere touches all
# axes.
_COMMON_LEVER_SHARE = 1e-3
# Slack of a round length: the share by which rounding may bring it above the largest.
_ROUNDING = 1e-12
# Number of points that a circle is drawn with. More make it smoother.
_CIRCLE_POINTS = 181
# Number of points that an axis is drawn with: it is hidden or not at each of them.
_AXIS_POINTS = 201
# Number of places on each link, or each axis, that names stay away from.
_TAKEN_PLACES = 9
# A drawn axis is twice as long as this share of the drawing's radius.
_HALF_AXIS_SHARE = 0.42
# A joint's body is twice as long as this share of the drawing's radius.
_HALF_BODY_SHARE = 0.06
# The name of an axis stands this far out, in half lengths of the axis.
_NAME_HALF_LENGTHS = 1.14
# The name of an axis stands this far out where other names are near, in half lengths.
_FAR_NAME_HALF_LENGTHS = 1.5
# Names are near one another below this distance, in shares of the drawing's radius.
_NEAR_SHARE = 0.2
# The name of a joint in the plane stands this far from it, in shares of the drawing's radius.
_JOINT_NAME_SHARE = 0.13
# The step between the places for such a name, in degrees around the joint.
_JOINT_NAME_STEP_DEG = 30
# Columns are drawn to this share of their length, which is inside most arms.
_COLUMN_SHARE = 0.3
# The letter of a column stands this far beyond its arrow, in shares of the drawing's radius.
_COLUMN_NAME_SHARE = 0.13
# Arrows of the base's frame have this length, in shares of the drawing's radius.
_FRAME_SHARE = 0.16
# The letter of an axis of the frame is moved this far beyond its arrow, in points.
_FRAME_NAME_POINTS = 5
# An axis of the frame seen shorter than this share of its arrow is along the line of sight, and
# is not drawn.
_ALONG_SIGHT_SHARE = 0.1
# The bar of the scale is at most this long, in shares of the drawing's radius.
_SCALE_SHARE = 0.5
# Layers of the drawing: a larger number lies above a smaller one.
_FLOOR_LAYER = 0
_LINE_LAYER = 5
# The first layer of links, which lie one above the other, below the joints.
_LINK_LAYER = 10
_JOINT_LAYER = 40
_LETTER_LAYER = 60


def figure(manipulator: Manipulator) -> Figure:
    """Return a drawing: planar arms in their plane, others from two sides.

    The table of columns is below, unless the figure is low (`style.is_low`).
    """
    joint = "joint"
    if np.any(manipulator.prismatic):
        in_plane = manipulator.task.in_plane
        joint += ", a circle if revolute" if in_plane else ", hollow if prismatic"
    parts = {"link": _LINK_COLOUR, joint: _AXIS_COLOUR, "end effector": _TIP_COLOUR}
    views = clear_views(manipulator)
    height_inches = _BARE_HEIGHT_INCHES + _LINE_INCHES * manipulator.joints
    with style.styled(_PANEL_INCHES * len(views), height_inches) as drawn:
        panels = drawn.subplots(1, len(views), squeeze=False)[0]
        for axes, view in zip(panels, views, strict=True):
            draw(manipulator, axes, view, scale=True)
            axes.set_title(view.name, fontsize=style.SMALL, color=style.GREY, loc="center")
        style.legend(drawn, parts, 3, above=True)
        if not style.is_low(drawn):
            mono = {"fontsize": "x-small", "family": "DejaVu Sans Mono"}
            drawn.supxlabel(columns_text(manipulator), color=style.INK, **mono)
    return drawn


def thumbnail(jacobian: FloatArray) -> bytes:
    """Return a small drawing, as SVG, of an arm whose Jacobian is the given one, (m, n)."""
    with style.styled(_THUMBNAIL_INCHES, _THUMBNAIL_INCHES) as drawn:
        # There is nothing beside the arm, and a layout takes as long again.
        drawn.set_layout_engine("none")
        draw(realise(jacobian), drawn.add_axes((0.0, 0.0, 1.0, 1.0)))
    return style.content(drawn, "svg")


def columns_text(manipulator: Manipulator) -> str:
    """Return a table as text, a line for each joint.

    It has the joint's number, the number of the column of the Jacobian that it contributes, and
    the entries of that column under the names of the task's rows.
    """
    names = [("vx", "vy", "vz", "wx", "wy", "wz")[row] for row in manipulator.task.rows]
    lines = ["joint  column  " + "".join(f"{name:>9}" for name in names)]
    for i, entries in enumerate(manipulator.jacobian().T):
        numbers = "".join(f"{entry:9.4g}" for entry in np.round(entries, _TABLE_DECIMALS) + 0.0)
        lines.append(f"{i:>5}  {manipulator.columns[i]:>6}  {numbers}")
    return "\n".join(lines)


def draw(
    manipulator: Manipulator,
    axes: Axes,
    view: View | None = None,
    named: bool = True,
    columns: bool = True,
    weight: float = 1.0,
    scale: bool = False,
) -> None:
    """Draw a manipulator into axes of a matplotlib figure.

    Parameters
    ----------
    manipulator
        What is drawn.
    axes
        Where it is drawn.
    view
        The direction from which it is seen; by default the clearest one.
    named
        Whether the joints are named, from 0 at the base.
    columns
        Whether the columns of a planar arm's Jacobian are drawn as arrows at the end effector,
        all shortened alike.
    weight
        A factor on the widths of lines: below 1 in small panels, where names of a planar arm's
        joints stand farther off.
    scale
        Whether the directions of the base's frame and a scale are drawn below.
    """
    view = view or clear_views(manipulator)[0]
    names = [str(i) if named else "" for i in range(manipulator.joints)]
    strokes = _Strokes(manipulator, axes, view, common_lever(manipulator), weight=weight)
    if not manipulator.task.in_plane:
        strokes.sphere()
        strokes.axis_lines()
    strokes.bodies()
    if manipulator.task.in_plane and columns:
        strokes.columns(names)
    strokes.ends()
    strokes.links()
    strokes.names(names, strokes.along_links())
    if scale:
        strokes.frame_and_scale()
    axes.margins(_MARGIN_SHARE)


def draw_axes(
    manipulator: Manipulator, axes: Axes, view: View, ball: float, reach: float
) -> None:
    """Draw the axes alone, and a ball about the end effector that hides them.

    `ball` is its radius, in metres. Axes reach to both sides by `reach`, in shares of the
    drawing's radius.
    """
    strokes = _Strokes(manipulator, axes, view, ball, reach)
    strokes.sphere()
    strokes.axis_lines(1.5)
    strokes.nearest_points()
    strokes.names([str(i) for i in range(manipulator.joints)], strokes.along_axes())


def common_lever(manipulator: Manipulator) -> float:
    """Return the radius of the sphere about the end effector that all revolute axes touch.

    It is in metres, and 0 if there is no such sphere. The distance of an axis from the end
    effector is the norm of its linear velocity at 1 rad/s.
    """
    levers = np.linalg.norm(manipulator.full_jacobian()[:3, ~manipulator.prismatic], axis=0)
    if levers.size == 0:
        return 0.0
    is_common = float(np.ptp(levers)) < _COMMON_LEVER_SHARE * float(np.max(levers))
    return float(np.mean(levers)) if is_common else 0.0


def round_length(most: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is not above `most`."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(k * power for k in (1, 2, 5) if k * power <= most * (1 + _ROUNDING)))


class _Strokes:
    """Draws the parts of one manipulator, seen from one side: which lies above which.

    `ball` is the radius of the sphere about the end effector in metres, 0 for none; `reach` the
    half of an axis in shares of the drawing's radius; `weight` a factor on widths of lines.
    """

    def __init__(
        self,
        arm: Manipulator,
        axes: Axes,
        view: View,
        ball: float,
        reach: float = _HALF_AXIS_SHARE,
        weight: float = 1.0,
    ) -> None:
        self._arm, self._axes, self._view = arm, axes, view
        self._ball, self._weight = ball, weight
        # The end effector, shape (3,), and the joints' points, shape (n, 3), as they are seen.
        self._tip = view.project(arm.end_effector)
        self._joints = view.project(arm.points)
        away = np.linalg.norm(arm.points - arm.end_effector, axis=1)
        # All joints may be in the end effector: the radius is then 1 m.
        self._radius = float(np.max(away)) or 1.0
        # From the middle of each drawn axis to its end, as it is seen, shape (n, 3).
        self._half = reach * self._radius * view.project(arm.directions)
        axes.set_aspect("equal")
        axes.set_axis_off()

    def sphere(self) -> None:
        """Draw the sphere about the end effector, if there is one: its rim and its equator."""
        if self._ball == 0:
            return
        angle = np.linspace(0, 2 * np.pi, _CIRCLE_POINTS)
        flat = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_CIRCLE_POINTS)])
        circle = self._ball * flat
        rim = self._tip + circle
        self._axes.fill(*rim.T[:2], fc=style.PAPER, ec=style.PALE, lw=0.8, zorder=_FLOOR_LAYER)
        equator = self._tip + self._view.project(circle)
        front = equator[:, 2] >= self._tip[2]
        self._part(equator, front, style.PALE, 0.6).set_zorder(_FLOOR_LAYER + 1)
        self._part(equator, ~front, style.PALE, 0.6).set(
            ls=(0, (2, 3)), zorder=_FLOOR_LAYER + 1
        )

    def axis_lines(self, width: float = 0.9) -> None:
        """Draw axes, paler where they are behind the sphere about the end effector."""
        for point, half in zip(self._joints, self._half, strict=True):
            line = point + np.linspace(-1, 1, _AXIS_POINTS)[:, None] * half
            x, y, depth = (line - self._tip).T
            hidden = (np.hypot(x, y) < self._ball) & (depth < 0)
            layer = _LINE_LAYER + int(point[2] >= self._tip[2])
            self._part(line, ~hidden, _AXIS_COLOUR, width).set_zorder(layer)
            self._part(line, hidden, _AXIS_COLOUR, width).set(zorder=layer, alpha=0.35)

    def nearest_points(self) -> None:
        """Draw where each axis is nearest to the end effector, pale behind the sphere."""
        self._axes.plot(
            *self._tip[:2], "+", ms=6, mew=0.8, color=style.GREY, zorder=_LINE_LAYER
        )
        for point in self._joints:
            behind = point[2] < self._tip[2]
            [dot] = self._axes.plot(*point[:2], "o", ms=6, mec="white", mew=0.8)
            dot.set(
                mfc="#EDBFA0" if behind else _TIP_COLOUR,
                zorder=_LINE_LAYER if behind else _JOINT_LAYER,
            )

    def links(self) -> None:
        """Draw far links first, each with a white rim: crossings show which is in front."""
        places = np.vstack([self._joints, self._tip])
        starts, ends = places[:-1], places[1:]
        for rank, i in enumerate(np.argsort(starts[:, 2] + ends[:, 2], kind="stable")):
            layer = _LINK_LAYER + rank / len(starts) * (_JOINT_LAYER - _LINK_LAYER)
            link = ends[i] - starts[i]
            rim = np.array([starts[i] + 0.1 * link, ends[i] - 0.1 * link])
            self._line(rim, "white", 7.5, layer, "butt")
            self._line(np.array([starts[i], ends[i]]), _LINK_COLOUR, 4.5, layer, "round")

    def bodies(self) -> None:
        """Draw a stub along each axis, hollow where the joint is prismatic.

        The revolute axes of a planar arm are seen end on, and drawn as circles.
        """
        in_plane = self._arm.task.in_plane
        outer, inner = (11.0, 8.0) if in_plane else (7.0, 4.0)
        half = _HALF_BODY_SHARE * self._radius * self._view.project(self._arm.directions)
        for point, reach, slides in zip(self._joints, half, self._arm.prismatic, strict=True):
            line = np.array([point - reach, point + reach])
            if slides or not in_plane:
                self._line(line, _AXIS_COLOUR, outer, _JOINT_LAYER, "butt")
            if slides:
                self._line(line, "white", inner, _JOINT_LAYER, "butt")
            elif in_plane:
                [pin] = self._axes.plot(point[0], point[1], "o", zorder=_JOINT_LAYER)
                pin.set(
                    mfc="white", mec=_AXIS_COLOUR, mew=1.6 * self._weight, ms=8.5 * self._weight
                )

    def ends(self) -> None:
        """Draw the end effector, and the ground: a triangle whose tip is the first joint."""
        [foot] = self._axes.plot(*self._joints[0, :2], marker="^", zorder=_LINE_LAYER)
        foot.set(marker=6, color=style.GREY, ms=16 * self._weight)
        [dot] = self._axes.plot(*self._tip[:2], "o", zorder=_JOINT_LAYER + 1)
        dot.set(ms=6.5 * self._weight, mfc=_TIP_COLOUR, mec="white", mew=1.2)

    def columns(self, names: Sequence[str]) -> None:
        """Draw the velocities that the joints give the end effector, shortened alike."""
        start = self._tip[:2]
        for name, column in zip(names, self._arm.full_jacobian()[:3].T, strict=True):
            shift = _COLUMN_SHARE * self._view.project(column)[:2]
            size = float(np.linalg.norm(shift))
            if size == 0:
                continue
            self._arrow(start, shift, {"shrinkA": 3})
            beyond = 1 + _COLUMN_NAME_SHARE * self._radius / size
            self._text(start + shift * beyond, f"$j_{{{name}}}$")

    def frame_and_scale(self) -> None:
        """Draw the axes of the base's frame, and a bar of 1, 2 or 5 times a power of ten.

        Both are below what has been drawn. The bar ends below the origin of the base's frame.
        """
        left, low = self._axes.dataLim.get_points()[0]
        reach = _FRAME_SHARE * self._radius
        start = np.array([left + 1.3 * reach, low - 2.6 * reach])
        for name, seen in zip("xyz", self._view.project(np.eye(3)), strict=True):
            shift = reach * seen[:2]
            if np.hypot(*shift) < _ALONG_SIGHT_SHARE * reach:
                continue
            self._arrow(start, shift, {"shrinkA": 0, "shrinkB": 0})
            right, up = _FRAME_NAME_POINTS * shift / np.hypot(*shift)
            self._text(start + shift, name, size=style.SMALL, away=(right, up))
        length = round_length(_SCALE_SHARE * self._radius)
        bar = np.array([[-length, start[1]], [0.0, start[1]]])
        [line] = self._axes.plot(*bar.T, color=style.INK, lw=1.6, marker="|", ms=5)
        line.set_solid_capstyle("butt")
        self._text(bar.mean(axis=0) + [0.0, 0.5 * reach], f"{length:g} m", size=style.SMALL)

    def names(self, names: Sequence[str], taken: FloatArray) -> None:
        """Write each joint's name where it is farthest from the places taken, shape (k, 2).

        In the plane a name stands around its joint. In space it is on the joint's axis, at
        either end or, where other names are near, farther out. A name takes its place from the
        names after it.
        """
        if self._arm.task.in_plane:
            angle = np.radians(np.arange(0, 360, _JOINT_NAME_STEP_DEG))
            around = np.column_stack([np.cos(angle), np.sin(angle)])
            away = _JOINT_NAME_SHARE / self._weight * self._radius * around
            choices = self._joints[:, None, :2] + away
        else:
            out = (
                -_NAME_HALF_LENGTHS,
                _NAME_HALF_LENGTHS,
                -_FAR_NAME_HALF_LENGTHS,
                _FAR_NAME_HALF_LENGTHS,
            )
            choices = np.stack([self._joints + k * self._half for k in out], axis=1)
        for name, offered in zip(names, choices[..., :2], strict=True):
            # The distance of each place offered from the nearest one taken. In space the last
            # two places are those farther out.
            room = np.linalg.norm(taken[:, None] - offered, axis=-1).min(axis=0)
            near = room if self._arm.task.in_plane else room[:-2]
            crowded = np.max(near) < _NEAR_SHARE * self._radius
            place = offered[int(np.argmax(room if crowded else near))]
            taken = np.vstack([taken, place])
            self._text(place, name, _AXIS_COLOUR)

    def along_links(self) -> FloatArray:
        """Return places on the links and on the ground, shape (k, 2)."""
        places = np.vstack([self._joints, self._tip])[:, :2]
        links = np.linspace(places[:-1], places[1:], _TAKEN_PLACES).reshape(-1, 2)
        return np.vstack([links, places[:1] - [0.0, 0.1 * self._radius]])

    def along_axes(self) -> FloatArray:
        """Return places on the axes, short of their ends, shape (k, 2)."""
        ends = 0.8 * self._half
        places = np.linspace(self._joints - ends, self._joints + ends, _TAKEN_PLACES)
        return np.asarray(places[..., :2].reshape(-1, 2))

    def _part(self, line: FloatArray, part: BoolArray, colour: str, width: float) -> Line2D:
        """Draw those points of a line, shape (k, 3), that are of a part, shape (k,)."""
        x, y, _ = np.where(part[:, None], line, np.nan).T
        return self._axes.plot(x, y, color=colour, lw=width)[0]

    def _line(self, ends: FloatArray, colour: str, lw: float, layer: float, cap: str) -> None:
        """Draw a segment between two points, shape (2, 3), whose ends have the form `cap`."""
        [line] = self._axes.plot(*ends.T[:2], color=colour, lw=lw * self._weight)
        line.set(zorder=layer, solid_capstyle=cap)

    def _arrow(self, start: FloatArray, shift: FloatArray, shrink: dict[str, float]) -> None:
        """Draw an arrow from a point by a shift, shape (2,) each; it is shortened in points."""
        arrow = {"arrowstyle": "-|>", "color": style.INK, "lw": 0.8, **shrink}
        ends = tuple(start + shift), tuple(start)
        self._axes.annotate("", *ends, arrowprops=arrow, zorder=_JOINT_LAYER)

    def _text(
        self,
        place: FloatArray,
        text: str,
        colour: str = style.INK,
        size: str = "medium",
        away: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Write a text at a place, shape (2,), moved to the right and upwards, in points."""
        from matplotlib.patheffects import withStroke

        offset: dict[str, Any] = {"xytext": away, "textcoords": "offset points"}
        written = self._axes.annotate(text, tuple(place), **offset)
        written.set(color=colour, fontsize=size, zorder=_LETTER_LAYER)
        written.set(ha="center", va="center")
        written.set_path_effects([withStroke(linewidth=2.5, foreground="white")])
        self._axes.update_datalim([tuple(place)])
