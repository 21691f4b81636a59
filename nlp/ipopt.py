"""Solve a Problem with Ipopt, through CasADi."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy.typing as npt

from nlp.ipopt_options import OptionValue, check_options
from nlp.nlpsol import NlpsolSolver
from nlp.problem import Problem
from nlp.solution import Solution, Status

# Silent, and never reading an ipopt.opt that happens to lie in the working folder.
QUIET: Mapping[str, OptionValue] = {"print_level": 0, "sb": "yes", "option_file_name": ""}


class IpoptSolver(NlpsolSolver):
    """Ipopt set up for one problem: built once, called from many starts.

    Parameters
    ----------
    problem
        The nonlinear program.
    options
        Ipopt options by Ipopt's own names, for instance ``{"max_iter": 500}``.
    compiled
        Whether to compile the problem's functions; see `nlp.compiled`.

    Raises
    ------
    SolverOptionError
        If an option or its value is not one of Ipopt's.
    """

    def __init__(
        self,
        problem: Problem,
        options: Mapping[str, object] | None = None,
        compiled: bool = False,
    ) -> None:
        checked = check_options(options or {})
        settings = {"ipopt": {**QUIET, **checked}, "print_time": False}
        super().__init__("ipopt", problem, settings, compiled)

    def status(self, stats: Mapping[str, Any], cpu: float, wall: float) -> Status:
        """Return how the last solve ended, in Ipopt's own words."""
        return Status(
            return_status=str(stats["return_status"]),
            iterations=int(stats["iter_count"]),
            primal_infeasibility=_last(stats, "inf_pr"),
            dual_infeasibility=_last(stats, "inf_du"),
            barrier=_last(stats, "mu"),
            cpu_seconds=cpu,
            wall_seconds=wall,
        )


def solve(
    problem: Problem, start: npt.ArrayLike, options: Mapping[str, object] | None = None
) -> Solution:
    """Build Ipopt for `problem` and solve it from one start; see `IpoptSolver`."""
    return IpoptSolver(problem, options).solve(start)


def _last(stats: Mapping[str, Mapping[str, list[float]]], name: str) -> float:
    history = stats.get("iterations", {}).get(name, [])
    return float(history[-1]) if history else float("nan")
