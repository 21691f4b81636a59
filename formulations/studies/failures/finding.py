"""What the study of failures shows, in a paragraph made from its rows."""

from __future__ import annotations

import math
from collections.abc import Sequence

from formulations.studies.failures.row import Row

# A gap below this, in percent, is none.
_CLOSED = 1e-4


def finding(rows: Sequence[Row]) -> str:
    """Return the paragraph; empty if there is nothing to say."""
    found = [one for one in rows if not math.isnan(one.gap_percent)]
    several = [one for one in found if one.locked > 1]
    spared = [one for one in found if "never" in one.failing]
    said = []
    closed = [one for one in several if one.gap_percent < _CLOSED]
    if closed:
        names = ", ".join(dict.fromkeys(_arm(one) for one in closed))
        said.append(
            f"With several joints locked at once the proved bound is attained by {names}."
        )
    open_gaps = [one for one in several if one not in closed]
    if open_gaps:
        least = min(open_gaps, key=lambda one: one.gap_percent)
        most = max(open_gaps, key=lambda one: one.gap_percent)
        said.append(
            f"Elsewhere the best found stays {least.gap_percent:.1f} % ({_arm(least)}) to "
            f"{most.gap_percent:.1f} % ({_arm(most)}) below it."
        )
    for one in spared:
        verb = "reaches its bound" if one.gap_percent < _CLOSED else "stays below its bound"
        gap = "" if one.gap_percent < _CLOSED else f" by {one.gap_percent:.2f} %"
        said.append(
            f"Revolute {one.task_dimension}×{one.joints} with {one.failing} failing "
            f"{verb}{gap}: σ = {one.merit:.5f}."
        )
    return " ".join(said)


def _arm(row: Row) -> str:
    return f"{row.model} {row.task_dimension}×{row.joints}, {row.locked} locked"
