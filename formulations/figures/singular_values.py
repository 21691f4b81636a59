"""Singular values before and after the failure of each joint, beside the bounds.

By default of two Jacobians, the residual minimum and the max-min optimum of unit revolute 7R.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from formulations import max_min, measures, residual, style
from formulations.arm import Arm
from formulations.bounds.certified import certified_bound
from formulations.comparison.contender import Contender
from formulations.figure_file import figure_class
from formulations.figures.picture import Picture, Request, best, solved
from formulations.joint import NotInModelError
from formulations.joints import UnitRevolute
from nlp.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

HEIGHT, MARGIN, STEP = 4.6, 1.4, 0.42
TITLES = {residual.NAME: "Residual minimum", max_min.NAME: "Max-min optimum"}
# Half the length of the stroke that is a singular value, joints being 1 apart.
HALF = 0.3
# Bounds closer than this are one line.
SAME = 1e-4


def make(request: Request) -> Picture:
    """Solve, or take the Jacobian given, and draw its singular values."""
    shown = _jacobians(request)
    columns = sum(matrix.shape[1] + 3 for _, matrix in shown)
    with style.applied():
        figure = figure_class()(figsize=(MARGIN + STEP * columns, HEIGHT))
        panels = figure.subplots(
            1,
            len(shown),
            sharey=True,
            squeeze=False,
            width_ratios=[matrix.shape[1] + 3 for _, matrix in shown],
        )[0]
        for axes, (title, matrix) in zip(panels, shown, strict=True):
            _draw(axes, title, matrix)
        panels[0].set_ylabel("singular values")
        for axes in panels[1:]:
            style.without_frame(axes)
    return Picture(figure, pd.concat([_table(*one) for one in shown], ignore_index=True))


def bounds(matrix: FloatArray) -> list[tuple[str, float]]:
    """Return the bounds on the worst case of a Jacobian with names: (6), and a certified one.

    The certified bound is on the worst case of all unit revolute arms with as many joints; it
    is there where J is of that model and the bound is sharper than (6).
    """
    m, n = matrix.shape
    plain = measures.sigma_bound(m, n, measures.trace(matrix))
    found = [("bound (6)", plain)]
    if m == 6 and _is_unit_revolute(matrix):
        certified = certified_bound(max_min.NAME, Arm.of(UnitRevolute(), n)).value
        if certified < plain - SAME:
            found.append(("certified", certified))
    return found


def _jacobians(request: Request) -> Sequence[tuple[str, FloatArray]]:
    if request.jacobian is not None:
        return [("", request.jacobian)]
    found = []
    for name, title in TITLES.items():
        outcome = solved(Contender(name, "unit-revolute"), request)
        found.append((f"{title}, unit revolute 7R", best(outcome).jacobian))
    return found


def _is_unit_revolute(matrix: FloatArray) -> bool:
    try:
        Arm.of(UnitRevolute(), matrix.shape[1]).variables(matrix)
    except NotInModelError:
        return False
    return True


def _values(matrix: FloatArray) -> list[FloatArray]:
    """Singular values before, then after each failure; as many as there are rows."""
    m, n = matrix.shape
    left = [np.delete(matrix, f, axis=1) for f in range(n)]
    after = [np.linalg.svd(one, compute_uv=False) for one in left]
    return [measures.singular_values(matrix), *(values[:m] for values in after)]


def _table(title: str, matrix: FloatArray) -> pd.DataFrame:
    rows = [
        {
            "jacobian": title or "given",
            "locked_joint": None if place == 0 else place,
            "singular_value": k + 1,
            "value": float(value),
            **{name: bound for name, bound in bounds(matrix)},
        }
        for place, values in enumerate(_values(matrix))
        for k, value in enumerate(values)
    ]
    return pd.DataFrame(rows)


def _draw(axes: Axes, title: str, matrix: FloatArray) -> None:
    values = _values(matrix)
    places = [0.0, *(1.5 + f for f in range(len(values) - 1))]
    for place, column in zip(places, values, strict=True):
        colours = [style.BLUE] * (len(column) - 1)
        colours.append(style.BLUE if place == 0 else style.VERMILION)
        axes.hlines(
            column, place - HALF, place + HALF, color=colours, lw=1.6, capstyle="butt"
        )
    worst = int(np.argmin([column[-1] for column in values[1:]]))
    sigma, end = values[1 + worst][-1], places[-1] + HALF
    known = bounds(matrix)
    for name, bound in known:
        axes.hlines(bound, places[1] - HALF, end + 0.15, color=style.INK, lw=0.6, ls=(0, (4, 3)))
    said = [f"{name} {bound:.4f}" for name, bound in known]
    axes.text(end, max(b for _, b in known) + 0.02, "   ".join(said), ha="right", va="bottom")
    axes.text(
        places[1 + worst], sigma - 0.03, f"{sigma:.4f}", color=style.VERMILION, ha="center",
        va="top",
    )
    axes.set_title(title)
    axes.set_ylim(0, None)
    axes.set_xticks(places, ["before", *(str(f + 1) for f in range(len(values) - 1))])
    axes.set_xlabel("joint that locks", loc="center")
    style.without_frame(axes, "left")
