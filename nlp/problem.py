"""A nonlinear program, stated symbolically, and a solver's answer to it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal

import casadi as ca
import numpy as np

from lockedjoint.nlp.arrays import FloatArray, as_floats
from lockedjoint.nlp.errors import InputError, a_function, of_kind, one_of
from lockedjoint.nlp.options import OptionValue

Sense = Literal["minimise", "maximise"]
# Return statuses of Ipopt, verbatim.
#
#: The solver reached its tolerances.
SUCCESS = "Solve_Succeeded"
#: The solver reached its looser, acceptable tolerances, and came no further.
ACCEPTABLE = "Solved_To_Acceptable_Level"
#: The solver made as many iterations as it may.
LIMIT = "Maximum_Iterations_Exceeded"
#: The solver ended where the violation of the constraints has a minimum above 0.
INFEASIBLE = "Infeasible_Problem_Detected"
#: A function or derivative has no value at a point that the solver needs.
INVALID = "Invalid_Number_Detected"
#: Largest violation of a constraint, in the units of the constraint, at a feasible point. A
#: larger number accepts points that are none; Ipopt meets constraints to about 1e-8.
FEASIBLE = 1e-6


@dataclass(frozen=True, eq=False)
class Constraint:
    """A named block of constraints, ``lower <= expression <= upper``.

    Attributes
    ----------
    name
        What the block states, in a word or two.
    expression
        Column of SX expressions, shape (rows, 1).
    lower, upper
        Bounds, each a float for all rows or an array of shape (rows,).

    Examples
    --------
    >>> import casadi as ca
    >>> import lockedjoint as lj
    >>> x = ca.SX.sym("x", 2)
    >>> lj.Constraint("circle", ca.sumsqr(x), 1.0, 1.0).name
    'circle'
    """

    name: str
    expression: ca.SX
    lower: FloatArray | float
    upper: FloatArray | float

    def __post_init__(self) -> None:
        of_kind("name", self.name, str, "a text")
        of_kind("expression", self.expression, ca.SX, "SX expressions")
        object.__setattr__(self, "expression", ca.vec(self.expression))
        _check_bounds(self, self.expression.numel(), (self.name, self.name, self.name))


@dataclass(frozen=True, eq=False)
class Derivatives:
    """Derivatives written out, in place of those by automatic differentiation.

    Attributes
    ----------
    hessian
        Function of x, σ and λ: the Hessian of σ·objective + λ·constraints, shape (size, size),
        or a positive definite approximation of it. The constraints are all blocks' rows.
    jacobian
        Function of x: derivatives of the constraints, shape (rows, size); None for those by
        automatic differentiation.
    shift
        What is added to the Hessian's diagonal for Fatrop, which needs it regular; None where
        Fatrop does not converge.
    """

    hessian: ca.Function
    jacobian: ca.Function | None = None
    shift: float | None = None


@dataclass(frozen=True, eq=False)
class Stage:
    """A problem that is solved first: its solution is the next problem's start.

    Attributes
    ----------
    problem
        The problem, in the variables that the next problem's `complete_start` takes; without
        a first stage.
    iterations
        Most iterations, unless the caller's ``max_iter`` is lower.
    is_answer
        Whether a point at which the solver succeeded solves the next problem too.
    rows
        Column whose sum of squares is the objective, of a problem without constraints and
        bounds: `lockedjoint.nlp.gauss_newton` takes the place of the solver. None for the
        solver.
    """

    problem: Problem
    iterations: int
    is_answer: Callable[[FloatArray], bool] = lambda _: False
    rows: ca.SX | None = None

    def __post_init__(self) -> None:
        if self.problem.first is not None:
            raise InputError("stage", f"{self.problem.name} with a first stage", "two stages")


@dataclass(frozen=True, eq=False)
class Problem:
    """A nonlinear program in the variables x.

    ::

        minimise (or maximise)  objective(x)
        subject to              c.lower <= c.expression(x) <= c.upper   for c in constraints
                                lower <= x <= upper

    Attributes
    ----------
    name
        Name of the statement, for tables and messages.
    variables
        Column of distinct SX symbols, shape (size, 1).
    objective
        Scalar SX expression.
    sense
        ``"minimise"`` or ``"maximise"``.
    constraints
        Named blocks of constraints.
    lower, upper
        Bounds of the variables, shape (size,); unbounded where left out.
    outputs
        Named expressions that a solution reports besides x.
    complete_start
        Takes a start in the caller's own variables to a start in all variables: where a
        statement has auxiliary variables it fills them in. The identity where it has none.
    options
        Options that suit it, by solver; the caller's own take precedence.
    derivatives
        Derivatives written out; None for automatic differentiation.
    first
        What is solved first, from the caller's start; None for nothing.

    Examples
    --------
    >>> import casadi as ca
    >>> import lockedjoint as lj
    >>> x = ca.SX.sym("x", 2)
    >>> on_circle = lj.Constraint("circle", ca.sumsqr(x), 1.0, 1.0)
    >>> problem = lj.Problem("top", x, x[1], sense="maximise", constraints=(on_circle,))
    >>> run = lj.Solver(problem).solve([0.6, 0.7])
    >>> print(run.variables.round(6) + 0.0)
    [0. 1.]
    """

    name: str
    variables: ca.SX
    objective: ca.SX
    sense: Sense = "minimise"
    constraints: tuple[Constraint, ...] = ()
    lower: FloatArray | float = -np.inf
    upper: FloatArray | float = np.inf
    outputs: Mapping[str, ca.SX] = field(default_factory=dict)
    complete_start: Callable[[FloatArray], FloatArray] = lambda point: point
    options: Mapping[str, Mapping[str, OptionValue]] = field(default_factory=dict)
    derivatives: Derivatives | None = None
    first: Stage | None = None

    def __post_init__(self) -> None:
        of_kind("name", self.name, str, "a text")
        one_of("sense", self.sense, ("minimise", "maximise"))
        a_function("complete_start", self.complete_start)
        for name in ("outputs", "options"):
            of_kind(name, getattr(self, name), Mapping, "a mapping from names")
        of_kind("constraints", self.constraints, (tuple, list), "a row of Constraint")
        for constraint in self.constraints:
            of_kind("constraint", constraint, Constraint, "a Constraint")
        for name, expression in self.outputs.items():
            of_kind(f"output {name}", expression, ca.SX, "an SX expression")
        of_kind("derivatives", self.derivatives, (Derivatives, type(None)), "Derivatives")
        of_kind("first", self.first, (Stage, type(None)), "a Stage")
        of_kind("variables", self.variables, ca.SX, "a column of SX symbols")
        of_kind("objective", self.objective, ca.SX, "a scalar SX expression")
        if not self.variables.is_column() or not self.variables.is_valid_input():
            raise InputError("variables", str(self.variables), "a column of SX symbols")
        if not self.objective.is_scalar():
            shape = f"an expression of shape {self.objective.shape}"
            raise InputError("objective", shape, "a scalar expression")
        _check_bounds(self, self.size, ("lower", "upper", "variables"))
        object.__setattr__(self, "outputs", MappingProxyType(dict(self.outputs)))
        self._check_symbols()

    @property
    def size(self) -> int:
        """Number of variables."""
        return int(self.variables.numel())

    def _check_symbols(self) -> None:
        """Raise InputError if a symbol is used that is no variable."""
        known = {symbol.element_hash() for symbol in ca.vertsplit(self.variables)}
        used = ca.vertcat(
            self.objective,
            *(constraint.expression for constraint in self.constraints),
            *(ca.vec(expression) for expression in self.outputs.values()),
        )
        for symbol in ca.symvar(used):
            if symbol.element_hash() not in known:
                raise InputError("variables", f"without {symbol}", "every symbol that is used")


@dataclass(frozen=True)
class Status:
    """How the solver ended, by its own statistics; NaN where it has none.

    Attributes
    ----------
    return_status
        Ipopt's return status, verbatim; success of Fatrop, and of Gauss–Newton steps in a
        first stage, in the same words.
    iterations
        Number of iterations.
    primal_infeasibility, dual_infeasibility, barrier
        ``inf_pr``, ``inf_du`` and ``mu`` at the last iteration.
    cpu_seconds, wall_seconds
        Time inside the solver, without building it.
    """

    return_status: str
    iterations: int
    primal_infeasibility: float
    dual_infeasibility: float
    barrier: float
    cpu_seconds: float
    wall_seconds: float

    @property
    def success(self) -> bool:
        """Whether the solver reports that it reached its tolerances."""
        return self.return_status == SUCCESS

    @property
    def acceptable(self) -> bool:
        """Whether it reports that it reached its tolerances, or the looser acceptable ones."""
        return self.return_status in (SUCCESS, ACCEPTABLE)

    def to_dict(self) -> dict[str, str | int | float]:
        """Return plain values for tables and JSON."""
        return dict(vars(self))


@dataclass(frozen=True, eq=False)
class Solution:
    """A point and what is known of it; to be checked before it is used.

    Attributes
    ----------
    problem, sense
        Name and sense of the problem.
    status
        How the solver ended, in the stage that gave the point.
    variables
        The point, shape (size,).
    objective
        The objective at that point, in the problem's own sense.
    violation
        Largest violation of any constraint or bound, recomputed at the point.
    outputs
        The problem's named outputs at the point, each a 2-D array.
    multipliers
        Lagrange multipliers of each constraint block, by name; none where the point is that
        of an earlier stage.
    earlier
        How it ended in what was solved before, in order: a first stage, see
        `lockedjoint.nlp.problem.Stage`, and an attempt from there that failed.
    """

    problem: str
    sense: Sense
    status: Status
    variables: FloatArray
    objective: float
    violation: float
    outputs: Mapping[str, FloatArray]
    multipliers: Mapping[str, FloatArray]
    earlier: tuple[Status, ...] = ()

    @property
    def feasible(self) -> bool:
        """Whether no constraint or bound is violated by more than `FEASIBLE`."""
        return self.violation <= FEASIBLE


class Buffered:
    """Calls a CasADi function, which reads and writes arrays that it is given by position.

    CasADi's usual call turns arrays into its own matrices and back, which takes several times
    as long as small functions do.

    Parameters
    ----------
    function
        The function.
    arguments, results
        The arrays of its dense arguments and results, by position: doubles, column after
        column. ``run()`` reads the former and changes the latter in place.
    """

    def __init__(
        self,
        function: ca.Function,
        arguments: Mapping[int, FloatArray],
        results: Mapping[int, FloatArray],
    ) -> None:
        buffer: Any
        buffer, self.run = function.buffer()
        for place, array in arguments.items():
            if array.size:
                buffer.set_arg(place, array.data)
        for place, array in results.items():
            if array.size:
                buffer.set_res(place, array.data)
        self._kept = function, buffer, arguments, results  # the buffer keeps no array alive


class Evaluation:
    """Functions of one point, evaluated together.

    Parameters
    ----------
    variables
        Column of symbols.
    expressions
        What to evaluate.
    """

    def __init__(self, variables: ca.SX, expressions: Sequence[ca.SX]) -> None:
        full = [ca.densify(ca.SX(expression)) for expression in expressions]
        function = ca.Function("evaluation", [variables], full)
        self._point = np.zeros(variables.numel())
        self._columns = [np.zeros(expression.shape[::-1]) for expression in full]
        flat = dict(enumerate(column.ravel() for column in self._columns))  # the same memory
        self._call = Buffered(function, {0: self._point}, flat)
        self._lock = threading.Lock()  # the arrays are one thread's at a time

    def __call__(self, point: FloatArray) -> list[FloatArray]:
        """Return the value of each expression at a point, as new arrays of two dimensions."""
        with self._lock:
            self._point[:] = point
            self._call.run()
            return [column.T.copy() for column in self._columns]


def _check_bounds(stated: Constraint | Problem, size: int, names: Sequence[str]) -> None:
    """Make both bounds of `stated` read-only vectors of shape (size,), or refuse them.

    The names are those of lower, of upper and of the pair in messages.
    """
    for side, name in zip(("lower", "upper"), names, strict=False):
        argument = f"bounds of {name}"
        bounds = as_floats(argument, getattr(stated, side)).copy()
        if bounds.ndim == 0:
            bounds = np.full(size, bounds)
        if bounds.shape != (size,):
            raise InputError(argument, f"of shape {bounds.shape}", f"shape ({size},)")
        if np.any(np.isnan(bounds)):
            raise InputError(argument, "NaN", "numbers, or infinity for no bound")
        bounds.setflags(write=False)
        object.__setattr__(stated, side, bounds)
    lower, upper = np.asarray(stated.lower), np.asarray(stated.upper)
    for k in np.flatnonzero(lower > upper):
        pair = f"[{lower[k]:g}, {upper[k]:g}] in row {k}"
        raise InputError(f"bounds of {names[-1]}", pair, "lower <= upper")
