"""Fourth statement: how good any answer could be, as a semidefinite program in cvxpy.

X_f = s·j_f j_fᵀ with s = 1/t, t the square of the worst case. Rank one is dropped, and joints
that are alike share one X_f::

    minimise   s                          over s, X_f ⪰ 0 and Y_B
    subject to ⟨A, X_f⟩ = b·s  or  ≤ b·s        the joints' own conditions, `GramCondition`
               M − Σ_{f∈F} X_f ⪰ w_F² I         for every set F of joints that may lock
               [[Y_B, w I], [w I, M_B − w² I]] ⪰ 0,   tr Y_B ≤ n_B − m_B

    with M = Σ X_f; then σ ≤ 1/√s. The variable of the program is s·T/m, T the largest
    ‖J‖_F², a number without a unit.

The first line is what a joint can contribute, the second is eq. (5). Alone they say little. The
third adds up the conditions of all failures (eq. 6): j_fᵀ(M − tI)⁻¹j_f ≤ 1 for each of n joints
gives tr (M/t − I)⁻¹ ≤ n − m. It holds for all rows B of J, and for the linear and the
rotational ones alone with the n_B joints that reach them. Where k joints lock the last
condition is, with α = (k − 1)/(n_B − 1),

    (1 − α)(m_B + tr Y_B)²/n_B + α(m_B + 2 tr Y_B + ‖Y_B‖²) ≤ m_B + tr Y_B,

the mean of tr K_F² ≤ tr K_F over the sets F, K = Jᵀ(M − tI)⁻¹J. Unequal failures have weights
w_F, and w is the least of them.

``isotropy`` adds M = (tr M/m) I and, as rank one is lost, ‖X_f‖ = tr X_f ≤ tr M/m − w_F².
``residual`` has s = 1 and minimises ½‖M − (tr M/m) I‖².

What convexity does not carry: which eigenvalues the *mean* over failures leaves (several locked
joints, `lockedjoint.formulations.bounds.closed_form`), angles between columns, and joints that
never fail, for which the third line says nothing.

The value of a solver is numerical. `lockedjoint.formulations.bounds.relaxation_proof` makes a
proof of its multipliers.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from math import nan, sqrt
from typing import Any, Literal, TypeAlias, get_args

import cvxpy as cp
import numpy as np

from lockedjoint.formulations.conic import SOLVER, check_solver, run
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.joint import GramCondition, Joint
from lockedjoint.formulations.measures.jacobian import check_locked
from lockedjoint.formulations.measures.unequal_failures import FailureModel
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError, of_kind, one_of

Statement: TypeAlias = Literal["max-min", "isotropy", "residual"]
_SPATIAL = 6  # rows (v; ω)
_STATUSES = ("optimal", "optimal_inaccurate")
_TIGHT = 1e-11
_OPTIONS: Mapping[str, Mapping[str, object]] = {
    SOLVER: {"tol_gap_abs": _TIGHT, "tol_gap_rel": _TIGHT, "tol_feas": _TIGHT}
}


@dataclass(frozen=True)
class Kind:
    """Joints that are alike: they share one X.

    Attributes
    ----------
    joint
        Their kind.
    odds
        The odds of their failure, 0 if they never fail.
    count
        How many there are.
    """

    joint: Joint
    odds: float
    count: int

    def reaches(self, rows: slice) -> bool:
        """Whether some of these rows of the column can be other than 0."""
        for condition in self.joint.gram_conditions:
            diagonal = np.diag(np.array(condition.matrix))
            plain = np.array_equal(np.diag(diagonal), condition.matrix)
            if plain and condition.equal and condition.limit == 0 and all(diagonal[rows] > 0):
                return False
        return True


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
    """

    task_dimension: int
    locked: int
    kinds: tuple[Kind, ...]
    failures: tuple[Failure, ...]
    blocks: tuple[Block, ...]

    def alike(self, number: int) -> tuple[int, ...]:
        """Return the numbers of all kinds with the same joint as one, with any odds."""
        joint = self.kinds[number].joint
        return tuple(k for k, kind in enumerate(self.kinds) if kind.joint == joint)

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


def parts_of(arm: Arm, failures: int | FailureModel = 1) -> Parts:
    """Return the parts of the relaxation of an arm.

    Parameters
    ----------
    arm
        The joints.
    failures
        How many joints lock at once, or how likely each fails.

    Raises
    ------
    InputError
        If so many joints cannot lock, or probabilities are not one for each joint.
    """
    of_kind("arm", arm, Arm, "an Arm, such as arm('unit-revolute', 7)")
    m, n = arm.shape
    if not isinstance(failures, FailureModel):
        check_locked(n - m, n, failures)
        failures = FailureModel.equally_likely(n, failures)
    elif failures.joints != n:
        raise InputError("failures", f"of {failures.joints} joints", f"of {n} joints")
    each = list(zip(arm.joints, failures.odds, strict=True))
    counted = Counter(each)
    kinds = tuple(Kind(joint, odds, count) for (joint, odds), count in counted.items())
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
    return Parts(m, failures.locked, kinds, sets, tuple(blocks))


def _named_rows(m: int) -> Mapping[str, slice]:
    named = {"all": slice(0, m)}
    if m == _SPATIAL:
        named |= {"linear": slice(0, 3), "rotational": slice(3, 6)}
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
        T/m, by which the value is divided to give 1/t; of the residual X = `scale`·Σ jjᵀ.
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
    arm: Arm, failures: int | FailureModel = 1, statement: Statement = "max-min"
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
    parts = parts_of(arm, failures)
    m, kinds = parts.task_dimension, parts.kinds
    scale = arm.largest_trace / m
    s = cp.Variable(nonneg=True, name="s") if statement != "residual" else cp.Constant(1.0)
    squares = tuple(cp.Variable((m, m), PSD=True, name=f"X {k}") for k in range(len(kinds)))
    gram = sum(kind.count * x for kind, x in zip(kinds, squares, strict=True))
    mean = cp.trace(gram) / m
    named: dict[str, Any] = {}
    for number, kind in enumerate(kinds):
        for condition in kind.joint.gram_conditions:
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
        square, unit = failure.weight**2, np.eye(m)
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


def _all_failures(parts: Parts, block: Block, gram: Any) -> Mapping[str, Any]:
    """Return the conditions of all failures of a block's joints, added up."""
    m, n, k, w = block.size, block.joints, parts.locked, parts.least_weight
    unit, y = np.eye(m), cp.Variable((m, m), symmetric=True, name=f"Y {block.name}")
    schur = cp.bmat([[y, w * unit], [w * unit, gram - w**2 * unit]]) >> 0
    spent = cp.trace(y) <= n - m
    if 1 < k < n:
        share = (k - 1) / (n - 1)
        first = (1 - share) / n * cp.square(m + cp.trace(y))
        second = share * (m + 2 * cp.trace(y) + cp.sum_squares(y))
        spent = first + second <= m + cp.trace(y)
    return {f"inverse, {block.name}": schur, f"all failures, {block.name}": spent}


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
            return self.problem.scale**2 * self.value
        return sqrt(self.problem.scale / self.value) if self.value > 0 else nan


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
        The solver's own options, by its own names; tolerances of 1e-11 for Clarabel if none
        are given, as a proof's loss is the square of the multipliers' error.

    Raises
    ------
    InputError
        If the solver is not installed.
    """
    of_kind("problem", problem, Relaxation, "a Relaxation, as `build` returns")
    solver = check_solver(solver)
    begun = time.perf_counter()
    status = run(problem, solver, _OPTIONS.get(solver, {}) if options is None else options)
    seconds = time.perf_counter() - begun
    duals = {name: one.dual_value for name, one in problem.named.items()}
    multipliers: dict[str, FloatArray] = {}
    if status in _STATUSES and all(value is not None for value in duals.values()):
        multipliers = {name: np.asarray(value, dtype=float) for name, value in duals.items()}
    value = float(problem.value) if multipliers else nan
    return RelaxationSolution(problem, solver, status, value, multipliers, seconds)
