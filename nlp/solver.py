"""Solve a Problem with Ipopt or Fatrop, through CasADi: built once, called from many starts.

What one solver alone needs is in `ipopt` and `fatrop`.
"""

import math
import threading
import time
from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from lockedjoint.nlp.arrays import FloatArray, finite_vector
from lockedjoint.nlp.callbacks import callbacks
from lockedjoint.nlp.errors import of_kind
from lockedjoint.nlp.fatrop import check_for_fatrop, fatrop_call
from lockedjoint.nlp.gauss_newton import GaussNewton
from lockedjoint.nlp.ipopt import ipopt_call
from lockedjoint.nlp.options import QUIET, check_options
from lockedjoint.nlp.problem import (
    INVALID,
    LIMIT,
    Constraint,
    Evaluation,
    Problem,
    Solution,
    Status,
)


class Solver:
    """A solver set up for one problem.

    Parameters
    ----------
    problem
        The nonlinear program.
    options
        The solver's options by its own names, for instance ``{"max_iter": 500}``, over those of
        the problem. A first stage takes them too, but ``max_iter`` only if it is lower there.
    name
        ``"ipopt"`` or ``"fatrop"``. Fatrop's functions and derivatives are compiled to machine
        code, once: it is kept in a cache. Without a compiler there is a warning, and Fatrop
        takes no derivatives that are written out.

    Raises
    ------
    SolverOptionError
        If an option or its value is not one of the solver's.
    InputError
        If there is no such solver, or the solver does not take the problem.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> arm = lj.arm("unit-revolute", joints=7)
    >>> solver = lj.Solver(lj.residual.build(arm), {"max_iter": 200})
    >>> try:
    ...     lj.Solver(lj.residual.build(arm), {"max_itr": 200})
    ... except lj.SolverOptionError as error:
    ...     print(error)
    Ipopt option is max_itr; allowed: the name of an option in Ipopt's option reference.
    """

    def __init__(
        self, problem: Problem, options: Mapping[str, object] | None = None, name: str = "ipopt"
    ) -> None:
        of_kind("problem", problem, Problem, "a Problem")
        given = check_options(options or {}, name)
        checked = {**problem.options.get(name, {}), **given}
        if name == "ipopt" and checked.get("derivative_test", "none") != "none":
            # Ipopt tests at a point up to 10 away by default, where f may have no value.
            checked.setdefault("point_perturbation_radius", 0.0)
        if name == "fatrop":
            check_for_fatrop(problem)
        self._first: Solver | GaussNewton | None = None
        if (stage := problem.first) is not None:
            most = min(int(given.get("max_iter", stage.iterations)), stage.iterations)
            if stage.rows is None:
                self._first = Solver(stage.problem, {**given, "max_iter": most}, name)
            else:
                variables = stage.problem.variables
                self._first = GaussNewton(variables, stage.rows, most, name == "fatrop")
        quiet = QUIET if name == "ipopt" else {"print_level": 0}
        settings: dict[str, Any] = {name: {**quiet, **checked}, "print_time": False}
        # A NaN is an answer too: the step is shortened. There are no parameters.
        settings |= {"show_eval_warnings": False, "calc_lam_p": False}
        self.problem = problem
        self._name, self._size = name, problem.size
        self._lock = threading.RLock()  # its memory is one thread's at a time
        x = problem.variables
        g = ca.vertcat(*(constraint.expression for constraint in problem.constraints))
        sign = 1.0 if problem.sense == "minimise" else -1.0
        program = {"x": x, "f": sign * problem.objective, "g": g}
        parts: tuple[Problem | Constraint, ...] = (problem, *problem.constraints)
        self._bounds = np.concatenate([np.stack([p.lower, p.upper]) for p in parts], axis=1)
        functions: tuple[ca.Function, ...] = ()
        if problem.derivatives is not None:
            functions = callbacks(problem.derivatives, program, sign, name)
        if name == "fatrop":
            self._call = fatrop_call(problem, program, functions, settings, self._bounds)
        else:
            self._call = ipopt_call(program, functions, settings, self._bounds)
        self._evaluation = Evaluation(x, [problem.objective, g, *problem.outputs.values()])

    def solve(self, start: npt.ArrayLike) -> Solution:
        """Solve from one start.

        Parameters
        ----------
        start
            Start in the caller's variables, which ``problem.complete_start`` completes.

        Returns
        -------
        Solution
            Whatever came out: look at its status, and check its point. Where the problem has a
            first stage and Ipopt is stuck after it, it is solved from the given start itself.

        Raises
        ------
        InputError
            If the start has a wrong shape or is not finite.
        KeyboardInterrupt
            If the user interrupted while the solver ran.
        """
        given = np.asarray(start, dtype=float)
        starts: list[FloatArray] = [given]
        earlier: tuple[Status, ...] = ()
        stage = self.problem.first
        with self._lock:
            if stage is not None and self._first is not None:
                x, _, status = self._first.run(given)
                if status.success and stage.is_answer(x):
                    return self._solution(self.problem.complete_start(x), None, status, ())
                earlier = (status,)
                starts = [x, given] if np.isfinite(x).all() else starts
            x, multipliers, status = self.run(starts[0])
            stuck = not status.acceptable and status.return_status != LIMIT
            if self._name == "ipopt" and len(starts) > 1 and stuck:
                earlier = (*earlier, status)
                x, multipliers, status = self.run(starts[1])
            return self._solution(x, multipliers, status, earlier)

    def run(self, start: FloatArray) -> tuple[FloatArray, FloatArray, Status]:
        """Return the point, its multipliers and how it ended, without any first stage.

        Shapes (variables,) and (rows of all constraints,).
        """
        problem = self.problem
        x0 = finite_vector("start", problem.complete_start(start), self._size)
        needed = self._evaluation(x0) if self._call.needs_values else []
        if not all(np.isfinite(value).all() for value in needed):
            lost = Status(INVALID, 0, math.nan, math.nan, math.nan, 0.0, 0.0)
            return x0, np.zeros(self._bounds.shape[1] - self._size), lost
        cpu, wall = time.process_time(), time.perf_counter()
        x, multipliers = self._call(x0)
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
        ended, iterations, history, _ = self._call.ended()
        primal, dual, barrier = (
            float(history[name][-1]) if history.get(name) else math.nan
            for name in ("inf_pr", "inf_du", "mu")
        )
        return x, multipliers, Status(ended, iterations, primal, dual, barrier, cpu, wall)

    def _solution(
        self,
        x: FloatArray,
        multipliers: FloatArray | None,
        status: Status,
        earlier: tuple[Status, ...],
    ) -> Solution:
        """Return a point and what is known of it, recomputed from the problem's expressions."""
        problem, blocks = self.problem, dict[str, FloatArray]()
        if multipliers is not None:
            rows = np.cumsum([block.expression.numel() for block in problem.constraints])
            names = [block.name for block in problem.constraints]
            blocks = dict(zip(names, np.split(multipliers, rows), strict=False))
        objective, g, *outputs = self._evaluation(x)
        return Solution(
            problem=problem.name,
            sense=problem.sense,
            status=status,
            variables=x,
            objective=float(objective[0, 0]),
            violation=self._violation(np.concatenate([x, g.ravel()])),
            outputs=dict(zip(problem.outputs, outputs, strict=True)),
            multipliers=blocks,
            earlier=earlier,
        )

    def _violation(self, values: FloatArray) -> float:
        """Return the largest distance outside the bounds of x and then g; NaN if one is NaN."""
        if np.isnan(values).any():
            return float("nan")
        lower, upper = self._bounds
        return float(np.maximum(lower - values, values - upper).max(initial=0.0))


def solve(
    problem: Problem, start: npt.ArrayLike, options: Mapping[str, object] | None = None
) -> Solution:
    """Build Ipopt for `problem` and solve it from one start; see `Solver`."""
    return Solver(problem, options).solve(start)
