"""What is left along a path: the worst-case singular value, and which joints may lock when."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from formulations.plot.style import BLUE, GREY, PALE, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from formulations.paths.plan import PathPlan


def draw(plan: PathPlan) -> Figure:
    """Draw σ and the survivors along a path, beside those of the minimum-norm trajectory."""
    times, count = plan.times, len(plan.joints)
    with styled(6.5, 4.6) as figure:
        from matplotlib.colors import ListedColormap

        ratios = [2, 2, 0.35 * count]
        above, middle, below = figure.subplots(3, 1, sharex=True, height_ratios=ratios)
        for trajectory, colour, name in (
            (plan.minimum_norm, GREY, "minimum norm"),
            (plan.planned, BLUE, "planned"),
        ):
            if trajectory is not None:
                above.plot(times, trajectory.sigma, color=colour, lw=1.5, label=name)
                middle.plot(times, trajectory.survives.sum(axis=1), color=colour, lw=1.5)
        above.set_title("worst-case σ")
        above.set_ylim(bottom=0)
        # Beside the heading, where no line is.
        above.legend(ncols=2, loc="lower right", bbox_to_anchor=(1, 1), borderpad=0)
        middle.set_title("number of joints that may lock")
        middle.set_ylim(0, count + 0.3)
        middle.set_yticks(range(0, count + 1, 1 if count < 6 else 2))
        # A cell for each joint and each sample, and white between the joints.
        edges = np.concatenate([times[:1], (times[1:] + times[:-1]) / 2, times[-1:]])
        rows, colours = np.arange(count + 1) - 0.5, ListedColormap([PALE, BLUE])
        below.pcolormesh(edges, rows, plan.planned.survives.T, cmap=colours, vmin=0, vmax=1)
        below.hlines(rows, edges[0], edges[-1], color="white", lw=4)
        below.set_yticks(range(count), plan.joints)
        below.invert_yaxis()
        below.set_title("when each joint may lock (blue), on the planned trajectory")
        below.set_xlabel("time (s)")
        for value in plan.times[np.abs(plan.places - np.round(plan.places)) < 1e-9]:
            below.axvline(value, color=GREY, lw=0.5, ls=":")
        return figure
