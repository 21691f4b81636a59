"""What the bounds show, in a paragraph made from their rows."""

from __future__ import annotations

from collections.abc import Sequence

from formulations.studies.bounds.rows import BoundRow, ExistenceRow
from formulations.studies.digits import rounded_down, rounded_up


def finding(bounds: Sequence[BoundRow], relaxations: Sequence[ExistenceRow]) -> str:
    """Return the paragraph; empty if there is nothing to say."""
    said = [_relaxation(row) for row in relaxations]
    said += [_sharpest(bounds, "residual", kind) for kind in ("rigorous", "numerical")]
    said += [_sharpest(bounds, "max-min", kind) for kind in ("rigorous", "numerical")]
    return " ".join(filter(None, said))


def sharpest(bounds: Sequence[BoundRow], quantity: str, kind: str) -> BoundRow | None:
    """Return the sharpest bound of a kind on seven unit revolute joints, if there is one."""
    found = [
        row for row in bounds if (row.quantity, row.kind, row.joints) == (quantity, kind, 7)
    ]
    pick = max if quantity == "residual" else min
    return pick(found, key=lambda row: row.bound) if found else None


def _relaxation(row: ExistenceRow) -> str:
    alone = f" ({row.infeasible_alone} alone)" if row.infeasible_alone else ""
    return f"The moment relaxation of order {row.order} is {row.verdict}{alone}."


def _sharpest(bounds: Sequence[BoundRow], quantity: str, kind: str) -> str:
    row = sharpest(bounds, quantity, kind)
    if row is None:
        return ""
    if quantity == "residual":
        said = f"½‖JJᵀ − (7/3)I‖² ≥ {rounded_down(row.bound, 9)}"
    else:
        said = f"σ ≤ {rounded_up(row.bound, 7)}"
    return (
        f"For unit revolute 7R {said}, {kind} ({row.preset}); "
        f"{row.best_known:.9g} is attained, {row.gap_percent:.2g} % away."
    )
