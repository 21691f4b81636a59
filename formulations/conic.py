"""Run a solver of semidefinite programs through cvxpy, and keep the status that it reports."""

import contextvars
import threading
import warnings
from collections.abc import Callable, Mapping
from concurrent.futures import Future, wait
from functools import cache

import cvxpy as cp
from cvxpy.reductions.solvers.defines import SOLVER_MAP_CONIC

from lockedjoint.nlp.errors import one_of

#: The default solver, by cvxpy's name.
SOLVER = "CLARABEL"
# Seconds between two looks at whether the solver has ended: a Ctrl-C is heard as soon.
_PULSE_SECONDS = 0.2


def check_solver(name: str, *others: str) -> str:
    """Return the name of a solver as cvxpy writes it, or one of the `others` that are allowed.

    Raises
    ------
    InputError
        If cvxpy has no solver of semidefinite programs of this name, in capitals or not.
    """
    known = [*others, *_semidefinite_solvers()]
    found: str = one_of("solver", name if name in known else str(name).upper(), known)
    return found


@cache
def _semidefinite_solvers() -> tuple[str, ...]:
    """Return the solvers of semidefinite programs; cvxpy imports each to find them."""
    return tuple(filter(_solves_semidefinite, cp.installed_solvers()))


def _solves_semidefinite(name: str) -> bool:
    """Whether a solver takes semidefinite matrices; cvxpy has two names for the cone."""
    cones = getattr(SOLVER_MAP_CONIC.get(name), "SUPPORTED_CONSTRAINTS", ())
    return any(cone.__name__ in ("PSD", "SvecPSD") for cone in cones)


def run(
    program: cp.Problem, solver: str = SOLVER, options: Mapping[str, object] | None = None
) -> str:
    """Solve a cvxpy problem in place and return the solver's status in full.

    Parameters
    ----------
    program
        The problem; its variables and constraints receive their values.
    solver
        A solver's name in cvxpy.
    options
        The solver's own options, by its own names.

    Returns
    -------
    str
        cvxpy's status, e.g. ``"optimal"``, ``"optimal_inaccurate"``, ``"infeasible"``, or
        ``"solver_error: "`` and the message. A failure is a result and is not raised.
    """
    with warnings.catch_warnings():
        # cvxpy warns of inaccurate answers; the status has the same information.
        warnings.simplefilter("ignore", UserWarning)
        try:
            _aside(lambda: program.solve(solver=solver, **(options or {})))
        except cp.SolverError as error:
            return f"solver_error: {error}"
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            # So do solvers answer options that they do not know.
            return f"solver_error: {type(error).__name__}: {error}"
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
    # The wait is in turns, as a signal may reach another thread.
    while not wait([done], timeout=_PULSE_SECONDS).done:
        pass
    done.result()
