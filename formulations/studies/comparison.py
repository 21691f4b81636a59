"""All formulations from common starts, side by side in one table."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import isnan
from pathlib import Path

import numpy as np

from formulations import measures
from formulations.catalogue import arm, certified_bound, models_of, numerical_bound
from formulations.io.table import HIDDEN, column
from formulations.solving.outcome import Outcome
from formulations.solving.setup import setups
from formulations.studies.pages import outward
from formulations.studies.study import Effort, Part, Study
from nlp.interrupts import deferred_interrupt
from nlp.options import check_options

STARTS = 100
NAN = float("nan")
# What names a Jacobian in the file of them.
_NAMES = ("formulation", "variant", "model", "verdict")


@dataclass(frozen=True)
class Row:
    """One setup's outcome: the columns of ``comparison.csv``; NaN where one does not apply.

    Six of them are shown in tables.

    Attributes
    ----------
    formulation, variant, model, joints, task_dimension, verdict, starts
        What was run, and `Outcome.verdict`; `starts` counts those that ended.
    solved
        Starts at which Ipopt said that it succeeded.
    reached_best
        Starts whose answer, checked from J alone, is within `REACHED_BEST` of the best.
    merit
        What the formulation optimises, recomputed from the best J: ½‖JJᵀ − (T/m)I‖² for the
        residual, the worst-case singular value for the other two.
    certified_bound, certified_gap_percent, certificate
        What is proved about the merit for every Jacobian of the model, how far the merit is
        from it in percent of the bound, and the kind of proof
        (`formulations.bounds.certified`).
    numerical_bound, numerical_gap_percent
        The same, checked in floating point only, where such a bound is on record.
    worst_case_sigma, sigma_bound, gap_percent
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
    merit: float = field(
        metadata=column(
            form=lambda row: row.verdict if isnan(row.merit) else f"{row.merit:.7g}"
        )
    )
    certified_bound: float = field(
        metadata=column("proved bound", form=lambda row: _bound(row))
    )
    certified_gap_percent: float = field(metadata=column("gap %", "z.2f"))
    certificate: str = field(metadata=HIDDEN)
    numerical_bound: float = field(metadata=HIDDEN)
    numerical_gap_percent: float = field(metadata=HIDDEN)
    worst_case_sigma: float = field(metadata=HIDDEN)
    sigma_bound: float = field(metadata=HIDDEN)
    gap_percent: float = field(metadata=HIDDEN)
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


def study(
    joints: int = 7,
    task_dimension: int = 6,
    options: Mapping[str, object] | None = None,
    compiled: bool = False,
) -> Study:
    """Return the comparison on the two column models of a task dimension.

    Parameters
    ----------
    joints, task_dimension
        n and m.
    options
        Of Ipopt, over the formulations' own.
    compiled
        Whether the problems' functions are compiled first.
    """

    def check() -> None:
        check_options(options or {})
        for model in models_of(task_dimension):
            arm(model, joints, task_dimension)

    def compute(effort: Effort, _: Path) -> Iterator[Part]:
        plain: dict[tuple[str, str], Row] = {}
        for setup in setups(task_dimension):
            effort.progress(" ".join((setup.formulation, setup.model, setup.variant)))
            outcome = effort.solve(
                setup, joints, task_dimension, STARTS, options=options, compiled=compiled
            )
            with deferred_interrupt():  # until the row is written
                row = row_of(outcome, plain.get((setup.formulation, setup.model)))
                if not setup.variant:
                    plain[setup.formulation, setup.model] = row
                best = outcome.best
                entry = {
                    **{name: getattr(row, name) for name in _NAMES},
                    "seed": best.seed,
                    "start": best.index,
                    "worst_case_sigma": best.worst_case_sigma,
                    "isotropy_defect": best.isotropy_defect,
                    "jacobian": best.jacobian.tolist(),
                }
                yield Part(rows=[row], entries=[entry], complete=outcome.complete)

    name, option = ("comparison", "") if joints == 7 else (f"comparison_{joints}r", "--joints ")
    return Study(
        name=name,
        title=f"the three formulations on {joints}R, from common starts",
        page="comparison.md",
        template="comparison.md.j2",
        tables={"comparison": Row},
        command=f"lockedjoint compare {option and f'{option}{joints} '}--out results/{name}",
        takes="under a minute",
        compute=compute,
        entries="jacobians.json",
        check=check,
    )


def row_of(outcome: Outcome, default: Row | None = None) -> Row:
    """Return an outcome of at least one record as a row.

    Parameters
    ----------
    outcome
        Of a setup.
    default
        The row of the same formulation and model without a variant; None if this is it.
    """
    setup, records = outcome.setup, outcome.records
    m, n = outcome.arm.shape
    best, shown = outcome.reached, outcome.best
    sigma, merit = (shown.worst_case_sigma, shown.merit) if best else (NAN, NAN)
    bound = measures.sigma_bound(m, n, outcome.arm.largest_trace, setup.locked)
    seconds = sum(record.cpu_seconds for record in records)
    per_success = seconds / len(best) if best else NAN
    unit = default.cpu_seconds_per_success if default else per_success
    proved = certified_bound(setup.formulation, outcome.arm, setup.locked)
    checked = numerical_bound(setup.formulation, outcome.arm, setup.locked)
    return Row(
        formulation=setup.formulation,
        variant=setup.variant,
        model=setup.model,
        joints=n,
        task_dimension=m,
        verdict=outcome.verdict,
        starts=len(records),
        solved=outcome.succeeded,
        reached_best=len(best),
        merit=merit,
        certified_bound=proved.value,
        certified_gap_percent=proved.gap_percent(merit),
        certificate=proved.kind,
        numerical_bound=checked.value if checked else NAN,
        numerical_gap_percent=checked.gap_percent(merit) if checked else NAN,
        worst_case_sigma=sigma,
        sigma_bound=bound,
        gap_percent=measures.gap_percent(sigma, bound),
        condition_number=shown.condition_number,
        isotropy_defect=shown.isotropy_defect,
        violation=shown.violation,
        distinct_optima=outcome.distinct_optima,
        iterations_median=float(np.median([record.status.iterations for record in records])),
        cpu_seconds_per_start=seconds / len(records),
        cpu_seconds_per_success=per_success,
        relative_cost=per_success / unit,
        status_counts=outcome.status_counts,
    )


def _bound(row: Row) -> str:
    """Return the proved bound, rounded to the side on which it holds."""
    if isnan(row.certified_bound):
        return row.certificate
    return outward(row.certified_bound, 7, lower=row.formulation == "residual")
