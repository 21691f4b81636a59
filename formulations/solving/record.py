"""One start, solved and judged: the solver's own account beside what J itself says."""

from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np

from formulations import measures
from formulations.joints.arm import Arm
from formulations.joints.joint import NotInModelError
from nlp.arrays import FloatArray
from nlp.multistart import Run
from nlp.solution import FEASIBLE, Status


@dataclass(frozen=True, eq=False, repr=False)
class Record:
    """What became of one start.

    Attributes
    ----------
    seed, index
        Seed of the study and number of the start in it.
    status
        The solver's account of the stage that gave the answer.
    violation
        Largest violation of the problem's constraints at the point.
    merit
        What the formulation optimises, recomputed from J; NaN if J does not satisfy the
        formulation or is not of the arm's model, whatever the solver said.
    worst_case_sigma, condition_number, isotropy_defect
        Measured from J alone.
    jacobian
        Shape (m, n).
    cpu_seconds
        Processor time of the start, drawing and all stages included.
    earlier
        The solver's accounts of what was solved before; see `nlp.solution.Solution`.
    """

    seed: int
    index: int
    status: Status
    violation: float
    merit: float
    worst_case_sigma: float
    condition_number: float
    isotropy_defect: float
    jacobian: FloatArray
    cpu_seconds: float
    earlier: tuple[Status, ...] = ()

    @property
    def valid(self) -> bool:
        """Whether J satisfies the formulation and the model, by our own check."""
        return bool(np.isfinite(self.merit))

    @property
    def feasible(self) -> bool:
        """Whether J is `valid` and violates no constraint by more than `FEASIBLE`."""
        return self.valid and self.violation <= FEASIBLE

    @property
    def trusted(self) -> bool:
        """The gate: what may be shown, ranked, drawn or called best.

        The solver converged, at least to its acceptable tolerances, to a point that is
        `feasible`.
        """
        return self.status.acceptable and self.feasible

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for tables and JSON, the solver's account among them."""
        own = {name: value for name, value in vars(self).items() if name != "status"}
        return {
            **own,
            **self.status.to_dict(),
            "cpu_seconds": self.cpu_seconds,
            "valid": self.valid,
            "jacobian": self.jacobian.tolist(),
            "earlier": [status.to_dict() for status in self.earlier],
        }

    def __repr__(self) -> str:
        """Say in one line which start it is and what became of it."""
        passed = "passes the check" if self.trusted else "does not pass the check"
        return (
            f"<Record: start {self.index} of seed {self.seed}, {self.status.return_status}, "
            f"{passed}: merit {self.merit:.9g}, worst case σ = {self.worst_case_sigma:.6g}>"
        )

    def _repr_html_(self) -> str:
        """Return the line and the Jacobian, for notebooks."""
        import pandas as pd

        matrix = pd.DataFrame(self.jacobian).to_html(border=0, float_format="{:.6f}".format)
        return f"<p>{escape(repr(self))}</p>{matrix}"


def judge(run: Run, arm: Arm, merit: Callable[[FloatArray], float], locked: int = 1) -> Record:
    """Measure a run's Jacobian and check it against the arm and the formulation.

    Parameters
    ----------
    run
        The run, with the output ``jacobian``.
    arm
        The joints.
    merit
        What is optimised, from J alone; not finite if J does not satisfy the formulation.
    locked
        How many joints lock at once.
    """
    solution = run.solution
    jacobian = solution.outputs["jacobian"]
    finite = bool(np.all(np.isfinite(jacobian)))
    value = merit(jacobian) if in_model(arm, jacobian) else np.nan
    nan = float("nan")
    return Record(
        seed=run.seed,
        index=run.index,
        status=solution.status,
        violation=solution.violation,
        merit=value if np.isfinite(value) else nan,
        worst_case_sigma=measures.worst_case_sigma(jacobian, locked) if finite else nan,
        condition_number=measures.condition_number(jacobian) if finite else nan,
        isotropy_defect=measures.isotropy_defect(jacobian) if finite else nan,
        jacobian=jacobian,
        cpu_seconds=run.cpu_seconds,
        earlier=solution.earlier,
    )


def in_model(arm: Arm, jacobian: FloatArray) -> bool:
    """Return whether J is one of the arm's Jacobians; False for NaN and infinity."""
    if not np.all(np.isfinite(jacobian)):
        return False
    try:
        arm.variables(jacobian)
    except NotInModelError:
        return False
    return True
