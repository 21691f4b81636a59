"""The trade-off between isotropy and worst case, as curves of unit and free lever arms."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from formulations import measures, residual
from formulations.joints.models import arm
from formulations.plot.picture import NothingFoundError, Picture, Request
from formulations.plot.style import (
    BLUE,
    GREY,
    INK,
    SMALL,
    TITLE,
    VERMILION,
    beside,
    styled,
    without_frame,
)
from formulations.registry import bound
from formulations.solving.trade_off_curve import trade_off_curve
from nlp.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH, HEIGHT = 7.4, 4.8
# Of each curve: its name, its colour, and which side of it the name stands on, in points.
MODELS = {
    "unit-revolute": ("unit lever arms", BLUE, (9, -5)),
    "lever-revolute": ("free lever arms", VERMILION, (-9, 5)),
}
POINTS = 12


def make(request: Request, points: int = POINTS) -> Picture:
    """Sweep the limit on the isotropy defect, for each model."""
    table = pd.concat([_curve(model, request, points) for model in MODELS], ignore_index=True)
    seven = arm("unit-revolute", 7)
    bound = measures.sigma_bound(*seven.shape, seven.largest_trace)
    with styled(WIDTH, HEIGHT) as figure:
        axes = figure.subplots()
        axes.set_title("Seven revolute joints: what isotropy costs the worst case")
        for model in MODELS:
            _draw(axes, model, table[table["model"] == model])
        right = float(distance(table["isotropy_defect"]).max())
        low = float(table["worst_case_sigma"].min())
        axes.hlines(bound, 0, 1.22 * right, color=INK, lw=0.6, ls=(0, (4, 3)))
        axes.text(0, bound + 0.001, f"bound (6) {bound:.5f}", va="bottom")
        axes.set_xlabel("distance from isotropy ‖JJᵀ − (T/m)I‖, T = ‖J‖²")
        axes.set_ylabel("worst-case σ")
        axes.set_xlim(-0.01, 1.22 * right)
        _proved(axes, low)
        without_frame(axes, "left", "bottom")
    return Picture(figure, table)


def distance(defect: pd.Series) -> FloatArray:
    """Return ‖JJᵀ − (T/m)I‖_F for isotropy defects, which are half its square."""
    return np.asarray(np.sqrt(2 * defect.to_numpy(dtype=float)))


def _proved(axes: Axes, low: float) -> None:
    """Draw how isotropic unit lever arms can be at most."""
    defect = bound(residual, arm("unit-revolute", 7)).value
    place = float(np.sqrt(2 * defect))
    axes.vlines(place, low, 0.517, color=GREY, lw=0.6)
    text, style = "proved: no unit lever arms left of here", {"color": GREY, "fontsize": SMALL}
    beside(axes, (place, low), text, (5, 0), va="baseline", **style)


def _curve(model: str, request: Request, points: int) -> pd.DataFrame:
    found = trade_off_curve(
        arm(model, 7),
        points,
        request.starts,
        request.seed,
        lambda what: request.progress(f"{model}: {what}"),
    )
    if len(found) < 2:
        raise NothingFoundError(f"No start on {model} passes the check; ask for more starts.")
    return pd.DataFrame(
        {"model": model, **point.to_dict(), "jacobian": json.dumps(point.jacobian.tolist())}
        for point in found
    )


def _draw(axes: Axes, model: str, table: pd.DataFrame) -> None:
    x, y = distance(table["isotropy_defect"]), table["worst_case_sigma"].to_numpy()
    name, colour, side = MODELS[model]
    axes.plot(x, y, color=colour, lw=1.4)
    axes.plot(x[1:-1], y[1:-1], "o", ms=3, color=colour)
    axes.plot(x[[0, -1]], y[[0, -1]], "o", ms=6, color=colour, mec="white", mew=1)
    first = {"isotropy": "exactly isotropic", "residual": "residual minimum"}
    start = first[str(table["statement"].iloc[0])]
    k = len(x) // 2
    beside(axes, (x[0], y[0]), f"{start} {y[0]:.5f}", (9, -4), color=colour)
    beside(axes, (x[-1], y[-1]), f"max-min {y[-1]:.5f}", (8, 0), color=colour)
    beside(axes, (x[k], y[k]), name, side, color=colour, fontsize=TITLE)
