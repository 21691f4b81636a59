"""Singular values before and after the failure of each joint, beside the bounds.

`make` draws all singular values of a Jacobian J, by default of two: the residual minimum and
the max-min optimum of unit revolute 7R. J has the shape (m, n), one column per joint; joints
are counted from 0. `bars` draws of an assessment what each failure leaves: σ, the least
singular value of the columns that are left.

The rows of a `Picture` have the columns ``jacobian`` (its title), ``locked_joint`` (None before
a failure), ``singular_value`` (its number, from 1, the largest first), ``value``, and a column
for each bound by its name, None where it does not hold for this J.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from lockedjoint.figures import style
from lockedjoint.figures.style import Picture, reached
from lockedjoint.formulations import max_min, measures, registry, residual
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.joint import MOST_JOINTS
from lockedjoint.formulations.joints.kinds import UnitRevolute
from lockedjoint.formulations.measures.assessment import Assessment
from lockedjoint.formulations.solving.case import Case
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.nlp.arrays import FloatArray, whole_number
from lockedjoint.robots.robot_assessment import RobotAssessment

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# The height of the figure, in inches.
_HEIGHT_INCHES = 4.8
# The margins at both sides together, in inches.
_MARGIN_INCHES = 1.0
# The width of one joint, in inches.
_JOINT_INCHES = 0.37
# The statements whose answers are drawn by default, and the titles of these panels.
_TITLES = {residual: "Residual minimum", max_min: "Max-min optimum"}
# The stroke of a singular value is twice as long as this share of the distance of two joints.
_HALF_STROKE = 0.3
# Bounds that differ by less than this are one line.
_SAME = 1e-4
# The largest number of bars. More would be too thin to name.
_MOST_BARS = 60
# The number of bars for which there is room at least: fewer are drawn as wide.
_LEAST_BARS = 8
# The width of the figure of bars: what is beside them, and each bar, in inches.
_BESIDE_BARS_INCHES = 2.2
_BAR_WITH_ROOM_INCHES = 0.3
# The height of the figure of bars, in inches.
_BARS_HEIGHT_INCHES = 3.4
# The width of a bar, as a share of the distance of two bars.
_BAR_WIDTH = 0.7
# The height of the bars' axes, as a factor of the largest value.
_HEADROOM = 1.12
# Share of the worst case up to which another failure is as bad, and drawn in its colour.
_TIE_SHARE = 1e-6
# The width of a panel beside its joints, in joints: "before" and the gaps.
_WIDTHS_BESIDE_JOINTS = 3
# The place of the first joint on the axis; values before a failure are at 0.
_FIRST_JOINT_PLACE = 1.5
# The least width of a bar with its gap, in inches.
_BAR_INCHES = 0.19


def make(effort: Effort, jacobian: FloatArray | None = None) -> Picture:
    """Solve, or take the Jacobian given, shape (m, n), and draw its singular values.

    Panels above have all values but the smallest after each failure, panels below these: the
    two have scales of their own.
    """
    seven = Arm.of(UnitRevolute(), 7)
    if jacobian is not None:
        shown = [("", jacobian)]
    else:
        shown = [
            (f"{title},\nunit revolute 7R", reached(Case(stated, seven), effort).best.jacobian)
            for stated, title in _TITLES.items()
        ]
    for _, matrix in shown:
        whole_number("number of columns of the Jacobian", matrix.shape[1], 1, MOST_JOINTS)
    widths = [matrix.shape[1] + _WIDTHS_BESIDE_JOINTS for _, matrix in shown]
    with style.styled(_MARGIN_INCHES + _JOINT_INCHES * sum(widths), _HEIGHT_INCHES) as figure:
        panels = figure.subplots(
            2, len(shown), sharex="col", sharey="row", squeeze=False, width_ratios=widths
        )
        for column, (title, matrix) in zip(panels.T, shown, strict=True):
            _draw(column[0], column[1], title, matrix)
        panels[0, 0].set_ylabel("all other\nsingular values")
        panels[1, 0].set_ylabel("the smallest\nafter the failure")
        for axes in panels[:, 1:].ravel():
            axes.spines[:].set_visible(False)
            axes.tick_params(length=0)
    rows = [row for title, matrix in shown for row in _rows(title, matrix)]
    # Every row has the bounds of all.
    names = dict.fromkeys(name for row in rows for name in row)
    return Picture(figure, [dict.fromkeys(names) | row for row in rows])


def bars(value: Assessment | RobotAssessment) -> Figure:
    """Draw what each failure leaves, below the trace bound (6) and down to the worst case.

    As many failures as there is room for, the worst ones if there are more.
    """
    count = min(max(len(_left(value)[0]), _LEAST_BARS), _MOST_BARS)
    width_inches = _BESIDE_BARS_INCHES + _BAR_WITH_ROOM_INCHES * count
    with style.styled(width_inches, _BARS_HEIGHT_INCHES) as figure:
        draw_bars(figure.subplots(), value, figure.get_figwidth())
        figure.legend(loc="outside lower center", ncols=2)
    return figure


def draw_bars(axes: Axes, value: Assessment | RobotAssessment, width: float) -> None:
    """Draw what each failure leaves on axes of a width, in inches.

    Where there are more failures than bars have room, the worst ones are drawn.
    """
    names, sigmas = _left(value)
    worst, bound, count = min(sigmas), value.sigma_bound, len(sigmas)
    axes.set_title("σ that each failure leaves")
    what = "joint that locks" if value.failures == 1 else "joints that lock"
    room = max(1, min(_MOST_BARS, int(width / _BAR_INCHES)))
    if count > room:
        shown = np.argsort(sigmas, kind="stable")[:room]
        names, sigmas = [names[k] for k in shown], [sigmas[k] for k in shown]
        what = f"{what}, the worst {room} of {count}"
    is_worst = np.array(sigmas) <= worst * (1 + _TIE_SHARE)
    colours = np.where(is_worst, style.VERMILION, style.PALE).tolist()
    axes.bar(range(len(sigmas)), sigmas, _BAR_WIDTH, color=colours)
    label = f"trace bound (6) {bound:.4f}"
    axes.axhline(bound, color=style.INK, lw=0.6, ls=style.DASHED, label=label)
    axes.plot([], [], "s", color=style.VERMILION, label=f"worst case {worst:.4f}")
    axes.set_xlabel(what)
    axes.set_ylabel("smallest singular value")
    # Names longer than a number of two digits have no room side by side.
    turned = 90 if max(map(len, names)) > 2 else 0
    axes.set_xticks(range(len(sigmas)), names, rotation=turned, **style.LITERAL)
    axes.set_ylim(0, _HEADROOM * max(bound, *sigmas))


def _left(value: Assessment | RobotAssessment) -> tuple[list[str], list[float]]:
    """Return, for each failure, the names of the joints that lock, and the σ that it leaves."""
    if isinstance(value, Assessment):
        joints = combinations(map(str, range(value.joints)), value.failures)
        names = [", ".join(some) for some in joints]
        return names, value.locked_sigmas
    names = [", ".join(map(style.label, failure.joints)) for failure in value.by_failure]
    return names, [failure.sigma for failure in value.by_failure]


def bounds(matrix: FloatArray) -> dict[str, float]:
    """Return the bounds on the worst case of a Jacobian by name: (6), and one that is sharper.

    The proved bound is on the worst case of all unit revolute arms with as many joints; it
    is there where J is of that model and the bound is sharper than (6).
    """
    m, n = matrix.shape
    known = {"trace bound (6)": measures.sigma_bound(m, n, measures.trace(matrix))}
    if m == 6 and (arm := Arm.of(UnitRevolute(), n)).admits(matrix):
        proved = registry.bound(max_min, arm).value
        if proved < known["trace bound (6)"] - _SAME:
            known["proved bound"] = proved
    return known


def _values(matrix: FloatArray) -> list[FloatArray]:
    """Return the singular values before, then after the failure of each joint.

    Those of one array are in descending order: min(m, columns) of them.
    """
    after = (np.delete(matrix, f, axis=1) for f in range(matrix.shape[1]))
    return [np.asarray(np.linalg.svd(rest, compute_uv=False)) for rest in (matrix, *after)]


def _rows(title: str, matrix: FloatArray) -> list[dict[str, Any]]:
    """Return a row for each singular value of `_values`, see the file's header."""
    return [
        {
            "jacobian": " ".join(title.split()) or "given",
            "locked_joint": None if place == 0 else float(place - 1),
            "singular_value": k + 1,
            "value": float(value),
            **bounds(matrix),
        }
        for place, values in enumerate(_values(matrix))
        for k, value in enumerate(values)
    ]


def _draw(upper: Axes, lower: Axes, title: str, matrix: FloatArray) -> None:
    """Draw the smallest value after each failure on `lower`, all others on `upper`."""
    values = _values(matrix)
    places = np.array([0.0, *(_FIRST_JOINT_PLACE + f for f in range(matrix.shape[1]))])
    for place, column in zip(places, values, strict=True):
        others = column if place == 0 else column[:-1]
        upper.hlines(
            others, place - _HALF_STROKE, place + _HALF_STROKE, color=style.BLUE, lw=1.4
        )
    smallest, after = np.array([column[-1] for column in values[1:]]), places[1:]
    lower.hlines(
        smallest, after - _HALF_STROKE, after + _HALF_STROKE, color=style.VERMILION, lw=2.0
    )
    known = bounds(matrix)
    left, right = after[0] - _HALF_STROKE, after[-1] + _HALF_STROKE
    for bound, dashes in zip(known.values(), (style.DASHED, "-"), strict=False):
        lower.hlines(bound, left, right, color=style.INK, lw=0.6, ls=dashes)
    text = "\n".join(f"{name} {bound:.4f}" for name, bound in known.items())
    least = float(np.min(smallest))
    style.beside(lower, (left, max(known.values())), text, (0, 4), style.INK)
    style.beside(lower, (left, least), f"worst case {least:.4f}", (0, -4), style.VERMILION)
    upper.set_title(title)
    upper.tick_params(labelbottom=False)
    lower.set_xticks(places, ["before", *(str(f) for f in range(len(smallest)))])
    lower.set_xlabel("joint that locks")
    for axes in (upper, lower):
        axes.margins(y=0.18)
        axes.spines["bottom"].set_visible(False)
        axes.tick_params(axis="x", length=0)
