"""The relaxation from statement to proof: solved, rounded, checked, and reported whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from lockedjoint.formulations import relaxation
from lockedjoint.formulations.bounds.relaxation_proof import RelaxationProof
from lockedjoint.formulations.bounds.relaxation_rounding import accuracy, prove
from lockedjoint.formulations.conic import SOLVER
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.measures.unequal_failures import FailureModel
from lockedjoint.formulations.relaxation import RelaxationSolution, Statement
from lockedjoint.nlp.errors import InputError

#: How a bound from here is known.
KIND = "proved (relaxation)"
#: Larger programs take minutes. Rows of the matrices.
MOST_DIMENSIONS = 12
#: Failures that differ in more than the choice among equal joints.
MOST_FAILURES = 60


@dataclass(frozen=True, eq=False)
class Relaxed:
    """A bound from the relaxation, and how it came about.

    Attributes
    ----------
    solution
        The solver's answer: its name, status, value, multipliers and time.
    proof
        The multipliers as fractions, checked, and what they prove.
    """

    solution: RelaxationSolution
    proof: RelaxationProof

    @property
    def value(self) -> float:
        """The proved bound on the score."""
        return self.proof.bound

    def to_dict(self) -> dict[str, object]:
        """Return plain values: the bound, and what the solver said."""
        residual, eigenvalue = accuracy(self.solution)
        return {
            "bound": self.value,
            "kind": KIND,
            "numerical": self.solution.bound,
            "solver": self.solution.solver,
            "status": self.solution.status,
            "dual_residual": residual,
            "smallest_eigenvalue": eigenvalue,
            "seconds": self.solution.seconds,
        }


def relaxed(
    arm: Arm,
    failures: int | FailureModel = 1,
    statement: Statement = "max-min",
    *,
    solver: str = SOLVER,
    options: Mapping[str, object] | None = None,
) -> Relaxed:
    """Bound the score of a statement on an arm by its relaxation, with a proof.

    Parameters
    ----------
    arm
        The joints.
    failures
        How many joints lock at once, or how likely each fails.
    statement
        ``max-min``, ``isotropy`` or ``residual``.
    solver, options
        See `lockedjoint.formulations.relaxation.solve`.

    Raises
    ------
    InputError
        If the arm is too large for the program, or the solver is not installed.
    CertificateError
        If the solver failed, no proof follows from its multipliers, or the worst case is 0
        whatever the Jacobian is.
    """
    parts = relaxation.parts_of(arm, failures)
    if parts.task_dimension > MOST_DIMENSIONS:
        allowed = f"at most {MOST_DIMENSIONS} for the relaxation"
        raise InputError("task dimension", parts.task_dimension, allowed)
    if len(parts.failures) > MOST_FAILURES:
        allowed = f"at most {MOST_FAILURES} for the relaxation"
        raise InputError("different failures", len(parts.failures), allowed)
    if parts.lost_rows and statement != "residual":
        rows = parts.lost_rows
        raise CertificateError(f"some failures leave too few joints for {rows} rows: σ is 0")
    program = relaxation.build(arm, failures, statement)
    solution = relaxation.solve(program, solver, options)
    return Relaxed(solution, prove(solution))
