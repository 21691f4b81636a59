"""The atlas: every entry verified, a row for each, and figures of the gaps and of the arms."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lockedjoint.figures.manipulator import draw
from lockedjoint.figures.style import SMALL, styled
from lockedjoint.formulations.atlas.collection import problem_of, read_atlas
from lockedjoint.formulations.atlas.entry import AtlasRow, row_of
from lockedjoint.formulations.io.table import Table
from lockedjoint.formulations.max_min import NAME as MAX_MIN
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.synthesis.from_jacobian import realise
from lockedjoint.synthesis.links import link_gap, slide_apart
from lockedjoint.synthesis.manipulator import Manipulator
from lockedjoint.synthesis.ranking import rank
from results.script import main, save, study_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Gap in percent below which it counts as none.
_LEAST = 1e-3
# Gap in percent at which the colours end.
_MOST = 100.0
# Only the light part of a colour map: numbers on it are black, and can be read on every cell,
# also where a page in dark mode turns lightness round.
_COLOURS = "YlGnBu"
_DARKEST = 0.45
_NUMBERS = "black"
_ACROSS = 6  # arms side by side
_DRAWN = 8  # joints that an arm on the page has at most


def compute(effort: Effort, folder: Path) -> Iterator[AtlasRow]:
    """Yield a row for each entry, and draw the gaps and the arms."""
    rows, arms = [], {}
    for page in read_atlas():
        effort.progress(page.entry.name)
        if problem := problem_of(page):
            raise ArithmeticError(f"{page.entry.name}: {problem}")
        row = row_of(page)
        if row.formulation == MAX_MIN:
            rows.append(row)
            shape = row.task_dimension, row.joints
            # Free columns in the plane and in space are those of joints.
            columns = row.model == "free-mean" and shape[0] == 6
            if row.joints <= _DRAWN and not columns and "rotor" not in row.model:
                model = row.model.replace(",", ",\n")
                arms[f"{model}\n{shape[0]}×{shape[1]}, k = {row.failures}"] = page.jacobian
        yield row
    effort.progress("drawings")
    save(heat_map(rows), folder / "gaps.svg")
    save(gallery(arms), folder / "arms.png")


def heat_map(rows: Sequence[AtlasRow]) -> Figure:
    """Draw one map of the gaps for each model and task dimension of several entries."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap, LogNorm

    groups = Table(AtlasRow, rows).frame().groupby(["model", "task_dimension"], sort=False)
    tables = {
        f"{model}, m = {m}": group.pivot(
            index="failures", columns="joints", values="gap_percent"
        )
        for (model, m), group in groups
        if len(group) > 1
    }
    heights = [len(table) for table in tables.values()]
    colours = ListedColormap(colormaps[_COLOURS](np.linspace(0, _DARKEST, 256)))
    scale = {"norm": LogNorm(_LEAST, _MOST), "cmap": colours, "aspect": "auto"}
    middle = {"ha": "center", "va": "center"}
    with styled(7.4, 0.6 + 0.55 * len(heights) + 0.22 * sum(heights)) as figure:
        panels = figure.subplots(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
        for axes, (title, table) in zip(panels, tables.items(), strict=True):
            for (k, n), gap in np.ndenumerate(table):
                text = "" if np.isnan(gap) else "0" if gap < _LEAST else f"{gap:.2g}"
                axes.text(n, k, text, color=_NUMBERS, fontsize=SMALL, **middle)
            shown = axes.imshow(np.clip(table, _LEAST, _MOST), **scale)
            axes.set_title(title, fontsize=SMALL)
            axes.set_xticks(range(table.shape[1]), table.columns)
            axes.set_yticks(range(table.shape[0]), table.index)
            axes.set_ylabel("k locked")
        panels[-1].set_xlabel("joints n")
        figure.colorbar(shown, ax=list(panels), shrink=0.6).set_label("gap to the bound, %")
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
