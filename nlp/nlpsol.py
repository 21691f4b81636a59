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
from nlp.evaluation import Evaluation
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
        self.compiled = library is not None
        self._lower = _stacked([np.asarray(c.lower) for c in problem.constraints])
        self._upper = _stacked([np.asarray(c.upper) for c in problem.constraints])
        self._limits = tuple(
            None if np.all(np.isinf(low)) and np.all(np.isinf(high)) else (low, high)
            for low, high in (
                (np.asarray(problem.lower), np.asarray(problem.upper)),
                (self._lower, self._upper),
            )
        )
        self._shape = x.sparsity()
        # Converted once: on small problems the conversion is felt at every start.
        bounds = (problem.lower, problem.upper, self._lower, self._upper)
        self._arguments = [
            *(ca.DM(), *(ca.DM(np.asarray(bound)) for bound in bounds)),
            *(ca.DM.zeros(problem.size), ca.DM.zeros(g.numel())),
        ]
        self._evaluation = Evaluation(x, [problem.objective, g, *problem.outputs.values()])

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
            x, _, _, _, multipliers, _ = self._solver.call(
                [ca.DM(self._shape, x0), *self._arguments]
            )
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
        return self._solution(_dense(x), _dense(multipliers), cpu, wall)

    def _solution(
        self, x: FloatArray, multipliers: FloatArray, cpu: float, wall: float
    ) -> Solution:
        problem = self.problem
        (objective, g, *outputs) = self._evaluation(x)
        variables, rows = self._limits
        excess, excess_g = _excess(x, variables), _excess(g.ravel(), rows)
        return Solution(
            problem=problem.name,
            sense=problem.sense,
            status=self.status(self._solver.stats(), cpu, wall),
            variables=x,
            objective=float(objective[0, 0]),
            violation=max(excess, excess_g),
            outputs=dict(zip(problem.outputs, outputs, strict=True)),
            multipliers=self._multipliers(multipliers),
            compiled=self.compiled,
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


def _dense(column: ca.DM) -> FloatArray:
    # Several times faster than DM's own conversion to an array.
    return np.array(column.nonzeros(), dtype=np.float64)


def _excess(values: FloatArray, limits: tuple[FloatArray, FloatArray] | None) -> float:
    """Largest distance outside the bounds; NaN if a value is NaN."""
    if not values.size:
        return 0.0
    if limits is None:
        return 0.0 if np.isfinite(values).all() else float("nan")
    lower, upper = limits
    return float(np.max(np.maximum(np.maximum(lower - values, values - upper), 0.0)))
