"""Solve a Problem with Ipopt or Fatrop, through CasADi: built once, called from many starts.

Fatrop takes problems without bounds, and without constraints unless their derivatives are
written out for it. Its linear algebra is dense and
written for small blocks, where Ipopt's is sparse and general: on problems of tens of variables
the same iterations take a third of the time.
"""

import time
from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from nlp.arrays import FloatArray, finite_vector
from nlp.compiled import callbacks, compiled_callbacks, compiled_functions
from nlp.errors import InputError
from nlp.interrupts import deferred_interrupt
from nlp.options import QUIET, OptionValue, check_options
from nlp.problem import Evaluation, Problem
from nlp.solution import LIMIT, SUCCESS, Solution, Status

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
        ``"ipopt"`` or ``"fatrop"``.
    compiled
        Whether to compile the problem's functions and derivatives to machine code. Built
        once and kept in a cache; with a warning, not compiled where there is no compiler.
        Fatrop takes derivatives that are written out compiled only, asked or not.
    allow_files
        Whether options may name files and libraries; see `nlp.options.check_options`.

    Raises
    ------
    SolverOptionError
        If an option or its value is not one of the solver's.
    InputError
        If there is no such solver, or the solver does not take the problem.
    """

    def __init__(
        self,
        problem: Problem,
        options: Mapping[str, object] | None = None,
        name: str = "ipopt",
        compiled: bool = False,
        allow_files: bool = False,
    ) -> None:
        given = check_options(options or {}, name, allow_files)
        checked = {**problem.options.get(name, {}), **given}
        if name == "fatrop":
            _check_for_fatrop(problem)
        self._first = _first(problem, given, (name, compiled, allow_files))
        quiet = QUIET if name == "ipopt" else {"print_level": 0}
        settings: dict[str, Any] = {name: {**quiet, **checked}, "print_time": False}
        # A NaN is an answer too: the step is shortened. There are no parameters.
        settings |= {"show_eval_warnings": False, "calc_lam_p": False}
        self.problem = problem
        self._name = name
        x = problem.variables
        g = ca.vertcat(*(constraint.expression for constraint in problem.constraints))
        sign = 1.0 if problem.sense == "minimise" else -1.0
        program = {"x": x, "f": sign * problem.objective, "g": g}
        self._solver, self.compiled = _built(problem, program, name, settings, compiled)
        lower = [problem.lower, *(constraint.lower for constraint in problem.constraints)]
        upper = [problem.upper, *(constraint.upper for constraint in problem.constraints)]
        self._bounds = np.stack([np.concatenate(lower), np.concatenate(upper)])
        self._shape = x.sparsity()
        # Converted once: on small problems the conversion is felt at every start.
        parts = np.split(self._bounds, [problem.size], axis=1)  # of variables, of constraints
        limits = [ca.DM(side) for part in parts for side in part]
        zeros = (ca.DM.zeros(problem.size), ca.DM.zeros(g.numel()))
        self._arguments = [ca.DM(), *limits, *zeros]
        self._evaluation = Evaluation(x, [problem.objective, g, *problem.outputs.values()])

    def solve(self, start: npt.ArrayLike) -> Solution:
        """Solve from one start.

        Parameters
        ----------
        start
            Start in the caller's variables, which ``problem.lift`` completes.

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
        earlier: tuple[Status, ...] = ()
        starts = [np.asarray(start, dtype=float)]
        stage = self.problem.first
        if stage is not None and self._first is not None:
            before = self._first.solve(start)
            x = before.variables
            if before.status.success and stage.is_answer(x):
                return self._solution(self.problem.lift(x), before.status, before.earlier, {})
            earlier = (*before.earlier, before.status)
            starts = [x, *starts] if np.all(np.isfinite(x)) else starts
        solution = self._from(starts[0], earlier)
        if self._name == "ipopt" and len(starts) > 1 and _stuck(solution.status):
            solution = self._from(starts[1], (*earlier, solution.status))
        return solution

    def _from(self, start: FloatArray, earlier: tuple[Status, ...]) -> Solution:
        problem = self.problem
        x0 = finite_vector("start", problem.lift(start), problem.size)
        cpu, wall = time.process_time(), time.perf_counter()
        with deferred_interrupt(limited=True):
            found, _, _, _, multipliers, _ = self._solver.call(
                [ca.DM(self._shape, x0), *self._arguments]
            )
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
        status = self._status(cpu, wall)
        return self._solution(
            _dense(found), status, earlier, self._multipliers(_dense(multipliers))
        )

    def _solution(
        self,
        x: FloatArray,
        status: Status,
        earlier: tuple[Status, ...],
        multipliers: Mapping[str, FloatArray],
    ) -> Solution:
        problem = self.problem
        objective, g, *outputs = self._evaluation(x)
        return Solution(
            problem=problem.name,
            sense=problem.sense,
            status=status,
            variables=x,
            objective=float(objective[0, 0]),
            violation=_excess(np.concatenate([x, g.ravel()]), self._bounds),
            outputs=dict(zip(problem.outputs, outputs, strict=True)),
            multipliers=multipliers,
            compiled=self.compiled,
            earlier=earlier,
        )

    def _status(self, cpu: float, wall: float) -> Status:
        stats: Mapping[str, Any] = self._solver.stats()
        ended = str(stats["return_status"])
        if self._name == "fatrop":  # which only says whether it converged
            ended = SUCCESS if stats["success"] else f"Fatrop_Return_Flag_{ended}"
        return Status(
            return_status=ended,
            iterations=int(stats["iter_count"]),
            primal_infeasibility=_last(stats, "inf_pr"),
            dual_infeasibility=_last(stats, "inf_du"),
            barrier=_last(stats, "mu"),
            cpu_seconds=cpu,
            wall_seconds=wall,
        )

    def _multipliers(self, stacked: FloatArray) -> dict[str, FloatArray]:
        constraints = self.problem.constraints
        ends = np.cumsum([constraint.expression.numel() for constraint in constraints])
        parts = np.split(stacked, ends[:-1].astype(int))
        return {block.name: part for block, part in zip(constraints, parts, strict=False)}


def solve(
    problem: Problem, start: npt.ArrayLike, options: Mapping[str, object] | None = None
) -> Solution:
    """Build Ipopt for `problem` and solve it from one start; see `Solver`."""
    return Solver(problem, options).solve(start)


def _stuck(status: Status) -> bool:
    return not status.acceptable and status.return_status != LIMIT


def _first(
    problem: Problem, given: Mapping[str, OptionValue], how: tuple[str, bool, bool]
) -> Solver | None:
    """Set the solver of the first stage up, if there is one."""
    stage = problem.first
    if stage is None:
        return None
    most = min(int(given.get("max_iter", stage.iterations)), stage.iterations)
    return Solver(stage.problem, {**given, "max_iter": most}, *how)


def _built(
    problem: Problem,
    program: Mapping[str, ca.SX],
    name: str,
    settings: Mapping[str, Any],
    compiled: bool,
) -> tuple[ca.Function, bool]:
    """Return CasADi's solver, and whether its functions are compiled."""
    sign = 1.0 if problem.sense == "minimise" else -1.0
    if problem.derivatives is not None:
        functions = callbacks(problem.derivatives, program, sign, name)
        if name == "fatrop":  # takes derivatives from a library only
            library = compiled_functions(functions)
            if library is None:
                allowed = "ipopt; fatrop takes this problem's derivatives compiled only"
                raise InputError("solver", f"fatrop for {problem.name}", allowed)
            return ca.nlpsol("solver", name, str(library), settings), True
        own = {_OPTIONS[one.name()]: one for one in functions if one.name() in _OPTIONS}
        settings = {**settings, **own}
    solver = ca.nlpsol("solver", name, program, settings)
    library = compiled_callbacks(solver) if compiled else None
    if library is None:
        return solver, False
    plain = {key: value for key, value in settings.items() if key not in _OPTIONS.values()}
    return ca.nlpsol("solver", name, str(library), plain), True


def _check_for_fatrop(problem: Problem) -> None:
    bounded = np.any(np.isfinite(problem.lower)) or np.any(np.isfinite(problem.upper))
    suited = problem.derivatives is not None and problem.derivatives.shift is not None
    if bounded or (problem.constraints and not suited):
        allowed = "problems without constraints or bounds; ipopt takes all"
        raise InputError("solver", f"fatrop for {problem.name}", allowed)
    if not ca.has_nlpsol("fatrop"):
        raise InputError("solver", "fatrop", "ipopt; this CasADi comes without Fatrop")


def _last(stats: Mapping[str, Mapping[str, list[float]]], name: str) -> float:
    history = stats.get("iterations", {}).get(name, [])
    return float(history[-1]) if history else float("nan")


def _dense(column: ca.DM) -> FloatArray:
    # Several times faster than DM's own conversion to an array.
    return np.array(column.nonzeros(), dtype=np.float64)


def _excess(values: FloatArray, bounds: FloatArray) -> float:
    """Largest distance outside the bounds, shape (2, size); NaN if a value is NaN."""
    lower, upper = bounds
    with np.errstate(invalid="ignore"):  # infinite values without bounds
        return float(np.max(np.maximum(lower - values, values - upper), initial=0.0))
