"""The solvers of moment programs, by name: our dense method, and those of cvxpy.

What comes in: a `MomentProgram` with unknowns y. What goes out: a multiplier X, shape (size,
size), for each of its blocks S(y) ⪰ 0, not checked. C is S at y = 0.
"""

from collections.abc import Callable

import numpy as np

from lockedjoint.formulations.bounds.moments.moment_program import (
    ConicOutcome,
    MomentProgram,
)
from lockedjoint.formulations.bounds.moments.predictor_corrector import (
    solve_with_predictor_corrector,
)
from lockedjoint.formulations.conic import check_solver, run

#: The dense primal–dual predictor–corrector: for few unknowns ten times as fast as the others.
DENSE = "predictor-corrector"


def check_moment_solver(name: str) -> str:
    """Return the name of a solver as it is listed; InputError if there is none."""
    return check_solver(name, DENSE)


def solve_moments(
    program: MomentProgram,
    solver: str = DENSE,
    *,
    gap: float,
    accuracy: float = 1e-8,
    progress: Callable[[str], None] | None = None,
) -> ConicOutcome:
    """Solve a moment program.

    Parameters
    ----------
    program
        The program; C ≻ 0, so that y = 0 is an interior point, for `DENSE`.
    solver
        `DENSE`, or a solver's name in cvxpy.
    gap, accuracy
        Tolerances of ⟨X, S⟩ and of the dual equations, relative to the objective or 1. Solvers
        of cvxpy keep their own.
    progress
        Told how far `DENSE` is.

    Raises
    ------
    InputError
        If there is no such solver.
    """
    solver = check_moment_solver(solver)
    if solver == DENSE:
        return solve_with_predictor_corrector(
            program, gap=gap, accuracy=accuracy, progress=progress
        )
    problem = program.problem()
    status = run(problem, solver)
    multipliers = [block.dual_value for block in problem.constraints]
    if any(x is None for x in multipliers):
        return ConicOutcome(None, status)
    symmetric = [0.5 * (np.asarray(x, dtype=float) + np.asarray(x).T) for x in multipliers]
    return ConicOutcome(tuple(symmetric), status, problem.solver_stats.num_iters)
