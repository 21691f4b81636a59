"""The relaxation: how good any answer could be, as a semidefinite program in cvxpy.

J is a Jacobian, shape (m, n), with columns j_f, one per joint; σ is its worst case, the
smallest singular value that a failure leaves, and t = σ². X_f = s·j_f j_fᵀ with s = 1/t, shape
(m, m). The program drops that X_f has rank one. Joints that are alike share one X. A set F of k
joints locks at once; w_F says how likely F is, divided by the same of the likeliest set, and w
is the least w_F. M = Σ_f X_f::

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
locked joints, `lockedjoint.formulations.bounds.several_failures`), angles between columns, and
joints that never fail, for which the third line says nothing.

The value of a solver is numerical. `lockedjoint.formulations.bounds.relaxation_proof` makes a
proof of its multipliers.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from math import nan, sqrt
from typing import Any, get_args

import cvxpy as cp
import numpy as np

from lockedjoint.formulations.conic import SOLVER, check_solver, run
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.gram_conditions import row_traces
from lockedjoint.formulations.joints.parts import Block, JointKind, Parts, Statement, parts_of
from lockedjoint.formulations.measures.unequal_failures import FailureModel
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import of_kind, one_of

# The statuses of cvxpy with which there is an answer.
_STATUSES = ("optimal", "optimal_inaccurate")
#: Relative tolerance of the default solver. A larger one makes the bound, and what is proved of
#: its multipliers, less sharp.
TOLERANCE = 1e-11


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
        The X of each kind of joint, shape (m, m) each.
    scale
        By which the value is divided to give 1/t, about T/m. Of the residual `scale`·X is the
        mean of jjᵀ over the joints of a kind.
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
    for failure in parts.sets:
        lost = sum(count * x for count, x in zip(failure.counts, squares, strict=True))
        square = failure.weight**2
        named[f"failure {failure.counts}"] = gram - lost >> square * unit
        for number, count in enumerate(failure.counts if statement == "isotropy" else ()):
            if count:
                norm = cp.trace(squares[number])
                named[f"norm {number} of {failure.counts}"] = norm <= mean - square
    if statement == "isotropy":
        named["isotropic"] = gram == mean * np.eye(m)
    for block in parts.blocks:
        named |= _all_failures(parts, block, gram[block.rows, block.rows])
    return Relaxation(statement, parts, cp.Minimize(s), named, squares, scale)


def _square(kind: JointKind, name: str) -> Any:
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
    traces = row_traces([joint.gram_conditions for joint in arm.joints], m)
    if traces is None or statement == "residual":
        return arm.largest_trace / m
    if statement == "isotropy":
        return min(traces) / 3
    linear, rotational = parts.units[0], parts.units[-1]
    return (traces[0] / linear**2 + traces[1] / rotational**2) / m


def _all_failures(parts: Parts, block: Block, gram: Any) -> Mapping[str, Any]:
    """Return the conditions of all failures of a block's joints, added up: the third line.

    `gram` is M_B, an expression of shape (m_B, m_B).
    """
    m, n, k, w = block.size, block.joints, parts.failures, parts.least_weight
    root = np.diag(1 / np.array(parts.units[block.rows]))
    y = cp.Variable((m, m), symmetric=True, name=f"Y {block.name}")
    schur = cp.bmat([[y, w * root], [w * root, gram - w**2 * root**2]]) >> 0
    total = cp.trace(y) <= n - m
    if 1 < k < n:
        alpha = (k - 1) / (n - 1)
        first = (1 - alpha) / n * cp.square(m + cp.trace(y))
        second = alpha * (m + 2 * cp.trace(y) + cp.sum_squares(y))
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
