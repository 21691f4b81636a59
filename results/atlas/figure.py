"""The atlas at a glance: the gap of every entry, and the arms that the smaller ones are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from formulations.plot.manipulator import draw
from formulations.plot.style import SMALL, styled
from formulations.synthesis.choice import rank
from formulations.synthesis.from_jacobian import realise
from formulations.synthesis.links import link_gap, slide_apart
from formulations.synthesis.manipulator import Manipulator
from nlp.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Cell = tuple[str, int, int, int, float]  # model, m, n, k, gap in percent
# Gaps below this count as none; the colours end at the largest decade.
_LEAST, _MOST = 1e-3, 100.0
# Only the light part of a colour map: numbers on it are black, and can be read on every cell,
# also where a page in dark mode turns lightness round.
_COLOURS, _DARKEST, _NUMBERS = "YlGnBu", 0.45, "black"

_ACROSS = 6  # arms side by side


def heat_map(cells: Sequence[Cell]) -> Figure:
    """Draw one map for each model and task dimension.

    Parameters
    ----------
    cells
        Model, m, n, k and the gap in percent of the bound, each.

    Returns
    -------
    matplotlib.figure.Figure
    """
    groups: dict[tuple[str, int], list[Cell]] = {}
    for cell in cells:
        groups.setdefault(cell[:2], []).append(cell)
    large = {key: group for key, group in groups.items() if len(group) > 1}
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap, LogNorm

    colours = ListedColormap(colormaps[_COLOURS](np.linspace(0, _DARKEST, 256)))
    rows = [max(cell[3] for cell in group) for group in large.values()] or [1]
    middle = {"ha": "center", "va": "center"}
    with styled(7.4, 0.6 + 0.55 * len(rows) + 0.22 * sum(rows)) as figure:
        ratios = {"height_ratios": rows}
        every = figure.subplots(len(rows), 1, squeeze=False, gridspec_kw=ratios)[:, 0]
        for axes, ((model, m), group) in zip(every, large.items(), strict=False):
            joints = range(min(cell[2] for cell in group), max(cell[2] for cell in group) + 1)
            locked = range(1, max(cell[3] for cell in group) + 1)
            values = np.full((len(locked), len(joints)), np.nan)
            for _, _, n, k, gap in group:
                values[k - 1, n - joints[0]] = gap
            shown = axes.imshow(
                np.clip(values, _LEAST, _MOST),
                norm=LogNorm(_LEAST, _MOST),
                cmap=colours,
                aspect="auto",
            )
            axes.set_title(f"{model}, m = {m}", fontsize=SMALL)
            axes.set_xticks(range(len(joints)), [str(n) for n in joints])
            axes.set_yticks(range(len(locked)), [str(k) for k in locked])
            axes.set_ylabel("k locked")
            for (row, place), gap in np.ndenumerate(values):
                if np.isfinite(gap):
                    text = "0" if gap < _LEAST else f"{gap:.2g}"
                    axes.text(place, row, text, color=_NUMBERS, fontsize=SMALL, **middle)
        every[-1].set_xlabel("joints n")
        if large:
            bar = figure.colorbar(shown, ax=list(every), shrink=0.6)
            bar.set_label("gap to the bound, %")
    return figure


def gallery(jacobians: Mapping[str, FloatArray]) -> Figure:
    """Draw an arm for each Jacobian, in the order of joints with the largest clearance.

    Parameters
    ----------
    jacobians
        Shape (m, n) each, by what is written above its arm.

    Returns
    -------
    matplotlib.figure.Figure
    """
    lines = max(1, -(-len(jacobians) // _ACROSS))
    with styled(7.4, 1.6 * lines) as figure:
        panels = figure.subplots(lines, _ACROSS, squeeze=False).ravel()
        for axes, (name, jacobian) in zip(panels, jacobians.items(), strict=False):
            draw(_arm(jacobian), axes, named=False, columns=False, weight=0.5)
            axes.set_adjustable("datalim")
            axes.set_title(name, fontsize=SMALL, loc="center")
        for axes in panels[len(jacobians) :]:
            axes.set_axis_off()
    return figure


def _arm(jacobian: FloatArray) -> Manipulator:
    """Return an arm whose links do not touch, if one is found."""
    given = realise(jacobian)
    best = rank(given, "clearance").arrangements
    chosen = given.arranged(best.orders[0].tolist(), best.flips[0].tolist())
    return slide_apart(chosen, 0) if link_gap(chosen).touching else chosen
