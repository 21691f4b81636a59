"""The one table: the three formulations on 7R and 8R, with unit and with free lever arms."""

from __future__ import annotations

import math

import pandas as pd

from formulations import isotropy, max_min, residual
from formulations.studies.comparison.row import Row
from formulations.studies.tables import Tables

ARMS = {
    (7, "unit-revolute"): "7R, unit lever arms",
    (7, "lever-revolute"): "7R, free lever arms",
    (8, "unit-revolute"): "8R, unit lever arms",
    (8, "lever-revolute"): "8R, free lever arms",
}
FORMULATIONS = (residual.NAME, max_min.NAME, isotropy.NAME)
HEADS = (
    "arm",
    "formulation",
    "best value",
    "certified bound",
    "gap %",
    "worst-case σ",
    "isotropy defect",
    "success",
    "CPU ms per success",
)
# Below this an isotropy defect, or a residual, is the solver's tolerance and no number.
NOTHING = 1e-6
NOTES = """\
*Best value* is what the formulation optimises, measured again from the Jacobian alone: ½‖JJᵀ
− (T/m)I‖² for residual, to be small; the worst-case singular value after one joint locks for
the other two, to be large. The *certified bound* holds for every such Jacobian: in closed
form (eq. (6), or that no residual is below 0), by a proof in exact arithmetic, or by a
relaxation with all rounding bounded; the *gap* is in percent of the best value. *Success*
counts the starts whose checked answer is within 10⁻⁶ of the best; the cost of a success is
processor time, that of failed starts included. Free lever arms have mean square at most 1.
"""


def formulation_table(tables: Tables) -> str:
    """Return the table in Markdown; a row that is not there is dashes."""
    lines = []
    for (joints, model), arm in ARMS.items():
        for name in FORMULATIONS:
            row = tables.plain(name, model, joints)
            lines.append([arm, name, *(["–"] * 7 if row is None else cells(row))])
    frame = pd.DataFrame(lines, columns=list(HEADS))
    return str(frame.to_markdown(index=False, disable_numparse=True))


def cells(row: Row) -> list[str]:
    """Return what the table shows of a row of the comparison, but for the first two columns."""
    if row.verdict != "solved":
        proof = row.certificate if row.verdict == "proved infeasible" else "–"
        success = f"{row.reached_best} of {row.starts}"
        return [row.verdict, proof, "–", "–", "–", success, "–"]
    return [
        _value(row.objective),
        f"{_value(row.certified_bound)}, {row.certificate}",
        "–" if row.objective < NOTHING else f"{row.certified_gap_percent:z.2f}",
        f"{row.worst_case_sigma:.6f}",
        _value(row.isotropy_defect),
        f"{row.reached_best} of {row.starts}",
        f"{1e3 * row.seconds_per_success:.3g}",
    ]


def _value(number: float) -> str:
    if math.isnan(number):
        return "–"
    return "0" if number == 0 else f"< {NOTHING:g}" if number < NOTHING else f"{number:.6f}"
