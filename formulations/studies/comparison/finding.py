"""What a comparison shows, in a paragraph made from its rows."""

from __future__ import annotations

import math
from collections.abc import Sequence

from formulations import isotropy, max_min, residual
from formulations.studies.comparison.row import Row

# Below this a residual is the solver's tolerance and no number.
_NOTHING = 1e-6


def finding(rows: Sequence[Row]) -> str:
    """Return the paragraph; empty if there is nothing to say."""
    plain = [one for one in rows if not one.variant]
    said = [text for one in plain for text in _of_row(one)]
    slow = max(rows, key=lambda one: _relative(one, plain), default=None)
    if slow is not None and _relative(slow, plain) > 1:
        said.append(
            f"Of the variants of max-min, {slow.variant} costs the most: "
            f"{_relative(slow, plain):.1f} times the default, per success."
        )
    return " ".join(said)


def _of_row(row: Row) -> list[str]:
    name = f"{row.formulation} on {row.joints} {row.model} joints"
    name = name[0].upper() + name[1:]
    if row.verdict != "solved":
        return [f"{name}: {row.verdict}."]
    share = f"{row.reached_best} of {row.starts} starts"
    if row.formulation == residual.NAME:
        value = "0, to 1e-06," if row.objective < _NOTHING else f"{row.objective:.4g}"
        text = f"{name} ends at ½‖JJᵀ − (T/m)I‖² = {value} from {share}"
        return [f"{text}; the best of them leave σ = {row.worst_case_sigma:.5f}."]
    if row.formulation in (max_min.NAME, isotropy.NAME):
        text = f"{name} reaches σ = {row.worst_case_sigma:.6f} from {share}"
        return [f"{text}, {row.gap_percent:z.2f} % below the bound (6)."]
    return []


def _relative(row: Row, plain: Sequence[Row]) -> float:
    same = [o for o in plain if (o.formulation, o.model) == (row.formulation, row.model)]
    ratio = row.seconds_per_success / same[0].seconds_per_success if same and row.variant else 0
    return 0 if math.isnan(ratio) else ratio
