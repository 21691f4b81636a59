"""The atlas: every entry verified, a row for each, and figures of the gaps and of the arms."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from formulations.atlas.collection import problem_of, read_atlas
from formulations.atlas.entry import AtlasRow, row_of
from formulations.io.study import Effort
from formulations.max_min import NAME as MAX_MIN
from formulations.plot.manipulator import draw
from formulations.plot.style import SMALL, styled
from formulations.synthesis.choice import rank
from formulations.synthesis.from_jacobian import realise
from formulations.synthesis.links import link_gap, slide_apart
from formulations.synthesis.manipulator import Manipulator
from nlp.arrays import FloatArray
from results.script import main, save, study_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Cell = tuple[str, int, int, int, float]  # model, m, n, k, gap in percent
# Gaps below this count as none; the colours end at the largest decade.
_LEAST, _MOST = 1e-3, 100.0
# Only the light part of a colour map: numbers on it are black, and can be read on every cell,
# also where a page in dark mode turns lightness round.
_COLOURS, _DARKEST, _NUMBERS = "YlGnBu", 0.45, "black"
_ACROSS = 6  # arms side by side
_DRAWN = 8  # joints that an arm on the page has at most


def compute(effort: Effort, folder: Path) -> Iterator[AtlasRow]:
    """Yield a row for each entry, and draw the gaps and the arms."""
    gaps, arms = [], {}
    for page in read_atlas():
        effort.progress(page.entry.name)
        if problem := problem_of(page):
            raise ArithmeticError(f"{page.entry.name}: {problem}")
        row = row_of(page)
        if row.formulation == MAX_MIN:
            shape = row.task_dimension, row.joints
            gaps.append((row.model, *shape, row.locked, row.gap_percent))
            # Free columns in the plane and in space are those of joints.
            if row.joints <= _DRAWN and (row.model != "free-mean" or shape[0] < 6):
                model = row.model.replace(",", ",\n")
                arms[f"{model}\n{shape[0]}×{shape[1]}, k = {row.locked}"] = page.jacobian
        yield row
    effort.progress("drawings")
    save(heat_map(gaps), folder / "gaps.svg")
    save(gallery(arms), folder / "arms.png")


def heat_map(cells: Sequence[Cell]) -> Figure:
    """Draw one map of the gaps for each model and task dimension of several entries."""
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
                text = "0" if gap < _LEAST else f"{gap:.2g}"
                place = n - joints[0], k - 1
                axes.text(*place, text, color=_NUMBERS, fontsize=SMALL, **middle)
            scale = {"norm": LogNorm(_LEAST, _MOST), "cmap": colours, "aspect": "auto"}
            shown = axes.imshow(np.clip(values, _LEAST, _MOST), **scale)
            axes.set_title(f"{model}, m = {m}", fontsize=SMALL)
            axes.set_xticks(range(len(joints)), [str(n) for n in joints])
            axes.set_yticks(range(len(locked)), [str(k) for k in locked])
            axes.set_ylabel("k locked")
        every[-1].set_xlabel("joints n")
        if large:
            bar = figure.colorbar(shown, ax=list(every), shrink=0.6)
            bar.set_label("gap to the bound, %")
    return figure


def gallery(jacobians: Mapping[str, FloatArray]) -> Figure:
    """Draw an arm for each Jacobian, titled, in the order of joints of largest clearance."""
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


STUDY = study_of(
    __file__,
    compute,
    AtlasRow,
    title="the best Jacobian known of every kind of arm, beside the bounds",
    takes="a minute",
)

if __name__ == "__main__":
    main(STUDY, __file__)
