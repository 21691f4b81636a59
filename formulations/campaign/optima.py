"""The optima of a study: how many starts reached each, and its canonical form."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Any

import pandas as pd

from formulations.campaign.columns import jacobian_of
from formulations.campaign.frame import PROBLEM, REACH, frame
from formulations.canonical import canonical_form, distinct
from formulations.catalogue import formulation
from nlp.solution import SUCCESS
from nlp.store import Row, Store
from nlp.store_schema import Condition

# Telling Jacobians apart takes milliseconds each, more where every start has its own: a
# histogram of the first thousand says what one of a million would.
CLASSIFIED = 1000
# Where optima come in families every start has its own: only so many of a level are listed.
LISTED = 10
_COLUMNS = ("status", "valid", "merit", "worst_case_sigma", "jacobian")
_FOUND = ("level", "merit", "worst_case_sigma", "classes", "reached", "of_starts")


def optima(store: Store, conditions: Sequence[Condition] = ()) -> pd.DataFrame:
    """Return one row per optimum, best level first within each problem.

    Optima are classes of Jacobians modulo frame, phase, order and signs, of answers that the
    solver calls solved and that pass the check.

    Returns
    -------
    DataFrame
        What names the problem, then: ``level``, 1 for the best value of the merit, 2 for the
        next; ``merit``, ``worst_case_sigma``; ``classes``, how many optima the level has, of
        which the `LISTED` most reached are listed; ``reached``, starts that ended at this
        one; ``of_starts``, starts that were classified, the first `CLASSIFIED` that ended
        at any optimum; ``canonical_form``, the Jacobian that stands for it, as JSON.
    """
    cells = frame(store, conditions, PROBLEM).drop_duplicates()
    lines: list[dict[str, Any]] = []
    for cell in cells.to_dict("records"):
        problem = {str(name): value for name, value in cell.items()}
        lines += _of_problem(store, conditions, problem)
    return pd.DataFrame(lines, columns=[*PROBLEM, *_FOUND, "canonical_form"])


def _of_problem(
    store: Store, conditions: Sequence[Condition], problem: dict[str, Any]
) -> Iterator[dict[str, Any]]:
    ended = [Condition("status", "=", SUCCESS), Condition("valid", "=", 1)]
    here = [Condition(name, "=", value) for name, value in problem.items()]
    rows = list(islice(store.rows([*conditions, *here, *ended], _COLUMNS), CLASSIFIED))
    shape = problem["task_dimension"], problem["joints"]
    best_first = formulation(problem["formulation"]).SENSE == "maximise"
    for level, members in enumerate(_levels(rows, best_first), 1):
        jacobians = [jacobian_of(row["jacobian"], *shape) for row in members]  # type: ignore[arg-type]
        classes = sorted(distinct(jacobians), key=len, reverse=True)
        for one in classes[:LISTED]:
            yield {
                **problem,
                "level": level,
                "merit": members[one[0]]["merit"],
                "worst_case_sigma": members[one[0]]["worst_case_sigma"],
                "classes": len(classes),
                "reached": len(one),
                "of_starts": len(rows),
                "canonical_form": json.dumps(canonical_form(jacobians[one[0]]).tolist()),
            }


def _levels(rows: Sequence[Row], largest_first: bool) -> Iterator[list[Row]]:
    """Yield rows of equal merit, best first."""
    level: list[Row] = []
    for row in sorted(rows, key=_merit, reverse=largest_first):
        if level and abs(_merit(row) - _merit(level[-1])) > REACH:
            yield level
            level = []
        level.append(row)
    if level:
        yield level


def _merit(row: Row) -> float:
    return float(row["merit"])  # type: ignore[arg-type]
