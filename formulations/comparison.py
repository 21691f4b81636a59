"""All formulations from common starts, side by side in one table: the rows of ``compare``.

A *case* is a formulation on an arm with its settings (`Case`); what its starts came to is an
`Outcome`; a row, `ComparisonRow`, has the numbers of one outcome. J is a Jacobian, shape (m,
n), T = ‖J‖_F².
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isnan
from typing import Any

import numpy as np

from lockedjoint.formulations import isotropy, max_min, measures, residual
from lockedjoint.formulations.io.rounding import outward
from lockedjoint.formulations.io.table import HIDDEN, Table, column, row_from
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.models import arm, models_of
from lockedjoint.formulations.registry import FORMULATIONS, Formulation, registered
from lockedjoint.formulations.solving.case import NOTHING, Case
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.formulations.solving.outcome import Outcome
from lockedjoint.formulations.solving.solve import run
from lockedjoint.nlp.executors import default_workers

#: Number of random starts of each case where a user names none.
STARTS = 100
NAN = float("nan")
# Significant digits of a proved bound in a table.
_BOUND_DIGITS = 7
# Columns that name a Jacobian in the file of them.
_NAMES = ("formulation", "variant", "model", "verdict")


@dataclass(frozen=True)
class ComparisonRow:
    """One case's outcome: the columns of ``comparison.csv``; NaN where one does not apply.

    Six of them are shown in tables.

    Attributes
    ----------
    formulation, variant, model, joints, task_dimension, verdict, starts
        What was run, and `Outcome.verdict`; `starts` counts those that ended.
    solved
        Starts at which Ipopt said that it succeeded.
    reached_best
        Starts whose answer, checked from J alone, is within `REACHED_BEST` of the best.
    score
        What the formulation optimises, recomputed from the best J: ½‖JJᵀ − (T/m)I‖² for the
        residual, the worst-case singular value for the other two.
    proved_bound, gap_percent, certificate
        What is proved about the score for every Jacobian of the model, how far the score is
        from it in percent of the bound, and the kind of proof
        (`lockedjoint.formulations.bounds.certified`).
    worst_case_sigma, sigma_bound, sigma_gap_percent
        Eq. (5) for the best J, the bound (6) at the model's largest ‖J‖_F, and the gap in
        percent of the bound.
    condition_number, isotropy_defect
        Of the best J; if nothing passed the check, of the least violation found.
    violation
        Largest violation of any constraint there.
    distinct_optima
        Classes among the starts that reached the best, modulo frame, phase, order and signs;
        0 also if the user interrupted.
    iterations_median, cpu_seconds_per_start, cpu_seconds_per_success
        Processor time, with the drawing of the start, without building the solver.
    relative_cost
        Processor time per success over that of the same formulation and model without a
        variant.
    status_counts
        Ipopt's return statuses and how often each came.
    """

    formulation: str = field(metadata=column("problem", lambda row: row.problem))
    variant: str = field(metadata=HIDDEN)
    model: str = field(metadata=HIDDEN)
    joints: int = field(metadata=HIDDEN)
    task_dimension: int = field(metadata=HIDDEN)
    verdict: str = field(metadata=HIDDEN)
    starts: int = field(metadata=HIDDEN)
    solved: int = field(metadata=HIDDEN)
    reached_best: int = field(
        metadata=column(form=lambda row: f"{row.reached_best}/{row.starts}")
    )
    score: float = field(
        metadata=column(
            form=lambda row: row.verdict if isnan(row.score) else f"{row.score:.7g}"
        )
    )
    proved_bound: float = field(metadata=column("proved bound", form=lambda row: _bound(row)))
    gap_percent: float = field(metadata=column("gap %", "z.2f"))
    certificate: str = field(metadata=HIDDEN)
    worst_case_sigma: float = field(metadata=HIDDEN)
    sigma_bound: float = field(metadata=HIDDEN)
    sigma_gap_percent: float = field(metadata=HIDDEN)
    condition_number: float = field(metadata=HIDDEN)
    isotropy_defect: float = field(metadata=HIDDEN)
    violation: float = field(metadata=HIDDEN)
    distinct_optima: int = field(metadata=HIDDEN)
    iterations_median: float = field(metadata=HIDDEN)
    cpu_seconds_per_start: float = field(metadata=HIDDEN)
    cpu_seconds_per_success: float = field(metadata=column("CPU ms per success", scale=1e3))
    relative_cost: float = field(metadata=HIDDEN)
    status_counts: Mapping[str, int] = field(metadata=HIDDEN)

    @property
    def problem(self) -> str:
        """Formulation, model and variant, as tables name them."""
        return ", ".join(filter(None, (self.formulation, self.model, self.variant)))


@dataclass(frozen=True)
class Compared:
    """One case that was compared: its row, and what all its starts came to."""

    row: ComparisonRow
    outcome: Outcome

    def jacobian(self) -> dict[str, Any]:
        """Return the best Jacobian and where it comes from, as plain values for JSON.

        The keys are `_NAMES`, seed, start, worst_case_sigma, isotropy_defect, and jacobian, m
        rows of n numbers.
        """
        best = self.outcome.best
        return {
            **{name: getattr(self.row, name) for name in _NAMES},
            "seed": best.seed,
            "start": best.index,
            "worst_case_sigma": best.worst_case_sigma,
            "isotropy_defect": best.isotropy_defect,
            "jacobian": best.jacobian.tolist(),
        }


def compare(
    joints: int = 7,
    task_dimension: int = 6,
    *,
    models: Sequence[str] = (),
    starts: int = STARTS,
    seed: int = 0,
    workers: int | None = None,
    options: Mapping[str, object] = NOTHING,
    progress: bool = False,
) -> Table[ComparisonRow]:
    """Compare residual minimisation, max-min and isotropy from common random starts.

    Parameters
    ----------
    joints, task_dimension
        Numbers n of joints and m of task dimensions, n > m.
    models
        Column models; by default unit-revolute and lever-revolute in six dimensions.
    starts
        Random starts of each problem.
    seed
        Random seed; reproducible across machines.
    workers
        Worker processes; by default one per core.
    options
        Options of Ipopt, over those of the formulations.
    progress
        Whether to show progress bars.

    Returns
    -------
    Table
        Its ``rows`` are one `ComparisonRow` each; ``frame()`` is a DataFrame.

    Raises
    ------
    InputError
        If an argument is not allowed.
    KeyboardInterrupt
        If the user interrupted.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> comparison = lj.compare(3, 2, models=["free"], starts=3, workers=1)
    >>> [row.formulation for row in comparison.rows][:2]
    ['residual', 'max-min']
    """
    count = default_workers() if workers is None else workers
    effort = Effort(seed, starts, count, bars=progress)
    compared = compare_cases(cases(joints, task_dimension, options, models), effort)
    return Table(ComparisonRow, [one.row for one in compared])


def compare_cases(compared: Sequence[Case], effort: Effort) -> Iterator[Compared]:
    """Solve cases one after another from common starts; see `cases`.

    Raises
    ------
    KeyboardInterrupt
        If the user interrupted, after the case that was interrupted is yielded.
    """
    plain: dict[tuple[str, str], ComparisonRow] = {}
    for case in compared:
        outcome = solve_case(case, effort)
        problem = (case.formulation.NAME, case.model)
        row = row_of(outcome, plain.get(problem))
        if not case.variant:
            plain[problem] = row
        yield Compared(row, outcome)
        if not outcome.complete:
            raise KeyboardInterrupt


def solve_case(case: Case, effort: Effort) -> Outcome:
    """Solve a case from all starts, `STARTS` if the effort names no number.

    Raises
    ------
    KeyboardInterrupt
        If the user interrupted before the first start ended.
    """
    effort.progress(f"{case.name}, {case.failures} locked")
    how: dict[str, Any] = {"seed": effort.seed, "workers": effort.workers}
    outcome = run(case, starts=effort.starts or STARTS, progress=effort.bars, **how)
    if not outcome.records:
        raise KeyboardInterrupt
    try:
        _ = outcome.distinct_optima  # now, where an interrupt loses nothing
    except KeyboardInterrupt:
        outcome = replace(outcome, complete=False)
    return outcome


def cases(
    joints: int,
    task_dimension: int,
    options: Mapping[str, object] = NOTHING,
    models: Sequence[str] = (),
) -> tuple[Case, ...]:
    """List the rows: each formulation on all models, and the variants of max-min on one."""
    names = models or models_of(task_dimension)
    first, *others = (arm(model, joints, task_dimension) for model in names)
    minima = {"encoding": "shared-factor", "from_residual_minima": True}
    free, positive = "factor-per-deletion", "positive-factor-per-deletion"
    # Formulation, arm, settings and variant.
    listed: tuple[tuple[Formulation, Arm, dict[str, Any], str], ...] = (
        (residual, first, {}, ""),
        (max_min, first, {}, ""),
        (max_min, first, minima, "from residual minima"),
        (max_min, first, {"encoding": free}, "one factor per failure"),
        (max_min, first, {"encoding": positive}, "one positive factor per failure"),
        (isotropy, first, {}, ""),
        *((own, other, {}, "") for other in others for own in (residual, max_min, isotropy)),
        *((own, every, {}, "") for own in registered() for every in (first, *others)),
    )
    return tuple(Case(*parts, options=options) for parts in listed)


def counted(outcome: Outcome) -> dict[str, Any]:
    """Return the columns that any table of outcomes has: the arm, counts and times."""
    records = outcome.records
    return {
        "model": outcome.case.model,
        "joints": outcome.arm.shape[1],
        "task_dimension": outcome.arm.shape[0],
        "starts": len(records),
        "solved": outcome.succeeded,
        "reached_best": len(outcome.reached),
        "distinct_optima": outcome.distinct_optima,
        "iterations_median": float(np.median([start.status.iterations for start in records])),
        "cpu_seconds_per_start": float(np.mean([start.cpu_seconds for start in records])),
    }


def row_of(outcome: Outcome, without_variant: ComparisonRow | None = None) -> ComparisonRow:
    """Return an outcome of at least one record, of an arm to be designed, as a row.

    `without_variant` is the row of the same formulation and model without a variant; None if
    this is it.
    """
    case, built = outcome.case, outcome.arm
    assert isinstance(built, Arm)
    m, n = built.shape
    best, shown = outcome.reached, outcome.best
    sigma, score = (shown.worst_case_sigma, shown.score) if best else (NAN, NAN)
    limit = measures.sigma_bound(m, n, built.largest_trace, case.failures)
    seconds = sum(record.cpu_seconds for record in outcome.records)
    per_success = seconds / len(best) if best else NAN
    unit = without_variant.cpu_seconds_per_success if without_variant else per_success
    proved = case.formulation.bound(built, case.failures)
    return row_from(
        ComparisonRow,
        shown,
        outcome,
        case,
        **counted(outcome),
        formulation=case.formulation.NAME,
        score=score,
        proved_bound=proved.value if proved else NAN,
        gap_percent=proved.gap_percent(score) if proved else NAN,
        certificate=proved.kind if proved else "",
        worst_case_sigma=sigma,
        sigma_bound=limit,
        sigma_gap_percent=measures.gap_percent(sigma, limit),
        cpu_seconds_per_success=per_success,
        relative_cost=per_success / unit,
    )


def _bound(row: ComparisonRow) -> str:
    """Return the proved bound, rounded to the side on which it holds."""
    if isnan(row.proved_bound):
        return row.certificate
    known = FORMULATIONS.get(row.formulation)
    lower = known is not None and known.SENSE == "minimise"
    return outward(row.proved_bound, _BOUND_DIGITS, lower=lower)
