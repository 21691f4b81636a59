"""Solve a Problem with Ipopt or Fatrop, through CasADi: built once, called from many starts.

Fatrop takes problems without bounds, and without constraints unless their derivatives are
written out for it. Its linear algebra is dense and written for small blocks, where Ipopt's is
sparse and general: with tens of variables the same iterations take a third of the time.
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
from lockedjoint.nlp.compiled import INVALID, Generated, callbacks, compiled_solver, generated
from lockedjoint.nlp.errors import InputError, of_kind
from lockedjoint.nlp.gauss_newton import GaussNewton
from lockedjoint.nlp.options import QUIET, check_options
from lockedjoint.nlp.problem import (
    LIMIT,
    SUCCESS,
    Buffered,
    Constraint,
    Evaluation,
    Problem,
    Solution,
    Status,
)

# MUMPS keeps global state: in one process it solves one problem at a time.
_ONE_AT_A_TIME = threading.Lock()
# CasADi's names of derivatives, and of the options that replace them.
_OPTIONS = {"nlp_hess_l": "hess_lag", "nlp_jac_g": "jac_g"}


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
            _check_for_fatrop(problem)
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
        self._call = _built(problem, program, sign, name, settings, self._bounds)
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
        """Return the point, its multipliers and how it ended, without any first stage."""
        problem = self.problem
        x0 = finite_vector("start", problem.complete_start(start), self._size)
        # From where its functions have no values, Fatrop called by CasADi never ends.
        unsafe = self._name == "fatrop" and isinstance(self._call, _Call)
        if unsafe and not all(np.isfinite(value).all() for value in self._evaluation(x0)):
            lost = Status(INVALID, 0, math.nan, math.nan, math.nan, 0.0, 0.0)
            return x0, np.zeros(self._bounds.shape[1] - self._size), lost
        cpu, wall = time.process_time(), time.perf_counter()
        x, multipliers = self._call(x0)
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
        ended, iterations, history = self._call.ended()
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
        """Largest distance outside the bounds; NaN if a value is NaN."""
        if np.isnan(values).any():
            return float("nan")
        lower, upper = self._bounds
        return float(np.maximum(lower - values, values - upper).max(initial=0.0))


class _Call:
    """Calls CasADi's solver on arrays of its own."""

    def __init__(self, solver: ca.Function, bounds: FloatArray, size: int, name: str) -> None:
        self._solver, self._name = solver, name
        self._memory = int(solver.checkout())  # by which statistics are asked for
        solver.release(self._memory)  # the buffer takes it
        (lbx, lbg), (ubx, ubg) = (np.split(side, [size]) for side in bounds)
        self._start, self._found = np.zeros(size), np.zeros(size)
        self._multipliers = np.zeros(bounds.shape[1] - size)
        arguments = {"x0": self._start, "lbx": lbx, "ubx": ubx, "lbg": lbg, "ubg": ubg}
        results = {"x": self._found, "lam_g": self._multipliers}
        self._buffered = Buffered(
            solver,
            {solver.index_in(key): array for key, array in arguments.items()},
            {solver.index_out(key): array for key, array in results.items()},
        )

    def __call__(self, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the solver's point and the multipliers of the constraints.

        Raises
        ------
        KeyboardInterrupt
            If the user interrupted: CasADi stops the solver, and Python says only that. What
            another handler of signals raised is raised here, too.
        """
        with _ONE_AT_A_TIME:
            self._start[:] = start
            try:
                self._buffered.run()
            except SystemError as error:
                # What a handler of signals raised while Python was asked for them.
                if error.__cause__ is not None:
                    raise error.__cause__ from None
                raise
            return self._found.copy(), self._multipliers.copy()

    def ended(self) -> tuple[str, int, Mapping[str, Any]]:
        """Return how the solver ended, its iterations, and the statistics of each."""
        stats: Mapping[str, Any] = self._solver.stats(self._memory)
        ended = str(stats["return_status"])
        if self._name == "fatrop":  # which only says whether it converged
            ended = SUCCESS if stats["success"] else f"Fatrop_Return_Flag_{ended}"
        return ended, int(stats["iter_count"]), stats.get("iterations", {})


def solve(
    problem: Problem, start: npt.ArrayLike, options: Mapping[str, object] | None = None
) -> Solution:
    """Build Ipopt for `problem` and solve it from one start; see `Solver`."""
    return Solver(problem, options).solve(start)


def _built(
    problem: Problem,
    program: Mapping[str, ca.SX],
    sign: float,
    name: str,
    settings: Mapping[str, Any],
    bounds: FloatArray,
) -> "_Call | Generated":
    """Return the call of a solver; Fatrop's is all in C, or has compiled functions."""
    functions: tuple[ca.Function, ...] = ()
    if problem.derivatives is not None:
        functions = callbacks(problem.derivatives, program, sign, name)
    if name == "ipopt":
        named = {function.name(): function for function in functions}
        written = {option: named[key] for key, option in _OPTIONS.items() if named}
        solver = ca.nlpsol("solver", name, program, {**settings, **written})
    elif (ours := generated(problem, program, functions, settings)) is not None:
        return ours
    elif (compiled := compiled_solver(program, functions, settings)) is not None:
        solver = compiled
    else:
        allowed = "ipopt; fatrop takes this problem's derivatives compiled only"
        raise InputError("solver", f"fatrop for {problem.name}", allowed)
    return _Call(solver, bounds, problem.size, name)


def _check_for_fatrop(problem: Problem) -> None:
    bounded = np.any(np.isfinite(problem.lower)) or np.any(np.isfinite(problem.upper))
    suited = problem.derivatives is not None and problem.derivatives.shift is not None
    if bounded or (problem.constraints and not suited):
        allowed = "problems without constraints or bounds; ipopt takes all"
        raise InputError("solver", f"fatrop for {problem.name}", allowed)
    if not ca.has_nlpsol("fatrop"):
        raise InputError("solver", "fatrop", "ipopt; this CasADi comes without Fatrop")
