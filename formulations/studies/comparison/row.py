"""One setup's outcome as one row of numbers."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

import numpy as np

from formulations import measures
from formulations.catalogue import certified_bound, numerical_bound
from formulations.measures.canonical import distinct
from formulations.solving.outcome import Outcome
from formulations.solving.record import Record


@dataclass(frozen=True)
class Row:
    """The columns of ``comparison.csv``; NaN where a column does not apply.

    Attributes
    ----------
    formulation, variant, model, joints, task_dimension, starts
        What was run; `starts` counts those that ended.
    verdict
        `Outcome.verdict`.
    solved
        Starts at which Ipopt said that it succeeded.
    reached_best
        Starts whose answer, checked from J alone, is within `REACH` of the best.
    objective
        What the formulation optimises, recomputed from the best J: ½‖JJᵀ − (T/m)I‖² for the
        residual, the worst-case singular value for the other two.
    worst_case_sigma, sigma_bound, gap_percent
        Eq. (5) for the best J, the bound (6) at the model's largest ‖J‖_F, and the gap.
    certified_bound, certified_gap_percent, certificate
        What is proved about the objective for every Jacobian of the model, how far the
        objective is from it in percent of the objective, and the kind of proof
        (`formulations.bounds.certified`).
    numerical_bound, numerical_gap_percent
        The same, checked in floating point only, where such a bound is on record.
    condition_number, isotropy_defect
        Of the best J; if nothing passed the check, of the least violation found.
    violation
        Largest violation of any constraint there.
    distinct_optima
        Classes among the starts that reached the best, modulo frame, phase, order and signs.
    iterations_median, seconds_per_start, seconds_per_success
        Processor time, with the drawing of the start, without building the solver.
    status_counts
        Ipopt's return statuses and how often each came, as JSON.
    """

    formulation: str
    variant: str
    model: str
    joints: int
    task_dimension: int
    starts: int
    verdict: str
    solved: int
    reached_best: int
    objective: float
    worst_case_sigma: float
    sigma_bound: float
    gap_percent: float
    certified_bound: float
    certified_gap_percent: float
    certificate: str
    numerical_bound: float
    numerical_gap_percent: float
    condition_number: float
    isotropy_defect: float
    violation: float
    distinct_optima: int
    iterations_median: float
    seconds_per_start: float
    seconds_per_success: float
    status_counts: str

    def to_dict(self) -> dict[str, object]:
        """Return the columns as plain values."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class Summary:
    """A row and the record that it shows."""

    row: Row
    record: Record


def summarise(outcome: Outcome) -> Summary:
    """Sum up an outcome of at least one record, and keep the record that the row shows."""
    setup, records = outcome.setup, outcome.records
    m, n = outcome.arm.shape
    best, shown = outcome.reached, outcome.best
    nan = float("nan")
    sigma = shown.worst_case_sigma if best else nan
    bound = measures.sigma_bound(m, n, outcome.arm.largest_trace, setup.locked)
    seconds = sum(record.cpu_seconds for record in records)
    objective = shown.merit if best else nan
    proved = certified_bound(setup.formulation, outcome.arm, setup.locked)
    checked = numerical_bound(setup.formulation, outcome.arm)
    line = Row(
        formulation=setup.formulation,
        variant=setup.variant,
        model=setup.model,
        joints=n,
        task_dimension=m,
        starts=len(records),
        verdict=outcome.verdict,
        solved=outcome.succeeded,
        reached_best=len(best),
        objective=objective,
        worst_case_sigma=sigma,
        sigma_bound=bound,
        gap_percent=measures.gap_percent(sigma, bound) if best else nan,
        certified_bound=proved.value,
        certified_gap_percent=proved.gap_percent(objective),
        certificate=proved.kind,
        numerical_bound=checked.value if checked else nan,
        numerical_gap_percent=checked.gap_percent(objective) if checked else nan,
        condition_number=shown.condition_number,
        isotropy_defect=shown.isotropy_defect,
        violation=shown.violation,
        distinct_optima=len(distinct([record.jacobian for record in best])) if best else 0,
        iterations_median=float(np.median([record.status.iterations for record in records])),
        seconds_per_start=seconds / len(records),
        seconds_per_success=seconds / len(best) if best else nan,
        status_counts=json.dumps(outcome.status_counts),
    )
    return Summary(line, shown)
