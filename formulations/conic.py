"""Run the conic solver through cvxpy and keep the status that it reports."""

import warnings

import cvxpy as cp

SOLVER = "CLARABEL"


def run(program: cp.Problem) -> str:
    """Solve a cvxpy problem in place with `SOLVER` and return the solver's status in full.

    It is cvxpy's, or ``"solver_error: "`` and the message: a failure is not raised.
    """
    with warnings.catch_warnings():
        # cvxpy warns of inaccurate answers; the status has the same information.
        warnings.simplefilter("ignore", UserWarning)
        try:
            program.solve(solver=SOLVER)
        except cp.SolverError as error:
            return f"solver_error: {error}"
    return str(program.status)
