"""A chosen manipulator in words and numbers, for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tabulate import tabulate

from formulations import measures
from formulations.realise.choice import Choice
from formulations.realise.dh import DenavitHartenberg
from formulations.realise.manipulator import Manipulator
from nlp.arrays import FloatArray

DIGITS = ".9g"


def summary(choice: Choice, deviation: float) -> dict[str, object]:
    """Return how a manipulator was chosen and how failure tolerant it is, as plain values."""
    worst = measures.worst_case_sigma(choice.manipulator.jacobian())
    return {**choice.to_dict(), "worst_case_sigma": worst, "deviation": deviation}


def summary_lines(found: Mapping[str, Any]) -> dict[str, object]:
    """Return a summary as lines for people: signs for flips, a line for each criterion."""
    lines: dict[str, object] = {
        "order": found["order"],
        "signs": "".join("-" if flip else "+" for flip in found["flips"]),
        "chosen by": found["criterion"],
        "looked at": found["method"],
        "orders and signs": found["arrangements"],
        "distinct manipulators": found["distinct"],
        "deviation from the Jacobian": found["deviation"],
        "worst case sigma": found["worst_case_sigma"],
    }
    return {**lines, **found["criteria"]}


def axes_text(manipulator: Manipulator) -> str:
    """Return the axes as a table: direction, and the point where the joint sits."""
    rows = [
        [
            i,
            manipulator.columns[i],
            "P" if manipulator.prismatic[i] else "R",
            *manipulator.directions[i],
            *manipulator.points[i],
        ]
        for i in range(manipulator.joints)
    ]
    names = ["joint", "column", "kind", *(f"axis {c}" for c in "xyz"), *"xyz"]
    tip = "  ".join(f"{value:{DIGITS}}" for value in manipulator.end_effector)
    return f"{_table(rows, names)}\n\nend effector  {tip}"


def dh_text(table: DenavitHartenberg) -> str:
    """Return the Denavit–Hartenberg table, and the base and tool transforms."""
    columns = zip(table.theta, table.d, table.a, table.alpha, strict=True)
    rows = [
        [i, "P" if table.prismatic[i] else "R", *numbers] for i, numbers in enumerate(columns)
    ]
    names = ["joint", "kind", "theta", "d", "a", "alpha"]
    if table.convention.value == "modified":
        names[4:] = ["a before", "alpha before"]
    parts = [f"{table.convention.value} convention", _table(rows, names)]
    parts += [f"base\n{_matrix(table.base)}", f"tool\n{_matrix(table.tool)}"]
    return "\n\n".join(parts)


def _matrix(pose: FloatArray) -> str:
    return str(tabulate(pose.tolist(), tablefmt="plain", floatfmt=DIGITS))


def _table(rows: Sequence[Sequence[object]], names: Sequence[str]) -> str:
    return str(tabulate(rows, names, tablefmt="simple", floatfmt=DIGITS))
