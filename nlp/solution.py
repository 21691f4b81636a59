"""The answer of a solver: its own status, and what was recomputed at its point."""

from collections.abc import Mapping
from dataclasses import dataclass

from nlp.arrays import FloatArray
from nlp.problem import Sense

SUCCESS = "Solve_Succeeded"
ACCEPTABLE = "Solved_To_Acceptable_Level"
LIMIT = "Maximum_Iterations_Exceeded"
INFEASIBLE = "Infeasible_Problem_Detected"
# Largest violation of a constraint, in the units of the constraint, at a feasible point.
FEASIBLE = 1e-6


@dataclass(frozen=True)
class Status:
    """How the solver ended, by its own statistics; NaN where it has none.

    Attributes
    ----------
    return_status
        Ipopt's return status, verbatim; Fatrop's success in the same words.
    iterations
        Number of iterations.
    primal_infeasibility, dual_infeasibility, barrier
        ``inf_pr``, ``inf_du`` and ``mu`` at the last iteration.
    cpu_seconds, wall_seconds
        Time inside the solver, without building it.
    """

    return_status: str
    iterations: int
    primal_infeasibility: float
    dual_infeasibility: float
    barrier: float
    cpu_seconds: float
    wall_seconds: float

    @property
    def success(self) -> bool:
        """Whether the solver reports that it reached its tolerances."""
        return self.return_status == SUCCESS

    @property
    def acceptable(self) -> bool:
        """Whether it reports that it reached its tolerances, or the looser acceptable ones."""
        return self.return_status in (SUCCESS, ACCEPTABLE)

    def to_dict(self) -> dict[str, str | int | float]:
        """Return plain values for tables and JSON."""
        return dict(vars(self))


@dataclass(frozen=True, eq=False)
class Solution:
    """A point and what is known of it; to be checked before it is used.

    Attributes
    ----------
    problem, sense
        Name and sense of the problem.
    status
        How the solver ended, in the stage that gave the point.
    variables
        The point, shape (size,).
    objective
        The objective at that point, in the problem's own sense.
    violation
        Largest violation of any constraint or bound, recomputed at the point.
    outputs
        The problem's named outputs at the point, each a 2-D array.
    multipliers
        Lagrange multipliers of each constraint block, by name; none where the point is that
        of an earlier stage.
    compiled
        Whether the problem's functions ran as machine code: asked for, and possible here.
    earlier
        How it ended in what was solved before, in order: a first stage, see
        `nlp.problem.Stage`, and an attempt from there that failed.
    """

    problem: str
    sense: Sense
    status: Status
    variables: FloatArray
    objective: float
    violation: float
    outputs: Mapping[str, FloatArray]
    multipliers: Mapping[str, FloatArray]
    compiled: bool = False
    earlier: tuple[Status, ...] = ()

    @property
    def feasible(self) -> bool:
        """Whether no constraint or bound is violated by more than `FEASIBLE`."""
        return self.violation <= FEASIBLE
