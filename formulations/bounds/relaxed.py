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
#: Larger programs take minutes: task dimensions, and kinds of joints.
MOST_DIMENSIONS = 12
MOST_KINDS = 40


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
    program = relaxation.build(arm, failures, statement)
    if (m := program.parts.task_dimension) > MOST_DIMENSIONS:
        raise InputError("task dimension", m, f"at most {MOST_DIMENSIONS} for the relaxation")
    if (kinds := len(program.parts.kinds)) > MOST_KINDS:
        raise InputError("kinds of joints", kinds, f"at most {MOST_KINDS} for the relaxation")
    if lost := program.parts.lost_rows:
        raise CertificateError(f"some failures leave too few joints for {lost} rows: σ is 0")
    solution = relaxation.solve(program, solver, options)
    return Relaxed(solution, prove(solution))
