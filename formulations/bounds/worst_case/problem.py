"""What a bound on the worst case uses of a robot: n, m, tr JJᵀ and linear facts about JJᵀ.

A fact about M = JJᵀ is ⟨A, M⟩ = b or ⟨A, M⟩ ≤ b for every Jacobian of a column model.
"""

import math
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from formulations import measures
from formulations.bounds.closed_form import block_trace_bound, positive
from nlp.arrays import FloatArray, whole_number
from nlp.errors import InputError

# Squares of lengths beyond these are too near the largest and least floating-point numbers.
SMALLEST, LARGEST = 1e-100, 1e100
# The semidefinite program of more takes over a minute.
MOST_DIMENSIONS = 40
Relation: TypeAlias = Literal["equal", "at most"]


@dataclass(frozen=True, eq=False)
class LinearFact:
    """A linear equation or inequality that M = JJᵀ obeys: ⟨A, M⟩ = b or ⟨A, M⟩ ≤ b.

    Parameters
    ----------
    name
        Its meaning, for tables.
    matrix
        A, symmetric, m×m.
    value
        b, in the squared units of J.
    relation
        ``"equal"`` or ``"at most"``.
    """

    name: str
    matrix: FloatArray
    value: float
    relation: Relation

    def __post_init__(self) -> None:
        matrix = np.array(self.matrix, dtype=float)
        if not (np.isfinite(matrix).all() and np.array_equal(matrix, matrix.T)):
            raise InputError("matrix", self.name, "a finite symmetric matrix")
        if not math.isfinite(self.value):
            raise InputError("value", self.value, "a finite number")
        if self.relation not in ("equal", "at most"):
            raise InputError("relation", self.relation, "equal, at most")
        matrix.flags.writeable = False
        object.__setattr__(self, "matrix", matrix)


@dataclass(frozen=True, eq=False)
class WorstCase:
    """A class of Jacobians whose worst case after one locked joint is to be bounded.

    Parameters
    ----------
    joints
        Number n of columns of J.
    task_dimension
        Number m of rows of J, less than n.
    trace
        Upper limit of tr JJᵀ, in the squared units of J.
    facts
        Other facts about JJᵀ, each with an m×m matrix.
    closed_form
        The bound on t in closed form, where there is one.

    Raises
    ------
    InputError
        Unless 1 ≤ m < n, m is at most `MOST_DIMENSIONS`, the trace is in the range that it
        has with columns of norms from `SMALLEST` to `LARGEST`, and the facts are m×m.
    """

    joints: int
    task_dimension: int
    trace: float
    facts: tuple[LinearFact, ...] = ()
    closed_form: float | None = None

    def __post_init__(self) -> None:
        m = whole_number("task dimension", self.task_dimension, 1)
        whole_number("joints", self.joints, m + 1)
        if m > MOST_DIMENSIONS:
            raise InputError("task dimension", m, f"at most {MOST_DIMENSIONS}")
        if not SMALLEST**2 <= positive("trace", self.trace) / self.joints <= 2 * LARGEST**2:
            allowed = f"from {SMALLEST**2:g} to {LARGEST**2:g} for each joint"
            raise InputError("trace", self.trace, allowed)
        for fact in self.facts:
            if fact.matrix.shape != (m, m):
                raise InputError("facts", fact.matrix.shape, f"matrices with {m} rows")

    @property
    def unit(self) -> float:
        """The scale of eigenvalues: trace/m, the largest possible mean eigenvalue of JJᵀ."""
        return self.trace / self.task_dimension

    def scaled_facts(self) -> tuple[LinearFact, ...]:
        """Return the trace limit and the facts, scaled so that the limit is m."""
        m = self.task_dimension
        limit = LinearFact("trace", np.eye(m), float(m), "at most")
        return limit, *(replace(fact, value=fact.value / self.unit) for fact in self.facts)


def free_columns(joints: int, task_dimension: int, *, trace: float | None = None) -> WorstCase:
    """Return the class of all m×n Jacobians with tr JJᵀ at most `trace`: eq. (6).

    Parameters
    ----------
    joints
        Number n of columns.
    task_dimension
        Number m of rows.
    trace
        Upper limit of tr JJᵀ; by default m, which is σ = 1 in eq. (6).

    Raises
    ------
    InputError
        Unless 1 ≤ m < n and the trace is positive and finite.
    """
    total = float(task_dimension if trace is None else trace)
    closed_form = measures.eigenvalue_bound(task_dimension, joints, total)
    return WorstCase(joints, task_dimension, total, closed_form=closed_form)


def revolute_arm(joints: int, *, lever_arm: float = 1.0) -> WorstCase:
    """Return the class of arms of revolute joints, rows v above rows ω.

    Each column has |ω_i| = 1 and v_i · ω_i = 0, as in eq. (21), but a lever arm |v_i| that is
    free up to `lever_arm`, for each joint or in root mean square. A `lever_arm` of 1 includes
    the unit revolute joints of eq. (21). Hence the trace of the ω block of JJᵀ is n, that of
    the v block at most nℓ², and that of the cross block 0.

    Parameters
    ----------
    joints
        Number n of revolute joints, above 6.
    lever_arm
        Largest lever arm ℓ, in the length that makes v and ω comparable.

    Raises
    ------
    InputError
        Unless n > 6 and ℓ is between `SMALLEST` and `LARGEST`.
    """
    joints = whole_number("joints", joints, 7)
    if not SMALLEST <= positive("lever_arm", lever_arm) <= LARGEST:
        raise InputError("lever_arm", lever_arm, f"{SMALLEST:g} to {LARGEST:g}")
    linear = joints * lever_arm**2
    closed_form = block_trace_bound(joints, (3, 3), (linear, joints))
    cross = np.kron(np.array([[0.0, 0.5], [0.5, 0.0]]), np.eye(3))
    facts = (
        LinearFact("angular block", np.diag([0.0] * 3 + [1.0] * 3), joints, "equal"),
        LinearFact("linear block", np.diag([1.0] * 3 + [0.0] * 3), linear, "at most"),
        LinearFact("cross block", cross, 0.0, "equal"),
    )
    return WorstCase(joints, 6, joints + linear, facts, closed_form)
