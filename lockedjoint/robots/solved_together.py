"""Max-min from all starts at once, see `climbing`; the best answer goes through Ipopt.

What comes in: an arm, its case of max-min, and starts, shape (N, n). What goes out: an
`Outcome` with one `Record` for each start, judged from its Jacobian alone, as if Ipopt had
solved it.

Starts that do not end at an optimum are solved by Ipopt from where they began. Ipopt then
solves the statement itself once more, from the best answer: a few iterations, and the better of
both answers is kept.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from lockedjoint.formulations.solving.case import Case
from lockedjoint.formulations.solving.outcome import Outcome, Record, judge
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray, one_blas_thread
from lockedjoint.nlp.options import OptionValue
from lockedjoint.nlp.problem import Solution, Status
from lockedjoint.nlp.solver import Solver
from lockedjoint.nlp.starts import Run
from lockedjoint.robots.climbing import LAST_BARRIER, Climbed, climb

# Options of Ipopt for a start that is an optimum already: with a larger barrier, or limits that
# push the start away (`bound_push`, `bound_frac`), Ipopt would leave it.
_FROM_AN_OPTIMUM: Mapping[str, OptionValue] = {
    "mu_strategy": "monotone",
    "mu_init": 1e-8,
    "bound_push": 1e-9,
    "bound_frac": 1e-9,
}
# Share by which the first level t is below σ², so that all conditions hold strictly.
_BELOW_SHARE = 1e-6


def solved_together(
    arm: RobotArm,
    case: Case,
    sample: FloatArray,
    seed: int,
    first: int,
    by_ipopt: Callable[..., Outcome],
) -> Outcome:
    """Return what N starts end at.

    Parameters
    ----------
    arm, case
        The arm, and the statement of its max-min.
    sample
        Where the starts begin, shape (N, n), radians or (prismatic joints) metres.
    seed, first
        Random seed of the run, and number of the first start: they only go into the records.
    by_ipopt
        `solving.solve.run`, with its other arguments set: it solves from the starts that do
        not end at an optimum.

    Returns
    -------
    Outcome
        N records; without any, and not complete, after Ctrl-C.
    """
    began = time.process_time()
    try:
        with one_blas_thread():
            ended = climb(arm, sample)
    except KeyboardInterrupt:
        return Outcome(case, (), complete=False)
    spent = (time.process_time() - began) / len(sample)
    records = [
        judge(case, Run(seed, first + k, _solution(case, ended, k, spent), spent))
        for k in range(len(sample))
    ]
    rest = [k for k, record in enumerate(records) if not record.trusted]
    complete = True
    if rest:
        more = by_ipopt(case, starts=len(rest), sample=sample[rest])
        complete = more.complete
        for record in more.records:
            k = rest[record.index]
            before = records[k]
            records[k] = replace(
                record,
                index=before.index,
                cpu_seconds=record.cpu_seconds + spent,
                earlier=(before.status, *record.earlier),
            )
    return Outcome(case, tuple(records), complete)


def _solution(case: Case, ended: Climbed, k: int, seconds: float) -> Solution:
    """Return what start number k ended at, as a solver of the program would: x = (q, t)."""
    status = Status(
        return_status=ended.statuses[k],
        iterations=int(ended.steps[k]),
        primal_infeasibility=float(ended.violations[k]),
        dual_infeasibility=float(ended.errors[k]),
        barrier=LAST_BARRIER,
        cpu_seconds=seconds,
        wall_seconds=seconds,
    )
    return Solution(
        problem=case.formulation.NAME,
        sense="maximise",
        status=status,
        variables=np.append(ended.points[k], ended.levels[k]),
        objective=float(np.log(ended.levels[k])),
        violation=float(ended.violations[k]),
        outputs={},
        multipliers={},
    )


def through_ipopt(outcome: Outcome) -> Outcome:
    """Replace the best record by Ipopt's answer from there, if that is trusted and no worse."""
    if not outcome.reached:
        return outcome
    best, case = outcome.best, outcome.case
    square = (1.0 - _BELOW_SHARE) * best.score**2
    problem = replace(case.build(), complete_start=lambda point: np.append(point, square))
    began = time.process_time()
    solution = Solver(problem, {**case.options, **_FROM_AN_OPTIMUM}).solve(best.variables)
    spent = time.process_time() - began
    solution = replace(solution, earlier=(*best.earlier, best.status))
    record = judge(case, Run(best.seed, best.index, solution, best.cpu_seconds + spent))
    if not (record.trusted and record.score >= best.score):
        return outcome

    def with_it(one: Record) -> Record:
        return record if one is best else one

    return replace(outcome, records=tuple(map(with_it, outcome.records)))
