"""One case's outcome as one row of numbers, every one measured from the Jacobian alone."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from formulations import measures
from formulations.bounds import unequal_failures
from formulations.measures.canonical import distinct
from formulations.measures.failure_model import FailureModel
from formulations.measures.unequal_failures import expected_sigma, possible_worst_case_sigma
from formulations.solving.outcome import Outcome
from formulations.solving.solve import run
from formulations.studies.failures.cases import Case
from formulations.unequal_max_min import merit
from nlp.arrays import FloatArray


@dataclass(frozen=True)
class Row:
    """The columns of ``failures.csv``; NaN where nothing passed the check.

    Attributes
    ----------
    model, task_dimension, joints, locked, failing, goal, encoding, starts_from, starts
        What was run.
    solved, reached_best
        Starts at which Ipopt said that it succeeded, and whose answer, checked, is the best.
    merit, bound, gap_percent
        What is maximised, its bound, and the gap between them.
    worst_case_sigma, expected_sigma
        Over the failures that can happen, of the same Jacobian.
    distinct_optima
        Classes among the starts that reached the best where all joints are alike; 0 elsewhere.
    iterations_median, milliseconds_per_start
        Processor time, with the drawing of the start, without building the solver.
    """

    model: str
    task_dimension: int
    joints: int
    locked: int
    failing: str
    goal: str
    encoding: str
    starts_from: str
    starts: int
    solved: int
    reached_best: int
    merit: float
    bound: float
    gap_percent: float
    worst_case_sigma: float
    expected_sigma: float
    distinct_optima: int
    iterations_median: float
    milliseconds_per_start: float

    def to_dict(self) -> dict[str, object]:
        """Return the columns as plain values."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class Summary:
    """A row and the Jacobian that it shows."""

    row: Row
    jacobian: FloatArray
    complete: bool


def solve(
    case: Case, *, starts: int, seed: int, workers: int, progress: bool = True
) -> Summary | None:
    """Solve a case from all starts; None if the user interrupted before the first ended."""
    outcome = run(
        case.setup,
        joints=case.joints,
        task_dimension=case.task_dimension,
        starts=starts,
        seed=seed,
        workers=workers,
        progress=progress,
    )
    return _summary(case, outcome) if outcome.records else None


def _summary(case: Case, outcome: Outcome) -> Summary:
    setup, records = case.setup, outcome.records
    best, shown = outcome.reached, outcome.best
    n, k = case.joints, setup.locked
    failures = setup.failures or FailureModel.equally_likely(n, k)
    alike = setup.failures is None
    found = merit(shown.jacobian, failures, setup.goal) if best else float("nan")
    bound = _bound(case, outcome, shown.jacobian)
    line = Row(
        model=setup.model,
        task_dimension=case.task_dimension,
        joints=n,
        locked=k,
        failing=case.failing,
        goal=setup.goal,
        encoding=setup.encoding,
        starts_from="residual minima" if setup.from_residual_minima else "random",
        starts=len(records),
        solved=outcome.succeeded,
        reached_best=len(best),
        merit=found,
        bound=bound,
        gap_percent=measures.gap_percent(found, bound),
        worst_case_sigma=possible_worst_case_sigma(shown.jacobian, failures),
        expected_sigma=expected_sigma(shown.jacobian, failures),
        distinct_optima=len(distinct([one.jacobian for one in best])) if best and alike else 0,
        iterations_median=float(np.median([one.status.iterations for one in records])),
        milliseconds_per_start=1e3 * float(np.mean([one.cpu_seconds for one in records])),
    )
    return Summary(line, shown.jacobian, outcome.complete)


def _bound(case: Case, outcome: Outcome, jacobian: FloatArray) -> float:
    setup, m = case.setup, case.task_dimension
    if setup.failures is None:
        trace = outcome.arm.largest_trace
        return measures.sigma_bound(m, case.joints, trace, setup.locked)
    norms = np.sum(jacobian**2, axis=0).tolist()
    bounds = {
        "worst": unequal_failures.weighted_worst_bound,
        "expected": unequal_failures.expected_bound,
    }
    return bounds[setup.goal](m, norms, setup.failures)
