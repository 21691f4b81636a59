"""The relaxation from statement to proof: solved, rounded, checked, and reported whole.

What comes in: an arm, how many joints lock, and a statement. What goes out: a proved bound on
the score, with the solver's answer from which it was made. The program is stated in
`lockedjoint.formulations.relaxation`, what its multipliers prove in `relaxation_proof`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from lockedjoint.formulations import relaxation
from lockedjoint.formulations.bounds.relaxation_proof import RelaxationProof
from lockedjoint.formulations.bounds.relaxation_rounding import accuracy, prove
from lockedjoint.formulations.conic import SOLVER
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.parts import Statement, parts_of
from lockedjoint.formulations.measures.unequal_failures import FailureModel
from lockedjoint.formulations.relaxation import RelaxationSolution
from lockedjoint.nlp.errors import InputError, of_kind

#: How a bound from here is known.
KIND = "proved (relaxation)"
#: Largest number m of rows of J: programs of larger matrices take minutes.
MOST_DIMENSIONS = 12
#: Largest number of failures that differ in more than the choice among equal joints. If there
#: are more, joints that differ in the limits of their conditions alone share the mean limits,
#: and the bound may be larger.
MOST_FAILURES = 16
#: Relative tolerance of the default solver in its second try; the first one is
#: `relaxation.TOLERANCE`. A larger one succeeds more often, and proves a little less.
LOOSE_TOLERANCE = 1e-9


class TooLargeError(InputError):
    """An arm whose relaxation would take minutes."""


@dataclass(frozen=True, eq=False, repr=False)
class Relaxed:
    """A bound from the relaxation, and how it came about.

    Attributes
    ----------
    solution
        The solver's answer: its name, status, value, multipliers and time.
    proof
        The multipliers as fractions, checked, and what they prove.
    failed
        The status of a run of the default solver with a smaller tolerance that came to
        nothing; empty if the first run had an answer.
    """

    solution: RelaxationSolution
    proof: RelaxationProof
    failed: str = ""

    @property
    def value(self) -> float:
        """The proved bound on the score."""
        return self.proof.bound

    def __repr__(self) -> str:
        """Say the bound, with all its digits as a rounded one may not hold, and the solver."""
        solver = f"{self.solution.solver} {self.solution.status}"
        return f"<Relaxed: {self.value!r}, {KIND}, {solver}>"

    def to_dict(self) -> dict[str, object]:
        """Return plain values: the bound, and what the solver said."""
        residual, eigenvalue = accuracy(self.solution)
        return {
            "bound": self.value,
            "kind": KIND,
            "numerical": self.solution.bound,
            "solver": self.solution.solver,
            "status": self.solution.status,
            **({"status_of_first_run": self.failed} if self.failed else {}),
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
        See `lockedjoint.formulations.relaxation.solve`. Without options the default solver has
        a second try with a larger tolerance, if it fails; the status of both is kept.

    Raises
    ------
    TooLargeError
        If the arm is too large for the program (`MOST_DIMENSIONS`, `MOST_FAILURES`).
    InputError
        If the solver is not installed, or a joint has conditions that are none.
    CertificateError
        If the solver failed, no proof follows from its multipliers, or the worst case is 0
        whatever the Jacobian is.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> limit = lj.relaxed(lj.arm("unit-revolute:4,prismatic:3"))
    >>> print(f"{limit.value:.4f}")
    0.4894
    """
    of_kind("arm", arm, Arm, "an Arm, such as arm('unit-revolute', 7)")
    if arm.shape[0] > MOST_DIMENSIONS:
        allowed = f"at most {MOST_DIMENSIONS} for the relaxation"
        raise TooLargeError("task dimension", arm.shape[0], allowed)
    coarse = len(parts_of(arm, failures).sets) > MOST_FAILURES
    parts = parts_of(arm, failures, coarse=coarse)
    if len(parts.sets) > MOST_FAILURES:
        allowed = f"at most {MOST_FAILURES} for the relaxation"
        raise TooLargeError("different failures", len(parts.sets), allowed)
    if parts.lost_rows and statement != "residual":
        rows = parts.lost_rows
        raise CertificateError(f"some failures leave too few joints for {rows} rows: σ is 0")
    program = relaxation.build(arm, failures, statement, coarse=coarse)
    solution, failed = relaxation.solve(program, solver, options), ""
    if not solution.multipliers and options is None and solution.solver == SOLVER:
        failed = solution.status
        solution = relaxation.solve(program, solver, relaxation.accurate(LOOSE_TOLERANCE))
    return Relaxed(solution, prove(solution), failed)
