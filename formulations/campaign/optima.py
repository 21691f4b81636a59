"""The optima of a study: how many starts reached each, and its canonical form.

Records come by in the order of their merit, so that one level is there at a time and memory
does not grow with their number.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import pandas as pd

from formulations import measures
from formulations.campaign.columns import jacobian_of
from formulations.campaign.groups import PROBLEM, REACH
from formulations.catalogue import arm, formulation
from formulations.joints.arm import Arm
from formulations.joints.kinds import LeverRevolute, Prismatic, UnitRevolute
from formulations.measures.canonical import Symmetry, canonical_form
from formulations.measures.invariants import Classes
from nlp.solution import SUCCESS
from nlp.store import Row, Store
from nlp.store_schema import Condition

# Where optima come in families every start has its own: only so many of a level are listed.
LISTED = 10
# Where starts end anywhere every one has its own level: only the best are listed.
LEVELS = 100
_COLUMNS = ("merit", "worst_case_sigma", "jacobian")
_FOUND = ("level", "merit", "worst_case_sigma", "classes", "reached", "of_starts")


def optima(store: Store, conditions: Sequence[Condition] = ()) -> pd.DataFrame:
    """Return one row per optimum, best level first within each problem.

    Optima are classes of Jacobians modulo frame, phase, order and signs, of answers that the
    solver calls solved and that pass the check.

    Returns
    -------
    DataFrame
        What names the problem, then: ``level``, 1 for the best value of the merit, 2 for the
        next, up to `LEVELS`; ``merit``, ``worst_case_sigma``; ``classes``, how many optima
        the level has, of which the `LISTED` most reached are listed, and of which no more
        than `formulations.measures.invariants.MOST` are told apart; ``reached``, starts that
        ended at this one; ``of_starts``, starts that ended at any optimum;
        ``canonical_form``, the Jacobian that stands for it, as JSON.
    """
    lines: list[dict[str, Any]] = []
    for problem in store.distinct(PROBLEM, conditions):
        lines += _of_problem(store, conditions, problem)
    return pd.DataFrame(lines, columns=[*PROBLEM, *_FOUND, "canonical_form"])


def _of_problem(
    store: Store, conditions: Sequence[Condition], problem: Row
) -> list[dict[str, Any]]:
    ended = [Condition("status", "=", SUCCESS), Condition("valid", "=", 1)]
    here = [Condition(name, "=", value) for name, value in problem.items()]
    m, n = int(problem["task_dimension"]), int(problem["joints"])  # type: ignore[arg-type]
    symmetry = symmetry_of_arm(arm(str(problem["model"]), n, m))
    downwards = formulation(str(problem["formulation"])).SENSE == "maximise"
    rows = store.rows(
        [*conditions, *here, *ended], _COLUMNS, order="merit", descending=downwards
    )
    lines: list[dict[str, Any]] = []
    starts = 0
    for level, members in enumerate(_levels(rows), 1):
        classes = Classes(symmetry)
        for row in members:
            starts += 1
            if level <= LEVELS:
                classes.add(jacobian_of(row["jacobian"], m, n), _merit(row))  # type: ignore[arg-type]
        if level <= LEVELS:
            lines += _of_level(level, classes, symmetry, int(problem["locked"]))  # type: ignore[arg-type]
    return [{**problem, **line, "of_starts": starts} for line in lines]


def _of_level(
    level: int, classes: Classes, symmetry: Symmetry, locked: int
) -> Iterator[dict[str, Any]]:
    found = classes.most_reached()
    for one in found[:LISTED]:
        form = canonical_form(one.jacobian, symmetry)
        yield {
            "level": level,
            "merit": one.merit,
            "worst_case_sigma": measures.worst_case_sigma(one.jacobian, locked),
            "classes": len(found),
            "reached": one.reached,
            "canonical_form": json.dumps(form.tolist()),
        }


def symmetry_of_arm(built: Arm) -> Symmetry:
    """Return what leaves every Jacobian of an arm the same."""
    kinds = {type(joint) for joint in built.joints}
    if kinds == {UnitRevolute}:
        return Symmetry.UNIT_REVOLUTE
    if kinds <= {UnitRevolute, LeverRevolute, Prismatic}:
        return Symmetry.REVOLUTE
    return Symmetry.FRAME


def _levels(rows: Iterable[Row]) -> Iterator[Iterator[Row]]:
    """Yield runs of rows whose merits are each near the last; use each before the next."""
    waiting = iter(rows)
    head = next(waiting, None)

    def level() -> Iterator[Row]:
        nonlocal head
        while head is not None:
            last = _merit(head)
            yield head
            head = next(waiting, None)
            if head is None or abs(_merit(head) - last) > REACH:
                return

    while head is not None:
        yield level()


def _merit(row: Row) -> float:
    return float(row["merit"])  # type: ignore[arg-type]
