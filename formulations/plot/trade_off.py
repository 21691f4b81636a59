"""The trade-off between isotropy and worst case, as curves of unit and free lever arms."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from formulations import measures, registry, residual
from formulations.joints.models import arm
from formulations.plot.picture import NothingFoundError, Picture, Request
from formulations.plot.style import BLUE, GREY, INK, VERMILION, beside, styled
from formulations.solving.trade_off_curve import trade_off_curve
from nlp.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Of each curve: its name, its colour, and where its largest σ is written, in points.
MODELS = {
    "unit-revolute": ("unit lever arms", BLUE, (5, -9)),
    "lever-revolute": ("free lever arms", VERMILION, (0, 8)),
}
POINTS = 12


def make(request: Request, points: int = POINTS) -> Picture:
    """Sweep the limit on the isotropy defect, for each model."""
    table = pd.concat([_curve(model, request, points) for model in MODELS], ignore_index=True)
    seven = arm("unit-revolute", 7)
    bound = measures.sigma_bound(*seven.shape, seven.largest_trace)
    with styled(7.4, 4.8) as figure:
        axes = figure.subplots()
        axes.set_title("Seven revolute joints: what isotropy costs the worst case")
        for model in MODELS:
            _draw(axes, model, table[table["model"] == model])
        right = 1.3 * float(distance(table["isotropy_defect"]).max())
        low = float(table["worst_case_sigma"].min())
        line = axes.hlines(bound, 0, right, color=INK, lw=0.6, ls=(0, (4, 3)))
        line.set_label(f"trace bound (6) {bound:.5f}")
        place = float(np.sqrt(2 * registry.bound(residual, seven).value))
        proved = "proved: no unit ones left of it"
        axes.vlines(place, low, 0.517, color=GREY, lw=0.6, label=proved)
        axes.set_xlabel("distance from isotropy ‖JJᵀ − (T/m)I‖, T = ‖J‖²")
        axes.set_ylabel("worst-case σ")
        axes.set_xlim(-0.01, right)
        axes.margins(y=0.16)
        figure.legend(loc="outside lower center", ncols=2)
    return Picture(figure, table)


def distance(defect: pd.Series) -> FloatArray:
    """Return ‖JJᵀ − (T/m)I‖_F for isotropy defects, which are half its square."""
    return np.asarray(np.sqrt(2 * defect.to_numpy(dtype=float)))


def _curve(model: str, request: Request, points: int) -> pd.DataFrame:
    curve = trade_off_curve(
        arm(model, 7),
        points,
        request.starts,
        request.seed,
        lambda what: request.progress(f"{model}: {what}"),
    )
    if len(curve) < 2:
        raise NothingFoundError(f"No start on {model} passes the check; ask for more starts.")
    return pd.DataFrame(
        {"model": model, **point.to_dict(), "jacobian": json.dumps(point.jacobian.tolist())}
        for point in curve
    )


def _draw(axes: Axes, model: str, table: pd.DataFrame) -> None:
    x, y = distance(table["isotropy_defect"]), table["worst_case_sigma"].to_numpy()
    name, colour, side = MODELS[model]
    axes.plot(x, y, color=colour, lw=1.4, label=name)
    axes.plot(x[1:-1], y[1:-1], "o", ms=3, color=colour)
    axes.plot(x[[0, -1]], y[[0, -1]], "o", ms=6, color=colour, mec="white", mew=1)
    first = {"isotropy": "exactly isotropic", "residual": "residual minimum"}
    start = first[str(table["statement"].iloc[0])]
    beside(axes, (x[0], y[0]), f"{start} {y[0]:.5f}", (9, -4), colour)
    beside(axes, (x[-1], y[-1]), f"max-min {y[-1]:.5f}", side, colour)
