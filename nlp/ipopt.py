"""Solve a Problem with Ipopt, through CasADi."""

from __future__ import annotations

import time
from collections.abc import Mapping

import casadi as ca
import numpy as np
import numpy.typing as npt

from nlp.arrays import FloatArray, finite_vector
from nlp.interrupts import deferred_interrupt
from nlp.ipopt_options import OptionValue, check_options
from nlp.problem import Problem
from nlp.solution import Solution, Status

# Silent, and never reading an ipopt.opt that happens to lie in the working folder.
QUIET: Mapping[str, OptionValue] = {"print_level": 0, "sb": "yes", "option_file_name": ""}


class IpoptSolver:
    """Ipopt set up for one problem: built once, called from many starts.

    Parameters
    ----------
    problem
        The nonlinear program.
    options
        Ipopt options by Ipopt's own names, for instance ``{"max_iter": 500}``.

    Raises
    ------
    SolverOptionError
        If an option or its value is not one of Ipopt's.
    """

    def __init__(self, problem: Problem, options: Mapping[str, object] | None = None) -> None:
        self.problem = problem
        checked = check_options(options or {})
        x = problem.variables
        g = ca.vertcat(*(constraint.expression for constraint in problem.constraints))
        sign = 1.0 if problem.sense == "minimise" else -1.0
        self._solver = ca.nlpsol(
            "solver",
            "ipopt",
            {"x": x, "f": sign * problem.objective, "g": g},
            {"ipopt": {**QUIET, **checked}, "print_time": False},
        )
        self._lower = _stacked([np.asarray(c.lower) for c in problem.constraints])
        self._upper = _stacked([np.asarray(c.upper) for c in problem.constraints])
        names = list(problem.outputs)
        self._evaluate = ca.Function(
            "evaluate", [x], [problem.objective, g, *(problem.outputs[k] for k in names)]
        )

    def solve(self, start: npt.ArrayLike) -> Solution:
        """Solve from one start.

        Parameters
        ----------
        start
            Start in the caller's variables, which ``problem.lift`` completes.

        Returns
        -------
        Solution
            Whatever came out: look at its status, and check its point.

        Raises
        ------
        InputError
            If the start has a wrong shape or is not finite.
        KeyboardInterrupt
            If the user interrupted while Ipopt ran.
        """
        problem = self.problem
        x0 = finite_vector("start", problem.lift(np.asarray(start, dtype=float)), problem.size)
        cpu, wall = time.process_time(), time.perf_counter()
        with deferred_interrupt():
            answer = self._solver(
                x0=x0, lbx=problem.lower, ubx=problem.upper, lbg=self._lower, ubg=self._upper
            )
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
        return self._solution(answer, cpu, wall)

    def _solution(self, answer: Mapping[str, ca.DM], cpu: float, wall: float) -> Solution:
        problem, stats = self.problem, self._solver.stats()
        x = np.array(answer["x"], dtype=float).ravel()
        objective, g, *outputs = self._evaluate(x)
        excess = _excess(x, np.asarray(problem.lower), np.asarray(problem.upper))
        excess_g = _excess(np.array(g, dtype=float).ravel(), self._lower, self._upper)
        status = Status(
            return_status=str(stats["return_status"]),
            iterations=int(stats["iter_count"]),
            primal_infeasibility=_last(stats, "inf_pr"),
            dual_infeasibility=_last(stats, "inf_du"),
            barrier=_last(stats, "mu"),
            cpu_seconds=cpu,
            wall_seconds=wall,
        )
        return Solution(
            problem=problem.name,
            sense=problem.sense,
            status=status,
            variables=x,
            objective=float(objective),
            violation=max(excess, excess_g),
            outputs={
                name: np.array(value, dtype=float)
                for name, value in zip(problem.outputs, outputs, strict=True)
            },
            multipliers=self._multipliers(np.array(answer["lam_g"], dtype=float).ravel()),
        )

    def _multipliers(self, stacked: FloatArray) -> dict[str, FloatArray]:
        sizes = [constraint.expression.numel() for constraint in self.problem.constraints]
        parts = np.split(stacked, np.cumsum(sizes)[:-1]) if sizes else []
        return {
            constraint.name: part
            for constraint, part in zip(self.problem.constraints, parts, strict=True)
        }


def solve(
    problem: Problem, start: npt.ArrayLike, options: Mapping[str, object] | None = None
) -> Solution:
    """Build Ipopt for `problem` and solve it from one start; see `IpoptSolver`."""
    return IpoptSolver(problem, options).solve(start)


def _stacked(parts: list[FloatArray]) -> FloatArray:
    return np.concatenate(parts) if parts else np.zeros(0)


def _excess(values: FloatArray, lower: FloatArray, upper: FloatArray) -> float:
    """Largest distance outside the bounds; NaN if a value is NaN."""
    if not values.size:
        return 0.0
    return float(np.max(np.maximum(np.maximum(lower - values, values - upper), 0.0)))


def _last(stats: Mapping[str, Mapping[str, list[float]]], name: str) -> float:
    history = stats.get("iterations", {}).get(name, [])
    return float(history[-1]) if history else float("nan")
