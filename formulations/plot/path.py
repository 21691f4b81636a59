"""What is left along a path: the worst-case singular value, and which joints may lock when."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from formulations.plot.style import BLUE, GREY, PALE, SMALL, styled, without_frame

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from formulations.paths.plan import PathPlan

_WIDTH, _HEIGHT = 6.5, 4.6


def draw(found: PathPlan) -> Figure:
    """Draw σ and the survivors along a path, beside those of the minimum-norm trajectory."""
    times, count = found.times, len(found.joints)
    with styled(_WIDTH, _HEIGHT) as figure:
        above, middle, below = figure.subplots(
            3, 1, sharex=True, height_ratios=[2, 2, 0.35 * count]
        )
        for axes, heading in (
            (above, "worst-case σ"),
            (middle, "number of joints that may lock"),
        ):
            for one, colour, name in (
                (found.minimum_norm, GREY, "minimum norm"),
                (found.planned, BLUE, "planned"),
            ):
                if one is not None:
                    values = one.sigma if axes is above else one.survives.sum(axis=1)
                    axes.plot(times, values, color=colour, lw=1.5, label=name)
            axes.set_title(heading)
            axes.set_ylim(bottom=0)
            without_frame(axes, "left", "bottom")
        # Beside the heading, where no line is.
        corner = {"loc": "lower right", "bbox_to_anchor": (1, 1), "borderpad": 0}
        above.legend(frameon=False, fontsize=SMALL, ncols=2, **corner)
        middle.set_ylim(0, count + 0.3)
        middle.set_yticks(range(0, count + 1, 1 if count < 6 else 2))
        # A bar for each joint and each time at which it may lock.
        edges = np.concatenate([times[:1], (times[1:] + times[:-1]) / 2, times[-1:]])
        for f in range(count):
            below.barh(f, edges[-1] - edges[0], left=edges[0], height=0.6, color=PALE)
            kept = found.planned.survives[:, f]
            below.barh(
                np.full(int(kept.sum()), f),
                np.diff(edges)[kept],
                left=edges[:-1][kept],
                height=0.6,
                color=BLUE,
            )
        below.set_yticks(range(count), found.joints)
        below.invert_yaxis()
        below.set_title("when each joint may lock (blue), on the planned trajectory")
        below.set_xlabel("time (s)")
        without_frame(below, "left", "bottom")
        for value in found.times[np.abs(found.places - np.round(found.places)) < 1e-9]:
            below.axvline(value, color=GREY, lw=0.5, ls=":")
        return figure
