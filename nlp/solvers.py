"""The solvers by name, each set up for one problem and called from many starts."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from nlp.errors import InputError
from nlp.fatrop import FatropSolver, check_fatrop_options
from nlp.ipopt import IpoptSolver
from nlp.ipopt_options import check_options
from nlp.nlpsol import NlpsolSolver
from nlp.problem import Problem

SOLVERS: Mapping[str, type[IpoptSolver] | type[FatropSolver]] = {
    "ipopt": IpoptSolver,
    "fatrop": FatropSolver,
}
_CHECKS: Mapping[str, Callable[[Mapping[str, object]], Mapping[str, object]]] = {
    "ipopt": check_options,
    "fatrop": check_fatrop_options,
}


def check_solver(
    solver: str, options: Mapping[str, object], compiled: bool = False
) -> Mapping[str, object]:
    """Return the options, checked against the solver's own.

    Raises
    ------
    InputError
        If there is no such solver, or an option is not one of its own.
    """
    if solver not in SOLVERS:
        raise InputError("solver", solver, "one of " + ", ".join(SOLVERS))
    if not isinstance(compiled, bool):
        raise InputError("compiled", compiled, "true or false")
    return _CHECKS[solver](options)


def build_solver(
    problem: Problem, solver: str, options: Mapping[str, object], compiled: bool = False
) -> NlpsolSolver:
    """Set a solver up for a problem.

    Parameters
    ----------
    problem
        The nonlinear program.
    solver
        Name in `SOLVERS`.
    options
        The solver's own options.
    compiled
        Whether to compile the problem's functions; see `nlp.compiled`.
    """
    return SOLVERS[solver](problem, options, compiled)
