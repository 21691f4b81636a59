"""Run a conic solver through cvxpy and keep the status that it reports."""

import contextvars
import threading
import warnings
from collections.abc import Callable, Mapping
from concurrent.futures import Future, wait
from typing import Any

import cvxpy as cp

from nlp.errors import InputError, SolverOptionError

_PULSE = 0.2  # seconds


def check_solver(solver: str) -> None:
    """Raise InputError unless cvxpy has a solver of this name."""
    allowed = cp.installed_solvers()
    if solver not in allowed:
        raise InputError("solver", solver, ", ".join(allowed))


def run(program: cp.Problem, solver: str, options: Mapping[str, Any] | None = None) -> str:
    """Solve a cvxpy problem in place and return the solver's status in full.

    Parameters
    ----------
    program
        The problem; its variables and constraints receive their values.
    solver
        Name of a conic solver that is installed, e.g. ``"CLARABEL"``.
    options
        The solver's own options, by their own names.

    Returns
    -------
    str
        cvxpy's status, e.g. ``"optimal"``, ``"optimal_inaccurate"``, ``"infeasible"``, or
        ``"solver_error: "`` and the message. A failure is a result and is not raised.

    Raises
    ------
    InputError
        If there is no such solver.
    SolverOptionError
        If the solver has no such option.
    """
    check_solver(solver)
    with warnings.catch_warnings():
        # cvxpy warns of inaccurate answers; the status has the same information.
        warnings.simplefilter("ignore", UserWarning)
        try:
            _aside(lambda: program.solve(solver=solver, **(options or {})))
        except cp.SolverError as error:
            return f"solver_error: {error}"
        except (AttributeError, TypeError, ValueError) as error:
            if not options:
                raise
            raise SolverOptionError("options", dict(options), str(error)) from error
    return str(program.status)


def _aside(call: Callable[[], object]) -> None:
    """Call in a thread of its own: a compiled solver would hold Ctrl-C back until its end.

    After a Ctrl-C the thread goes on until the solver ends, or the process does.
    """
    if threading.current_thread() is not threading.main_thread():
        call()
        return
    done: Future[None] = Future()

    def work() -> None:
        try:
            call()
        except BaseException as error:
            done.set_exception(error)
        else:
            done.set_result(None)

    context = contextvars.copy_context()  # such as NumPy's handling of overflow
    threading.Thread(target=context.run, args=(work,), daemon=True).start()
    while not wait([done], timeout=_PULSE).done:  # in turns: a signal may reach another thread
        pass
    done.result()
