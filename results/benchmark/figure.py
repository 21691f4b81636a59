"""Cost against the number of joints, one line per peer, one panel per statement."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan
from typing import TYPE_CHECKING

from formulations.io.pages import groups
from formulations.plot.style import BLUE, GREY, INK, ORANGE, SMALL, VERMILION, styled
from results.benchmark.measurement import BenchmarkRow

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# By how a peer's name begins: this library's default and fast path, others of it, the floor.
# All else is grey.
_COLOURS = {
    "lockedjoint, Ipopt (default)": BLUE,
    "lockedjoint, Fatrop, compiled (fast path)": VERMILION,
    "lockedjoint": ORANGE,
    "floor": INK,
}
_MARKS = "os^Dv<>Pp*hX"


def drawn(rows: Sequence[BenchmarkRow]) -> Figure:
    """Return the figure: CPU ms per success, on a logarithmic scale.

    Raises
    ------
    InputError
        If Matplotlib is not installed.
    """
    panels = groups(rows, "formulation")
    with styled(9.0, 3.2 + 3.2 * len(panels)) as figure:
        for place, ((formulation,), same) in enumerate(panels, 1):
            axes = figure.add_subplot(len(panels), 1, place)
            for mark, ((peer,), line) in enumerate(groups(same, "peer")):
                known = [row for row in line if not isnan(row.cpu_seconds_per_success)]
                colour = next(
                    (c for begins, c in _COLOURS.items() if peer.startswith(begins)), ""
                )
                axes.plot(
                    [row.joints for row in known],
                    [1e3 * row.cpu_seconds_per_success for row in known],
                    marker=_MARKS[mark % len(_MARKS)],
                    markersize=4,
                    linewidth=1.8 if colour in (BLUE, VERMILION) else 0.9,
                    linestyle="--" if colour == INK else "-",
                    color=colour or GREY,
                    label=peer,
                )
            axes.set_yscale("log")
            axes.set_xticks(sorted({row.joints for row in same}))
            axes.set_title(formulation)
            axes.set_xlabel("joints")
            axes.set_ylabel("CPU ms per success")
            axes.legend(
                loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=SMALL, frameon=False
            )
    return figure
