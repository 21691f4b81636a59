"""One start, solved and judged: the gate between the solver's answers and what may be shown."""

from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from typing import Any, TypeAlias

import numpy as np

from formulations import measures
from formulations.solving.case import Case
from nlp.arrays import FloatArray
from nlp.problem import FEASIBLE, Solution, Status

# Improves an arm's variables; says whether its own method converged.
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
        The solver's accounts of what was solved before; see `nlp.problem.Solution`.
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
        import pandas as pd

        matrix = pd.DataFrame(self.jacobian).to_html(border=0, float_format="{:.6f}".format)
        return f"<p>{escape(repr(self))}</p>{matrix}"


def judge(
    case: Case,
    solution: Solution,
    *,
    seed: int = 0,
    index: int = 0,
    cpu_seconds: float = 0.0,
    polish: PolishMethod | None = None,
) -> Record:
    """Measure a solution's Jacobian and check it against the arm and the formulation.

    Parameters
    ----------
    case
        What was solved.
    solution
        The solver's answer. Its first variables are the arm's; they are moved to within the
        arm's bounds, which a solver may pass by its tolerance.
    seed, index, cpu_seconds
        Of the start.
    polish
        Improves the arm's variables before they are judged; it keeps to their bounds, where
        these are all the arm's conditions.
    """
    arm, status, nan = case.arm, solution.status, float("nan")
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
        seed=seed,
        index=index,
        status=status,
        violation=violation,
        score=score if np.isfinite(score) else nan,
        worst_case_sigma=measures.worst_case_sigma(jacobian, case.locked) if finite else nan,
        condition_number=measures.condition_number(jacobian) if finite else nan,
        isotropy_defect=measures.isotropy_defect(jacobian) if finite else nan,
        jacobian=jacobian,
        variables=variables,
        cpu_seconds=cpu_seconds,
        earlier=solution.earlier,
        polished=polished,
    )
