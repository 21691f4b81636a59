"""Singular values before and after the failure of each joint, beside the bounds.

By default of two Jacobians, the residual minimum and the max-min optimum of unit revolute 7R.
Bars show of an assessment what each failure leaves.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from formulations import max_min, measures, residual
from formulations.joints.arm import Arm
from formulations.joints.kinds import UnitRevolute
from formulations.measures.assessment import Assessment
from formulations.plot.picture import Picture, Request, best
from formulations.plot.style import BLUE, INK, PALE, VERMILION, beside, styled, without_frame
from formulations.registry import bound as bound_on
from formulations.registry import formulation_of
from formulations.robots.robot_assessment import RobotAssessment
from formulations.solving.case import Case
from nlp.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HEIGHT, MARGIN, STEP = 4.8, 1.0, 0.37
_TITLES = {residual.NAME: "Residual minimum", max_min.NAME: "Max-min optimum"}
# Half the length of the stroke that is a singular value, joints being 1 apart.
HALF = 0.3
_CERTIFIED = "certified bound"
# Bounds closer than this are one line.
SAME = 1e-4
_DASHED = (0, (4, 3))
# Bars at most, and the least width of the figure for each, in inches.
MOST_BARS, BAR = 60, 0.19
_BOUND = "bound (6)"


def make(request: Request) -> Picture:
    """Solve, or take the Jacobian given, and draw its singular values."""
    shown = _jacobians(request)
    widths = [matrix.shape[1] + 3 for _, matrix in shown]
    with styled(MARGIN + STEP * sum(widths), HEIGHT) as figure:
        panels = figure.subplots(
            2, len(shown), sharex="col", sharey="row", squeeze=False, width_ratios=widths
        )
        for column, (title, matrix) in zip(panels.T, shown, strict=True):
            _draw(column[0], column[1], title, matrix)
        panels[0, 0].set_ylabel("all other\nsingular values")
        panels[1, 0].set_ylabel("the smallest\nafter the failure")
        for axes in panels[:, 1:].ravel():
            without_frame(axes)
    tables = [_table(title, matrix) for title, matrix in shown]
    return Picture(figure, pd.concat(tables, ignore_index=True))


def bars(value: Assessment | RobotAssessment) -> Figure:
    """Draw what each failure leaves, below the trace bound (6) and down to the worst case.

    As many failures as there is room for, the worst ones if there are more.
    """
    if isinstance(value, Assessment):
        joints = combinations(map(str, range(value.joints)), value.locked)
        sigmas = dict(zip(map(", ".join, joints), value.locked_sigmas, strict=True))
    else:
        sigmas = {", ".join(failure.joints): failure.sigma for failure in value.failures}
    worst, bound, count = min(sigmas.values()), value.sigma_bound, len(sigmas)
    with styled(2.2 + 0.3 * min(max(count, 8), MOST_BARS), 3.4) as figure:
        axes = figure.subplots()
        axes.set_title("σ that each failure leaves")
        shown, which = min(MOST_BARS, int(figure.get_figwidth() / BAR)), ""
        if count > shown:
            which = f", the worst {shown} of {count}"
            sigmas = dict(sorted(sigmas.items(), key=lambda item: item[1])[:shown])
        is_worst = np.array(list(sigmas.values())) <= worst * (1 + 1e-6)
        colours = np.where(is_worst, VERMILION, PALE).tolist()
        axes.bar(range(len(sigmas)), list(sigmas.values()), 0.7, color=colours)
        axes.axhline(bound, color=INK, lw=0.6, ls=_DASHED, label=f"trace {_BOUND} {bound:.4f}")
        axes.plot([], [], "s", color=VERMILION, label=f"worst case {worst:.4f}")
        figure.legend(loc="outside lower center", ncols=2)
        what = "joint that locks" if value.locked == 1 else "joints that lock"
        axes.set_xlabel(f"{what}{which}")
        axes.set_ylabel("smallest singular value")
        long = max(map(len, sigmas)) > 2
        axes.set_xticks(range(len(sigmas)), list(sigmas), rotation=90 if long else 0)
        axes.set_ylim(0, 1.12 * max(bound, *sigmas.values()))
        without_frame(axes, "left", "bottom")
    return figure


def bounds(matrix: FloatArray) -> list[tuple[str, float]]:
    """Return the bounds on the worst case of a Jacobian with names: (6), and a certified one.

    The certified bound is on the worst case of all unit revolute arms with as many joints; it
    is there where J is of that model and the bound is sharper than (6).
    """
    m, n = matrix.shape
    plain = measures.sigma_bound(m, n, measures.trace(matrix))
    known = [(_BOUND, plain)]
    if m == 6 and (arm := Arm.of(UnitRevolute(), n)).admits(matrix):
        certified = bound_on(max_min, arm).value
        if certified < plain - SAME:
            known.append((_CERTIFIED, certified))
    return known


def _jacobians(request: Request) -> Sequence[tuple[str, FloatArray]]:
    if request.jacobian is not None:
        return [("", request.jacobian)]
    return [
        (
            f"{title},\nunit revolute 7R",
            best(Case(formulation_of(name), Arm.of(UnitRevolute(), 7)), request),
        )
        for name, title in _TITLES.items()
    ]


def _values(matrix: FloatArray) -> list[FloatArray]:
    """Singular values before, then after each failure; as many as there are rows."""
    after = (np.delete(matrix, f, axis=1) for f in range(matrix.shape[1]))
    return [np.asarray(np.linalg.svd(rest, compute_uv=False)) for rest in (matrix, *after)]


def _table(title: str, matrix: FloatArray) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "jacobian": " ".join(title.split()) or "given",
            "locked_joint": None if place == 0 else place - 1,
            "singular_value": k + 1,
            "value": float(value),
            **dict(bounds(matrix)),
        }
        for place, values in enumerate(_values(matrix))
        for k, value in enumerate(values)
    )


def _draw(upper: Axes, lower: Axes, title: str, matrix: FloatArray) -> None:
    """Draw the smallest value after each failure below, all others above: two scales."""
    values = _values(matrix)
    places = np.array([0.0, *(1.5 + f for f in range(len(values) - 1))])
    for place, column in zip(places, values, strict=True):
        others = column if place == 0 else column[:-1]
        upper.hlines(others, place - HALF, place + HALF, color=BLUE, lw=1.4)
    smallest, after = np.array([column[-1] for column in values[1:]]), places[1:]
    lower.hlines(smallest, after - HALF, after + HALF, color=VERMILION, lw=2.0)
    known = bounds(matrix)
    left, right = after[0] - HALF, after[-1] + HALF
    for name, bound in known:
        dashes = "-" if name == _CERTIFIED else _DASHED
        lower.hlines(bound, left, right, color=INK, lw=0.6, ls=dashes)
    text = "\n".join(f"{name} {bound:.4f}" for name, bound in known).replace(
        _BOUND, f"trace {_BOUND}"
    )
    highest, least = max(bound for _, bound in known), float(np.min(smallest))
    beside(lower, (left, highest), text, (0, 4), INK)
    beside(lower, (left, least), f"worst case {least:.4f}", (0, -4), VERMILION)
    upper.set_title(title)
    upper.tick_params(labelbottom=False)
    lower.set_xticks(places, ["before", *(str(f) for f in range(len(smallest)))])
    lower.set_xlabel("joint that locks")
    for axes in (upper, lower):
        axes.margins(y=0.18)
        without_frame(axes, "left")
