"""Postures whose links keep a distance: conditions are added until answers keep it.

A condition of `LinkClearance` says that two points, one fixed in each of two links, keep a
distance: a smooth function of the joints' positions. A search begins without any. Wherever its
answers leave links too near, the two nearest points become a condition, and the solver begins
again from these answers (an exchange method, as for semi-infinite programs). Each round adds
conditions and takes none away.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from lockedjoint.formulations.solving.outcome import Outcome
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.problem import FEASIBLE
from lockedjoint.robots.pose_constrained_arm import PoseConstrainedArm

#: A solver takes an arm and starts, shape (N, n), and returns the outcome with N records.
SolveFrom: TypeAlias = Callable[[PoseConstrainedArm, FloatArray], Outcome]
# Largest number of rounds: answers that then still leave links too near are not valid.
_MOST_ROUNDS = 30
# Largest number of answers whose conditions one round adds: more make its programs larger.
_MOST_ANSWERS = 10
# Largest difference of a joint between two answers that count as the same.
_SAME_ANSWER_M_OR_RAD = 1e-3


def kept_apart(
    arm: PoseConstrainedArm, ended: Outcome, points: FloatArray, solve_from: SolveFrom
) -> tuple[PoseConstrainedArm, Outcome]:
    """Add conditions where answers leave links too near, and solve again from these.

    A start that then does not converge is solved once more from where it began at first. The
    other answers meet all conditions: they are optima of the problem with these, too.

    Parameters
    ----------
    arm
        The arm; its clearance has the conditions so far.
    ended
        What the starts of this stage ended at.
    points
        Where all starts began, shape (N, n); a record's `index` is its row.
    solve_from
        Solves from other starts, with the conditions of the arm that it is given.

    Returns
    -------
    PoseConstrainedArm
        The arm with all conditions.
    Outcome
        One record for each of the records that came in, with the processor time of all rounds.
    """
    records = {record.index: record for record in ended.records}
    complete, again = ended.complete, set[int]()
    for _ in range(_MOST_ROUNDS):
        failed = {k for k, record in records.items() if not record.converged} & again
        # Optima that meet all conditions so far: only the links' distances are missing.
        near = [
            k
            for k, record in records.items()
            if record.converged and record.violation <= FEASIBLE and not record.valid
        ]
        again = set(near)
        if not complete or not (near or failed):
            break
        arm = _with_conditions(arm, [records[k].variables for k in near])
        starts = [records[k].variables if k in again else points[k] for k in (*near, *failed)]
        more = solve_from(arm, np.stack(starts))
        complete = more.complete
        for record in more.records:
            index = (*near, *failed)[record.index]
            spent = record.cpu_seconds + records[index].cpu_seconds
            records[index] = replace(record, index=index, cpu_seconds=spent)
    return arm, Outcome(ended.case, tuple(records.values()), complete)


def _with_conditions(arm: PoseConstrainedArm, answers: list[FloatArray]) -> PoseConstrainedArm:
    """Add the conditions of answers, shape (n,) each, that are apart from each other."""
    assert arm.clearance is not None
    conditions, seen = list(arm.clearance.conditions), list[FloatArray]()
    for q in answers:
        if all(np.max(np.abs(q - other)) > _SAME_ANSWER_M_OR_RAD for other in seen):
            conditions += arm.clearance.violated(q)
            seen.append(q)
        if len(seen) == _MOST_ANSWERS:
            break
    return arm.with_conditions(tuple(conditions))
