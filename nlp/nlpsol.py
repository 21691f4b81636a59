"""What every solver behind CasADi's ``nlpsol`` shares: building, calling, recomputing."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from nlp.arrays import FloatArray, finite_vector
from nlp.compiled import compiled_callbacks
from nlp.interrupts import deferred_interrupt
from nlp.problem import Problem
from nlp.solution import Solution, Status


class NlpsolSolver(ABC):
    """A solver set up for one problem: built once, called from many starts.

    Parameters
    ----------
    plugin
        CasADi's name of the solver.
    problem
        The nonlinear program.
    settings
        CasADi's options, the plugin's own among them.
    compiled
        Whether to compile the problem's functions and derivatives to machine code. Built
        once and kept in a cache; with a warning, not compiled where there is no compiler.
    """

    def __init__(
        self, plugin: str, problem: Problem, settings: Mapping[str, Any], compiled: bool
    ) -> None:
        self.problem = problem
        x = problem.variables
        g = ca.vertcat(*(constraint.expression for constraint in problem.constraints))
        sign = 1.0 if problem.sense == "minimise" else -1.0
        program = {"x": x, "f": sign * problem.objective, "g": g}
        self._solver = ca.nlpsol("solver", plugin, program, dict(settings))
        library = compiled_callbacks(self._solver) if compiled else None
        if library is not None:
            self._solver = ca.nlpsol("solver", plugin, str(library), dict(settings))
        self._lower = _stacked([np.asarray(c.lower) for c in problem.constraints])
        self._upper = _stacked([np.asarray(c.upper) for c in problem.constraints])
        # Converted once: for small problems the conversion is felt at every start.
        self._bounds = {
            "lbx": ca.DM(np.asarray(problem.lower)),
            "ubx": ca.DM(np.asarray(problem.upper)),
            "lbg": ca.DM(self._lower),
            "ubg": ca.DM(self._upper),
        }
        names = list(problem.outputs)
        self._evaluate = ca.Function(
            "evaluate", [x], [problem.objective, g, *(problem.outputs[k] for k in names)]
        )

    @abstractmethod
    def status(self, stats: Mapping[str, Any], cpu: float, wall: float) -> Status:
        """Return how the last solve ended, from CasADi's statistics and the time it took."""

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
            If the user interrupted while the solver ran.
        """
        problem = self.problem
        x0 = finite_vector("start", problem.lift(np.asarray(start, dtype=float)), problem.size)
        cpu, wall = time.process_time(), time.perf_counter()
        with deferred_interrupt():
            answer = self._solver(x0=x0, **self._bounds)
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
        return self._solution(answer, cpu, wall)

    def _solution(self, answer: Mapping[str, ca.DM], cpu: float, wall: float) -> Solution:
        problem = self.problem
        x = np.array(answer["x"], dtype=float).ravel()
        objective, g, *outputs = self._evaluate(x)
        excess = _excess(x, np.asarray(problem.lower), np.asarray(problem.upper))
        excess_g = _excess(np.array(g, dtype=float).ravel(), self._lower, self._upper)
        status = self.status(self._solver.stats(), cpu, wall)
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


def _stacked(parts: list[FloatArray]) -> FloatArray:
    return np.concatenate(parts) if parts else np.zeros(0)


def _excess(values: FloatArray, lower: FloatArray, upper: FloatArray) -> float:
    """Largest distance outside the bounds; NaN if a value is NaN."""
    if not values.size:
        return 0.0
    return float(np.max(np.maximum(np.maximum(lower - values, values - upper), 0.0)))
