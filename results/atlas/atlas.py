"""The atlas: every entry verified, a row for each, and figures of the gaps and of the arms.

An entry is a question: the best Jacobian, shape (m, n), of a model of columns, for a
formulation and a number k of joints that lock. What comes in: the best known answers, in the
files of formulations/atlas. What goes out: ``atlas.csv`` with an `AtlasRow` for each entry,
whose columns formulations/atlas/entry.py describes; ``gaps.svg``, a map over n and k of how far
the worst case is below its proved bound, in percent; ``arms.png``, an arm for each Jacobian
with few joints.

Nothing is searched for here: `search` and the command ``lockedjoint atlas improve`` do that.
Constants at the top only change the figures.
"""

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

# A gap below this counts as none: its cell says 0 and has the lightest colour.
_NO_GAP_PERCENT = 1e-3
# A gap of this or more has the darkest colour.
_FULL_GAP_PERCENT = 100.0
# The colour map of the gaps, of matplotlib.
_COLOURS = "YlGnBu"
# The colours end at this part of the map, from 0 to 1. Only its light part is used: numbers on
# it can be read on every cell, also where a page in dark mode inverts lightness.
_DARKEST = 0.45
# The colour of the numbers.
_NUMBERS = "black"
# The number of colours: with many fewer of them, steps would be seen.
_SHADES = 256
# The number of arms side by side.
_ARMS_IN_A_LINE = 6
# Arms of more joints are not drawn: they are hard to recognise at this size.
_MOST_JOINTS_DRAWN = 8
# The width of both figures, in inches.
_WIDTH_INCHES = 7.4
# The height of a line of arms, in inches.
_LINE_INCHES = 1.6
# The height of the map without any panel, in inches: for the axis and its label.
_MARGIN_INCHES = 0.6
# The height that each panel has for its title and ticks, in inches.
_PANEL_INCHES = 0.55
# The height of a row of cells, in inches.
_CELL_INCHES = 0.22


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
            if row.joints <= _MOST_JOINTS_DRAWN and not columns and "rotor" not in row.model:
                model = row.model.replace(",", ",\n")
                arms[f"{model}\n{shape[0]}×{shape[1]}, k = {row.failures}"] = page.jacobian
        yield row
    effort.progress("drawings")
    save(heat_map(rows), folder / "gaps.svg")
    save(gallery(arms), folder / "arms.png")


def heat_map(rows: Sequence[AtlasRow]) -> Figure:
    """Draw one map of the gaps for each model and task dimension of several entries.

    A row of cells is a number k of locked joints, a column a number n of joints. A cell is
    empty where the atlas has no entry.
    """
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
    colours = ListedColormap(colormaps[_COLOURS](np.linspace(0, _DARKEST, _SHADES)))
    scale = {
        "norm": LogNorm(_NO_GAP_PERCENT, _FULL_GAP_PERCENT),
        "cmap": colours,
        "aspect": "auto",
    }
    middle = {"ha": "center", "va": "center"}
    inches = _MARGIN_INCHES + _PANEL_INCHES * len(heights) + _CELL_INCHES * sum(heights)
    with styled(_WIDTH_INCHES, inches) as figure:
        panels = figure.subplots(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
        for axes, (title, table) in zip(panels, tables.items(), strict=True):
            for (k, n), gap in np.ndenumerate(table):
                text = "" if np.isnan(gap) else "0" if gap < _NO_GAP_PERCENT else f"{gap:.2g}"
                axes.text(n, k, text, color=_NUMBERS, fontsize=SMALL, **middle)
            shown = axes.imshow(np.clip(table, _NO_GAP_PERCENT, _FULL_GAP_PERCENT), **scale)
            axes.set_title(title, fontsize=SMALL)
            axes.set_xticks(range(table.shape[1]), table.columns)
            axes.set_yticks(range(table.shape[0]), table.index)
            axes.set_ylabel("k locked")
        panels[-1].set_xlabel("joints n")
        figure.colorbar(shown, ax=list(panels), shrink=0.6).set_label("gap to the bound, %")
    return figure


def gallery(jacobians: Mapping[str, FloatArray]) -> Figure:
    """Draw an arm for each Jacobian, by its title: Jacobians have the shape (m, n).

    A Jacobian leaves the order of the joints open: of some orders the one is drawn whose links
    have the largest clearance.
    """
    # The number of lines is rounded up.
    lines = max(1, -(-len(jacobians) // _ARMS_IN_A_LINE))
    with styled(_WIDTH_INCHES, _LINE_INCHES * lines) as figure:
        panels = figure.subplots(lines, _ARMS_IN_A_LINE, squeeze=False).ravel()
        for axes, (name, jacobian) in zip(panels, jacobians.items(), strict=False):
            draw(_arm(jacobian), axes, named=False, columns=False, weight=0.5)
            axes.set_adjustable("datalim")
            axes.set_title(name, fontsize=SMALL, loc="center")
        for axes in panels[len(jacobians) :]:
            axes.set_axis_off()
    return figure


def _arm(jacobian: FloatArray) -> Manipulator:
    """Return an arm with this Jacobian, shape (m, n), whose links do not touch if one is found.

    Joints in the best order may still touch; then they slide along their axes, which changes no
    Jacobian.
    """
    given = realise(jacobian)
    best = rank(given, "clearance").arrangements
    chosen = given.arranged(best.orders[0].tolist(), best.flips[0].tolist())
    return slide_apart(chosen, 0) if link_gap(chosen).touching else chosen


STUDY = study_of(
    __file__,
    compute,
    AtlasRow,
    title="the best Jacobian known of every kind of arm, beside the bounds",
    takes="four minutes",
)

if __name__ == "__main__":
    main(STUDY, __file__)
