"""The atlas at a glance: the gap of every entry over the number of joints and of failures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from formulations.files.figure import INK, PAPER, SMALL, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Cell = tuple[str, int, int, int, float]  # model, m, n, k, gap in percent
# Gaps below this count as none; the colours end at the largest decade.
_LEAST, _MOST = 1e-3, 100.0


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
    large = {key: found for key, found in groups.items() if len(found) > 1}
    from matplotlib.colors import LogNorm

    with styled(7.4, 0.6 + 0.95 * max(len(large), 1)) as figure:
        every = figure.subplots(max(len(large), 1), 1, squeeze=False)[:, 0]
        for axes, ((model, m), found) in zip(every, large.items(), strict=False):
            joints = range(min(cell[2] for cell in found), max(cell[2] for cell in found) + 1)
            locked = range(1, max(cell[3] for cell in found) + 1)
            values = np.full((len(locked), len(joints)), np.nan)
            for _, _, n, k, gap in found:
                values[k - 1, n - joints[0]] = gap
            shown = axes.imshow(
                np.clip(values, _LEAST, _MOST),
                norm=LogNorm(_LEAST, _MOST),
                cmap="cividis_r",
                aspect="auto",
            )
            axes.set_title(f"{model}, m = {m}", fontsize=SMALL)
            axes.set_xticks(range(len(joints)), [str(n) for n in joints])
            axes.set_yticks(range(len(locked)), [str(k) for k in locked])
            axes.set_ylabel("k")
            for (row, place), gap in np.ndenumerate(values):
                if np.isfinite(gap):
                    text = "0" if gap < _LEAST else f"{gap:.2g}"
                    colour = PAPER if gap > 1 else INK
                    axes.text(
                        place, row, text, ha="center", va="center", color=colour, fontsize=SMALL
                    )
        every[-1].set_xlabel("joints n")
        if large:
            bar = figure.colorbar(shown, ax=list(every), shrink=0.6)
            bar.set_label("gap to the bound, %")
    return figure
