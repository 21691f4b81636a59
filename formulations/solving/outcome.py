"""The gate between the solver's answers and what may be shown; what the starts came to.

`judge` makes a `Record` of a solver's answer: everything in it is recomputed from the arm's
variables and its Jacobian J, shape (m, n). `Record.trusted` is the gate. An `Outcome` has the
records of all starts of a case.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from lockedjoint.formulations import measures
from lockedjoint.formulations.bounds.certified import NONE_EXISTS
from lockedjoint.formulations.io.objects import library
from lockedjoint.formulations.io.table import written
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.joint import ArmModel
from lockedjoint.formulations.measures.canonical import group_equivalent
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.problem import FEASIBLE, INFEASIBLE, Status
from lockedjoint.nlp.starts import Run

if TYPE_CHECKING:
    import pandas as pd

    from lockedjoint.formulations.solving.case import Case

#: An answer whose score is within this of the best one has reached the best: in all tables. A
#: larger number counts lesser optima as the best one.
REACHED_BEST = 1e-6
#: What came of a case, see `Outcome.verdict`.
Verdict = Literal["solved", "infeasible", "proved infeasible", "not solved"]
#: A function that improves an arm's variables, shape (size,), and says whether its method
#: converged.
PolishMethod: TypeAlias = Callable[[FloatArray], tuple[FloatArray, bool]]


@dataclass(frozen=True, eq=False, repr=False)
class Record:
    """What became of one start.

    Attributes
    ----------
    seed, index
        Random seed and number of the start.
    status
        The solver's account of the stage that gave the answer.
    violation
        Largest violation of the problem's constraints at the point.
    score
        What the formulation optimises, recomputed from J; NaN if J does not satisfy the
        formulation or is not of the arm's model, whatever the solver said.
    worst_case_sigma, condition_number, isotropy_defect
        Recomputed from J alone; NaN where J is not finite.
    jacobian
        Shape (m, n).
    variables
        The arm's variables that give J, shape (size,).
    cpu_seconds
        Processor time of the start, drawing and all stages included.
    earlier
        The solver's accounts of what was solved before; see `lockedjoint.nlp.problem.Solution`.
    polished
        Whether the method that improved the answer converged; None where there was none.
    """

    seed: int
    index: int
    status: Status
    violation: float
    score: float
    worst_case_sigma: float
    condition_number: float
    isotropy_defect: float
    jacobian: FloatArray
    variables: FloatArray
    cpu_seconds: float = 0.0
    earlier: tuple[Status, ...] = ()
    polished: bool | None = None

    @property
    def valid(self) -> bool:
        """Whether J satisfies the formulation and the model, by our own check."""
        return bool(np.isfinite(self.score))

    @property
    def converged(self) -> bool:
        """Whether the last method reached its tolerances, at least the acceptable ones."""
        return self.status.acceptable if self.polished is None else self.polished

    @property
    def feasible(self) -> bool:
        """Whether J is `valid` and violates no constraint by more than `FEASIBLE`."""
        return self.valid and self.violation <= FEASIBLE

    @property
    def trusted(self) -> bool:
        """The gate: what may be shown, ranked, drawn or called best."""
        return self.converged and self.feasible

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for tables and JSON, the solver's account among them."""
        own = {name: value for name, value in vars(self).items() if name != "status"}
        return {
            **own,
            **self.status.to_dict(),
            "cpu_seconds": self.cpu_seconds,
            "valid": self.valid,
            "jacobian": self.jacobian.tolist(),
            "variables": self.variables.tolist(),
            "earlier": [status.to_dict() for status in self.earlier],
        }

    def __repr__(self) -> str:
        """Say in one line which start it is and what became of it."""
        passed = "passes the check" if self.trusted else "does not pass the check"
        return (
            f"<Record: start {self.index} of seed {self.seed}, {self.status.return_status}, "
            f"{passed}: score {self.score:.9g}, worst case σ = {self.worst_case_sigma:.6g}>"
        )

    def _repr_html_(self) -> str:
        """Return the line and the Jacobian, for notebooks."""
        cells = [[f"{number:.6f}" for number in row] for row in self.jacobian]
        heads = [f"column {k}" for k in range(self.jacobian.shape[1])]
        return f"<p>{escape(repr(self))}</p>{written(cells, heads, 'html')}"


def judge(case: Case, run: Run, polish: PolishMethod | None = None) -> Record:
    """Measure a solution's Jacobian and check it against the arm and the formulation.

    The first variables are the arm's; they are moved to within its bounds, which a solver may
    pass by its tolerance. A polish improves them first; it keeps to the bounds, where these are
    all the arm's conditions.
    """
    arm, solution, nan = case.arm, run.solution, float("nan")
    given = solution.variables[: arm.size]
    variables, jacobian = given, np.full(arm.shape, nan)
    violation, polished = solution.violation, None
    if np.all(np.isfinite(given)):
        variables = arm.within_bounds(given)
        if polish is not None:
            variables, polished = polish(variables)
            violation = 0.0
        jacobian = arm.jacobian(variables)
    finite = bool(np.all(np.isfinite(jacobian)))
    score = case.score(jacobian) if finite and arm.admits(jacobian, variables) else nan
    return Record(
        seed=run.seed,
        index=run.index,
        status=solution.status,
        violation=violation,
        score=score if np.isfinite(score) else nan,
        worst_case_sigma=measures.worst_case_sigma(jacobian, case.failures) if finite else nan,
        condition_number=measures.condition_number(jacobian) if finite else nan,
        isotropy_defect=measures.isotropy_defect(jacobian) if finite else nan,
        jacobian=jacobian,
        variables=variables,
        cpu_seconds=run.cpu_seconds,
        earlier=solution.earlier,
        polished=polished,
    )


@dataclass(frozen=True, eq=False)
class Outcome:
    """The results of all starts of a case, in the order of the starts.

    Attributes
    ----------
    case
        What was run.
    records
        One for each start that ended.
    complete
        Whether all did.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> outcome = lj.solve("residual", "unit-revolute", joints=7, starts=5, workers=1)
    >>> outcome.verdict
    'solved'
    >>> len(outcome.reached), len(outcome.records)
    (5, 5)
    """

    case: Case
    records: tuple[Record, ...]
    complete: bool

    @property
    def arm(self) -> ArmModel:
        """The joints."""
        return self.case.arm

    @cached_property
    def reached(self) -> tuple[Record, ...]:
        """Records that pass the gate and are within `REACHED_BEST` of the best of them."""
        trusted = [record for record in self.records if record.trusted]
        if not trusted:
            return ()
        best = self._pick(trusted).score
        return tuple(record for record in trusted if abs(record.score - best) <= REACHED_BEST)

    @cached_property
    def scores(self) -> tuple[float, ...]:
        """The different scores of records that pass the gate, to `REACHED_BEST`, ascending.

        Optima that symmetries or self-motion turn into one another have one score.
        """
        different: list[float] = []
        for score in sorted(record.score for record in self.records if record.trusted):
            if not different or score - different[-1] > REACHED_BEST:
                different.append(score)
        return tuple(different)

    @property
    def unseen_share(self) -> float:
        """The expected share of optima that no start has ended at yet, from 0 to 1.

        Of N starts that passed the gate and ended at w different scores it is
        (w + 1)/(N − 1), for any basins of attraction alike (Boender and Rinnooy Kan, 1987).
        """
        passed = sum(record.trusted for record in self.records)
        return min(1.0, (len(self.scores) + 1) / (passed - 1)) if passed > 1 else 1.0

    @cached_property
    def distinct_optima(self) -> int:
        """Classes among `reached`, modulo frame, phase, order and signs.

        0 where they are not counted: if the user interrupted, failures are unequal, or the arm
        is a robot, whose joints are in order.
        """
        designed = self._alike and isinstance(self.arm, Arm)
        if not (self.complete and self.reached and designed):
            return 0
        return len(group_equivalent([record.jacobian for record in self.reached]))

    @property
    def best(self) -> Record:
        """The record to show.

        Of those that reached the best, the one with the largest worst case, or with the best
        score where failures are unequal. If nothing passed the gate, the best point that is
        feasible; if there is none, the one with the least violation.
        """
        if self.reached and self._alike:
            return max(self.reached, key=lambda record: record.worst_case_sigma)
        feasible = [record for record in self.records if record.feasible]
        if self.reached or feasible:
            return self._pick(self.reached or feasible)
        return min(self.records, key=lambda record: np.nan_to_num(record.violation, nan=np.inf))

    def _pick(self, records: Sequence[Record]) -> Record:
        """Return the record with the best score."""
        minimise = self.case.formulation.SENSE == "minimise"
        return (min if minimise else max)(records, key=lambda record: record.score)

    @property
    def _alike(self) -> bool:
        """Whether all joints are equally likely to fail: no `FailureModel` is given."""
        return isinstance(self.case.settings.get("failures", 1), int)

    @property
    def verdict(self) -> Verdict:
        """Whether the case is solved.

        ``solved`` if any answer passed the gate (`Record.trusted`); if none did,
        ``infeasible`` if Ipopt said so and nowhere claimed success, ``proved infeasible`` if
        there is a verified proof besides; ``not solved`` otherwise.
        """
        if self.reached:
            return "solved"
        if INFEASIBLE not in self.status_counts or self.succeeded:
            return "not solved"
        bound = self.case.formulation.bound(self.arm, self.case.failures)
        return "proved infeasible" if bound is NONE_EXISTS else "infeasible"

    @property
    def succeeded(self) -> int:
        """Number of starts at which the solver said that it succeeded."""
        return sum(record.status.success for record in self.records)

    @property
    def status_counts(self) -> dict[str, int]:
        """The solver's return statuses and how often each came, by name."""
        counts = Counter(record.status.return_status for record in self.records)
        return dict(sorted(counts.items()))

    def to_dict(self) -> dict[str, Any]:
        """Return what was run, the verdict and all records as plain values."""
        return {
            "formulation": self.case.formulation.NAME,
            "model": self.case.model,
            "variant": self.case.variant,
            "joints": self.arm.shape[1],
            "task_dimension": self.arm.shape[0],
            "verdict": self.verdict,
            "complete": self.complete,
            "reached_best": len(self.reached),
            "status_counts": self.status_counts,
            "records": [record.to_dict() for record in self.records],
        }

    def to_frame(self) -> pd.DataFrame:
        """Return the records as a DataFrame, one row per start, without the Jacobians.

        MissingLibraryError without pandas.
        """
        library("pandas")
        import pandas as pd

        return pd.DataFrame(self._rows())

    def _rows(self) -> list[dict[str, Any]]:
        """Return the records as plain values, one row per start, without the Jacobians."""
        rows = [record.to_dict() for record in self.records]
        left_out = ("jacobian", "variables")
        return [{k: row[k] for k in row if k not in left_out} for row in rows]

    def __repr__(self) -> str:
        """Say in one line what was run and what came of it."""
        name = f"{self.case.formulation.NAME}, {self.case.model}, n = {self.arm.shape[1]}"
        return f"<Outcome: {name}: {self.summary}>"

    @property
    def summary(self) -> str:
        """The verdict, and the best that the starts reached."""
        if self.reached:
            share = f"{len(self.reached)} of {len(self.records)} starts at the best"
            return f"{self.verdict}, {share} {self.best.score:.9g}"
        if not self.records or self.verdict != "not solved":
            return self.verdict
        if self.best.feasible:
            return f"{self.verdict}; best feasible point {self.best.score:.9g}"
        return f"{self.verdict}; least violation {self.best.violation:.3g}"

    def _repr_html_(self) -> str:
        """Return the line and the first records, for notebooks."""
        rows = self._rows()[:10]
        cells = [[_cell(value) for value in row.values()] for row in rows]
        heads = list(rows[0]) if rows else []
        return f"<p>{escape(repr(self))}</p>{written(cells, heads, 'html')}"


def _cell(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
