"""The relaxation: how good any answer could be, as a semidefinite program in cvxpy.

X_f = s·j_f j_fᵀ with s = 1/t, t the square of the worst case. The program drops that X_f has
rank one. Joints that are alike share one X. A set F of k joints locks at once; w_F says how
likely F is, divided by the same of the likeliest set, and w is the least w_F. M = Σ_f X_f::

    minimise   s                          over s, X_f ⪰ 0 and Y_B
    subject to ⟨A, X_f⟩ = b·s  or  ≤ b·s        the joints' own conditions, `GramCondition`
               M − Σ_{f∈F} X_f ⪰ w_F² I         for every set F that may lock
               [[Y_B, w I], [w I, M_B − w² I]] ⪰ 0,   tr Y_B ≤ n_B − m_B

Then σ ≤ 1/√s. The variable of the program is s·T/m, T the largest ‖J‖_F²: it has no unit.

The first line is what a joint can contribute, the second is eq. (5). Alone they say little. The
third line adds up the conditions of all failures (eq. 6): j_fᵀ(M − tI)⁻¹j_f ≤ 1 holds for each
of n joints, so that tr (M/t − I)⁻¹ ≤ n − m. It holds for all rows of J, and for the linear and
the rotational rows alone: B names the rows, m_B is their number, and n_B joints reach them.
Where k joints lock the last condition is, with α = (k − 1)/(n_B − 1),

    (1 − α)(m_B + tr Y_B)²/n_B + α(m_B + 2 tr Y_B + ‖Y_B‖²) ≤ m_B + tr Y_B.

It is the mean of tr K_F² ≤ tr K_F over the sets F, where K = Jᵀ(M − tI)⁻¹J and K_F is its part
with the rows and columns F.

Linear and rotational rows of max-min are measured in units of their own, powers of 2, so that
long and short lever arms give numbers of about the same size. In these units I is
diag(1/unit²).

``isotropy`` adds M = (tr M/m) I and ‖X_f‖ ≤ tr M/m − w_F²; in place of the norm, which is the
trace where the rank is one, stands tr X_f. ``residual`` has s = 1 and minimises ½‖M − (tr M/m)
I‖².

Convexity does not carry these: which eigenvalues the *mean* over failures leaves (several
locked joints, `lockedjoint.formulations.bounds.closed_form`), angles between columns, and
joints that never fail, for which the third line says nothing.

The value of a solver is numerical. `lockedjoint.formulations.bounds.relaxation_proof` makes a
proof of its multipliers.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from math import log2, nan, sqrt
from typing import Any, Literal, TypeAlias, get_args

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from lockedjoint.formulations.conic import SOLVER, check_solver, run
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.joint import (
    GramCondition,
    checked_conditions,
    trace_condition,
)
from lockedjoint.formulations.measures.jacobian import check_locked
from lockedjoint.formulations.measures.unequal_failures import FailureModel
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError, of_kind, one_of

Statement: TypeAlias = Literal["max-min", "isotropy", "residual"]
# A spatial column has the six rows (v; ω).
_SPATIAL = 6
_LINEAR = slice(0, 3)
_ROTATIONAL = slice(3, 6)
_STATUSES = ("optimal", "optimal_inaccurate")
#: Relative tolerance of the default solver.
TOLERANCE = 1e-11


@dataclass(frozen=True)
class Kind:
    """Joints that are alike: they share one X.

    Attributes
    ----------
    conditions
        What the matrix X of each satisfies, in the units of the rows.
    odds
        The odds of their failure, 0 if they never fail.
    count
        How many there are.
    """

    conditions: tuple[GramCondition, ...]
    odds: float
    count: int

    @cached_property
    def support(self) -> list[int]:
        """The rows of the column that its conditions do not say to be 0, by number."""
        zero: set[int] = set()
        for one in self.conditions:
            if one.equal and one.limit == 0 and _is_sum_of_squares(one):
                zero |= set(np.flatnonzero(np.diag(one.matrix)).tolist())
        return [row for row in range(len(self.conditions[0].matrix)) if row not in zero]

    def reaches(self, rows: slice) -> bool:
        """Whether some of these rows of the column can be other than 0."""
        return any(rows.start <= row < rows.stop for row in self.support)

    def on_support(self, matrix: NDArray[Any]) -> NDArray[Any]:
        """Return the rows and columns of a matrix that are in the support."""
        return matrix[np.ix_(self.support, self.support)]


def _is_sum_of_squares(condition: GramCondition) -> bool:
    """Whether the condition is on a sum of squares of entries, with weights of at least 0."""
    weights = np.diag(condition.matrix)
    return np.array_equal(np.diag(weights), condition.matrix) and bool(np.all(weights >= 0))


@dataclass(frozen=True)
class Failure:
    """Sets of joints that lock at once, alike but for the choice among equal joints.

    Attributes
    ----------
    counts
        How many joints of each kind lock.
    weight
        w_F: how likely the set is, over the likeliest.
    """

    counts: tuple[int, ...]
    weight: float


@dataclass(frozen=True)
class Block:
    """Rows of J for which the conditions of all failures add up.

    Attributes
    ----------
    name
        ``all``, ``linear`` or ``rotational``.
    rows
        The rows.
    joints
        n_B: how many joints reach them; all of these may fail.
    """

    name: str
    rows: slice
    joints: int

    @property
    def size(self) -> int:
        """m_B, the number of rows."""
        return self.rows.stop - self.rows.start  # type: ignore[no-any-return]


@dataclass(frozen=True)
class Parts:
    """What the program is made of, without any numbers of a solver.

    Attributes
    ----------
    task_dimension
        m.
    locked
        k, how many joints lock at once.
    kinds, failures, blocks
        Joints, sets of them, and rows.
    units
        The unit of each row, a power of 2.
    """

    task_dimension: int
    locked: int
    kinds: tuple[Kind, ...]
    failures: tuple[Failure, ...]
    blocks: tuple[Block, ...]
    units: tuple[float, ...]

    def alike(self, number: int) -> tuple[int, ...]:
        """Return the numbers of all kinds with the conditions of one, with any odds."""
        same = self.kinds[number].conditions
        return tuple(k for k, kind in enumerate(self.kinds) if kind.conditions == same)

    def condition_name(self, number: int, condition: GramCondition) -> str:
        """Return the name of the constraint of a condition on a kind of joint."""
        sharing = self.alike(number) if condition.shared else (number,)
        return f"joint {', '.join(map(str, sharing))}: {condition.name}"

    @property
    def least_weight(self) -> float:
        """w, the least weight of a failure."""
        return min(failure.weight for failure in self.failures)

    @property
    def lost_rows(self) -> str:
        """Name of a block that any k of its joints leave without full rank; or nothing."""
        lost = (one.name for one in self.blocks if one.joints - self.locked < one.size)
        return next(lost, "")


def parts_of(
    arm: Arm,
    failures: int | FailureModel = 1,
    statement: Statement = "max-min",
    *,
    coarse: bool = False,
) -> Parts:
    """Return the parts of the relaxation of an arm.

    Parameters
    ----------
    arm
        The joints.
    failures
        How many joints lock at once, or how likely each fails.
    statement
        ``max-min``, ``isotropy`` or ``residual``.
    coarse
        Whether joints whose conditions differ in the limits alone share one X too, which has
        the mean limits. The program is smaller, and its bound holds as well.

    Raises
    ------
    InputError
        If so many joints cannot lock, or probabilities are not one for each joint; or if a
        joint's conditions are no conditions on its column.
    """
    of_kind("arm", arm, Arm, "an Arm, such as arm('unit-revolute', 7)")
    m, n = arm.shape
    if not isinstance(failures, FailureModel):
        check_locked(n - m, n, failures)
        failures = FailureModel.equally_likely(n, failures)
    elif failures.joints != n:
        raise InputError("failures", f"of {failures.joints} joints", f"of {n} joints")
    stated = [checked_conditions(joint) for joint in arm.joints]
    if coarse:
        stated = _with_mean_limits(stated)
    units = _units(stated, m) if statement == "max-min" else (1.0,) * m
    scaled = {one: tuple(_in_units(of_one, units) for of_one in one) for one in set(stated)}
    each = [(scaled[one], odds) for one, odds in zip(stated, failures.odds, strict=True)]
    counted = Counter(each)
    kinds = tuple(Kind(*alike, count) for alike, count in counted.items())
    place = {alike: number for number, alike in enumerate(counted)}
    weights: dict[tuple[int, ...], float] = {}
    for joints, weight in failures.weights().items():
        chosen = Counter(place[each[joint]] for joint in joints)
        weights.setdefault(tuple(chosen[number] for number in range(len(kinds))), weight)
    blocks = []
    for name, rows in _named_rows(m).items():
        reaching = [kind for kind in kinds if kind.reaches(rows)]
        if all(kind.odds > 0 for kind in reaching):
            blocks.append(Block(name, rows, sum(kind.count for kind in reaching)))
    sets = tuple(Failure(counts, weight) for counts, weight in weights.items())
    return Parts(m, failures.locked, kinds, sets, tuple(blocks), units)


def _with_mean_limits(
    stated: Sequence[tuple[GramCondition, ...]],
) -> list[tuple[GramCondition, ...]]:
    """Return conditions of each joint that hold for the mean of X over joints like it."""
    forms = [tuple(replace(one, limit=0.0, shared=False) for one in each) for each in stated]
    means: dict[tuple[GramCondition, ...], tuple[GramCondition, ...]] = {}
    for form in set(forms):
        limits = [
            [Fraction(one.limit) for one in each]
            for each, of_joint in zip(stated, forms, strict=True)
            if of_joint == form
        ]
        mean = [float(sum(column) / len(column)) for column in zip(*limits, strict=True)]
        means[form] = tuple(
            replace(one, limit=value) for one, value in zip(form, mean, strict=True)
        )
    return [means[form] for form in forms]


def _row_traces(
    stated: Sequence[tuple[GramCondition, ...]], dimension: int
) -> tuple[float, float] | None:
    """Return the largest traces of the linear and of the rotational rows of JJᵀ.

    None where the joints' conditions do not say it in so many words.
    """
    if dimension != _SPATIAL:
        return None
    totals = []
    for rows in (_LINEAR, _ROTATIONAL):
        form = trace_condition("", dimension, rows, 0.0).matrix
        limits = [[one.limit for one in each if one.matrix == form] for each in stated]
        if not all(limits):
            return None
        totals.append(sum(map(min, limits)))
    return (totals[0], totals[1]) if min(totals) > 0 else None


def _units(stated: Sequence[tuple[GramCondition, ...]], dimension: int) -> tuple[float, ...]:
    """Return units of the rows in which v and ω are about equally large; the least is 1."""
    traces = _row_traces(stated, dimension)
    if traces is None:
        return (1.0,) * dimension
    exponent = round(0.5 * (log2(traces[0]) - log2(traces[1])))
    linear, rotational = 2.0 ** max(exponent, 0), 2.0 ** max(-exponent, 0)
    return (linear,) * 3 + (rotational,) * 3


def _in_units(condition: GramCondition, units: tuple[float, ...]) -> GramCondition:
    """Return the same condition on a column in other units: only powers of 2 change."""
    matrix = np.array(condition.matrix)
    scaled = matrix * np.outer(units, units)
    factor = 2.0 ** -round(log2(np.abs(scaled).max() / np.abs(matrix).max()))
    rows = tuple(map(tuple, (factor * scaled).tolist()))
    return replace(condition, matrix=rows, limit=factor * condition.limit)


def _named_rows(m: int) -> Mapping[str, slice]:
    named = {"all": slice(0, m)}
    if m == _SPATIAL:
        named |= {"linear": _LINEAR, "rotational": _ROTATIONAL}
    return named


class Relaxation(cp.Problem):  # type: ignore[misc]
    """The program: a `cvxpy.Problem` whose parts have names.

    Attributes
    ----------
    statement
        ``max-min``, ``isotropy`` or ``residual``.
    parts
        Joints, failures and rows that it is made of.
    named
        The constraints by name. Variables have names too: ``s``, ``X 0``, ``Y all``.
    squares
        The X of each kind of joint.
    scale
        By which the value is divided to give 1/t, about T/m; of the residual X = `scale`·Σ jjᵀ.
    """

    def __init__(
        self,
        statement: Statement,
        parts: Parts,
        objective: Any,
        named: Mapping[str, Any],
        squares: tuple[Any, ...],
        scale: float,
    ) -> None:
        super().__init__(objective, list(named.values()))
        self.statement, self.parts, self.named = statement, parts, dict(named)
        self.squares, self.scale = squares, scale


def build(
    arm: Arm,
    failures: int | FailureModel = 1,
    statement: Statement = "max-min",
    *,
    coarse: bool = False,
) -> Relaxation:
    """State the relaxation of a statement on an arm.

    Parameters
    ----------
    arm
        The joints.
    failures
        How many joints lock at once, or how likely each fails; of the residual none does.
    statement
        ``max-min``, ``isotropy`` or ``residual``.
    coarse
        See `parts_of`.

    Returns
    -------
    Relaxation
        Its value is a lower bound on T/(mσ²), or on the residual in units of (T/m)².

    Raises
    ------
    InputError
        If there is no such statement, or so many joints cannot lock.
    """
    one_of("statement", statement, get_args(Statement))
    parts = parts_of(arm, failures, statement, coarse=coarse)
    m, kinds = parts.task_dimension, parts.kinds
    scale = _scale(arm, parts, statement)
    s = cp.Variable(nonneg=True, name="s") if statement != "residual" else cp.Constant(1.0)
    squares = tuple(_square(kind, f"X {number}") for number, kind in enumerate(kinds))
    gram = sum(kind.count * x for kind, x in zip(kinds, squares, strict=True))
    mean, unit = cp.trace(gram) / m, np.diag(np.array(parts.units) ** -2.0)
    named: dict[str, Any] = {}
    for number, kind in enumerate(kinds):
        for condition in kind.conditions:
            if not np.any(kind.on_support(np.array(condition.matrix))):
                continue  # It is met by leaving out the rows that it says to be 0.
            sharing = parts.alike(number) if condition.shared else (number,)
            count = sum(kinds[k].count for k in sharing)
            x = sum(kinds[k].count / count * squares[k] for k in sharing)
            value, limit = cp.trace(np.array(condition.matrix) @ x), condition.limit / scale * s
            stated = value == limit if condition.equal else value <= limit
            named[parts.condition_name(number, condition)] = stated
    if statement == "residual":
        goal = 0.5 * cp.sum_squares(gram - mean * np.eye(m))
        return Relaxation(statement, parts, cp.Minimize(goal), named, squares, scale)
    for failure in parts.failures:
        locked = sum(count * x for count, x in zip(failure.counts, squares, strict=True))
        square = failure.weight**2
        named[f"failure {failure.counts}"] = gram - locked >> square * unit
        for number, count in enumerate(failure.counts if statement == "isotropy" else ()):
            if count:
                norm = cp.trace(squares[number])
                named[f"norm {number} of {failure.counts}"] = norm <= mean - square
    if statement == "isotropy":
        named["isotropic"] = gram == mean * np.eye(m)
    for block in parts.blocks:
        named |= _all_failures(parts, block, gram[block.rows, block.rows])
    return Relaxation(statement, parts, cp.Minimize(s), named, squares, scale)


def _square(kind: Kind, name: str) -> Any:
    """Return X of a kind of joints: a variable for the rows that can be other than 0."""
    size, m = len(kind.support), len(kind.conditions[0].matrix)
    variable = cp.Variable((size, size), PSD=True, name=name)
    if size == m:
        return variable
    placed = np.eye(m)[:, kind.support]
    return placed @ variable @ placed.T


def _scale(arm: Arm, parts: Parts, statement: Statement) -> float:
    """Return T/m in the units of the rows; isotropic J have the least mean of both blocks."""
    m = parts.task_dimension
    traces = _row_traces([joint.gram_conditions for joint in arm.joints], m)
    if traces is None or statement == "residual":
        return arm.largest_trace / m
    if statement == "isotropy":
        return min(traces) / 3
    linear, rotational = parts.units[0], parts.units[-1]
    return (traces[0] / linear**2 + traces[1] / rotational**2) / m


def _all_failures(parts: Parts, block: Block, gram: Any) -> Mapping[str, Any]:
    """Return the conditions of all failures of a block's joints, added up."""
    m, n, k, w = block.size, block.joints, parts.locked, parts.least_weight
    root = np.diag(1 / np.array(parts.units[block.rows]))
    y = cp.Variable((m, m), symmetric=True, name=f"Y {block.name}")
    schur = cp.bmat([[y, w * root], [w * root, gram - w**2 * root**2]]) >> 0
    total = cp.trace(y) <= n - m
    if 1 < k < n:
        share = (k - 1) / (n - 1)
        first = (1 - share) / n * cp.square(m + cp.trace(y))
        second = share * (m + 2 * cp.trace(y) + cp.sum_squares(y))
        total = first + second <= m + cp.trace(y)
    return {f"inverse, {block.name}": schur, f"all failures, {block.name}": total}


@dataclass(frozen=True, eq=False)
class RelaxationSolution:
    """What a solver made of a relaxation: numerical.

    Attributes
    ----------
    problem
        The relaxation.
    solver, status
        The solver's name and its status, whole.
    value
        What the program minimises, as the solver says; NaN if it has no answer.
    multipliers
        Dual values of the constraints by name.
    seconds
        Time of the solver's run, by the clock.
    """

    problem: Relaxation
    solver: str
    status: str
    value: float
    multipliers: Mapping[str, FloatArray]
    seconds: float

    @property
    def bound(self) -> float:
        """The value as a bound on the score: on σ from above, on the residual from below.

        Numerical, and NaN without an answer.
        """
        if self.problem.statement == "residual":
            return self.problem.scale**2 * max(self.value, 0.0)
        return sqrt(self.problem.scale / self.value) if self.value > 0 else nan


def accurate(tolerance: float = TOLERANCE) -> dict[str, object]:
    """Return Clarabel's options for a tolerance; a proof loses about its square."""
    return {"tol_gap_abs": tolerance, "tol_gap_rel": tolerance, "tol_feas": tolerance}


def solve(
    problem: Relaxation, solver: str = SOLVER, options: Mapping[str, object] | None = None
) -> RelaxationSolution:
    """Solve a relaxation with any solver of semidefinite programs that cvxpy has.

    Parameters
    ----------
    problem
        What `build` returned.
    solver
        Its name in cvxpy.
    options
        The solver's own options, by its own names; `accurate` ones for Clarabel if none are
        given.

    Raises
    ------
    InputError
        If the solver is not installed.
    """
    of_kind("problem", problem, Relaxation, "a Relaxation, as `build` returns")
    solver = check_solver(solver)
    begun = time.perf_counter()
    if options is None:
        options = accurate() if solver == SOLVER else {}
    status = run(problem, solver, options)
    seconds = time.perf_counter() - begun
    duals = {name: one.dual_value for name, one in problem.named.items()}
    multipliers: dict[str, FloatArray] = {}
    if status in _STATUSES and all(value is not None for value in duals.values()):
        multipliers = {name: np.asarray(value, dtype=float) for name, value in duals.items()}
    value = float(problem.value) if multipliers else nan
    return RelaxationSolution(problem, solver, status, value, multipliers, seconds)
