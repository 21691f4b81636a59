"""Solve an unconstrained Problem with Fatrop's interior-point code, through CasADi.

Its linear algebra is dense and written for small blocks, where Ipopt's is sparse and general:
on unconstrained problems of tens of variables the same iterations take a third of the time.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from nlp.errors import InputError, SolverOptionError
from nlp.nlpsol import NlpsolSolver
from nlp.problem import Problem
from nlp.solution import SUCCESS, Status

# The options that are passed on, and their kinds; all above 0. The last four say what is added
# to the Hessian where it is not convex: first, by what factor more until it is (the first
# time, later), and by what factor less at the next iteration.
OPTIONS: Mapping[str, type] = {
    "max_iter": int,
    "tol": float,
    "delta_w0": float,
    "kappa_wplusem": float,
    "kappa_wplus": float,
    "kappa_wmin": float,
}


class FatropSolver(NlpsolSolver):
    """Fatrop set up for one problem without constraints or bounds.

    Parameters
    ----------
    problem
        The nonlinear program.
    options
        Those in `OPTIONS`.
    compiled
        Whether to compile the problem's functions; see `nlp.compiled`.

    Raises
    ------
    SolverOptionError
        If an option is another one, or not above 0.
    InputError
        If the problem has constraints or bounds, or this CasADi comes without Fatrop.
    """

    def __init__(
        self,
        problem: Problem,
        options: Mapping[str, object] | None = None,
        compiled: bool = False,
    ) -> None:
        bounded = np.any(np.isfinite(problem.lower)) or np.any(np.isfinite(problem.upper))
        if problem.constraints or bounded:
            allowed = "problems without constraints or bounds; ipopt takes all"
            raise InputError("solver", f"fatrop for {problem.name}", allowed)
        if not ca.has_nlpsol("fatrop"):
            raise InputError("solver", "fatrop", "ipopt; this CasADi comes without Fatrop")
        settings = {
            "fatrop": {"print_level": 0, **check_fatrop_options(options or {})},
            "print_time": False,
        }
        super().__init__("fatrop", problem, settings, compiled)

    def status(self, stats: Mapping[str, Any], cpu: float, wall: float) -> Status:
        """Return how the last solve ended; Fatrop only says whether it converged."""
        flag, nan = stats["return_status"], float("nan")
        return Status(
            return_status=SUCCESS if stats["success"] else f"Fatrop_Return_Flag_{flag}",
            iterations=int(stats["iter_count"]),
            primal_infeasibility=nan,
            dual_infeasibility=nan,
            barrier=nan,
            cpu_seconds=cpu,
            wall_seconds=wall,
        )


def check_fatrop_options(options: Mapping[str, object]) -> dict[str, object]:
    """Return the options; SolverOptionError if one is not Fatrop's or not above 0."""
    for name, value in options.items():
        if name not in OPTIONS:
            raise SolverOptionError("Fatrop option", name, "one of " + ", ".join(OPTIONS))
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        whole = OPTIONS[name] is float or isinstance(value, int)
        if not (number and whole and 0 < float(value) < np.inf):  # type: ignore[arg-type]
            article = "a whole number" if OPTIONS[name] is int else "a number"
            raise SolverOptionError(f"Fatrop option {name}", value, f"{article} above 0")
    return {name: OPTIONS[name](value) for name, value in options.items()}
