"""What the benchmark shows, in a paragraph made from its rows."""

from __future__ import annotations

from collections.abc import Sequence

from formulations.studies.benchmark.measurement import Row


def finding(rows: Sequence[Row]) -> str:
    """Return the paragraph; empty if there is nothing to say."""
    said = []
    for formulation in dict.fromkeys(row.formulation for row in rows):
        seven = [
            row
            for row in rows
            if (row.formulation, row.joints) == (formulation, 7)
            and row.cpu_seconds_per_success == row.cpu_seconds_per_success
        ]
        ours = [row for row in seven if row.peer.startswith("lockedjoint")]
        others = [row for row in seven if not row.peer.startswith(("lockedjoint", "floor"))]
        if ours:
            said.append(
                f"{formulation.capitalize()} on 7R: {_cost(ours[0])}; "
                f"{_least(ours)}{_beside(others)}."
            )
    return " ".join(said)


def _cost(row: Row) -> str:
    return (
        f"{row.peer} takes {1e3 * row.cpu_seconds_per_success:.3g} ms of processor per success"
    )


def _least(rows: Sequence[Row]) -> str:
    least = min(rows, key=lambda row: row.cpu_seconds_per_success)
    return f"{least.peer} takes {1e3 * least.cpu_seconds_per_success:.3g}"


def _beside(rows: Sequence[Row]) -> str:
    if not rows:
        return ""
    best = min(rows, key=lambda row: row.cpu_seconds_per_success)
    worst = max(rows, key=lambda row: row.cpu_seconds_per_success)
    return (
        f"; among the others, {best.peer} takes {1e3 * best.cpu_seconds_per_success:.3g} and "
        f"{worst.peer} {1e3 * worst.cpu_seconds_per_success:.3g}"
    )
