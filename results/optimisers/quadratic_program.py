"""The question of an entry of the atlas as a quadratic program.

What comes in: an `Entry` on the worst case. What goes out: a `QuadraticProgram`, with numbered
variables and all coefficients, for `formats` to write and `solvers` to solve.

::

    maximise   t        over J, a lower triangular L_F for every set F of k joints, and t
    subject to JJᵀ − J_F J_Fᵀ − t I = L_F L_Fᵀ,   diagonals of L_F and t not negative,
               the model's own conditions on the columns of J

Its optimum is the squared worst case. The start, a J that is drawn and t = 0, is feasible.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations import max_min
from lockedjoint.formulations.atlas.entry import Entry
from lockedjoint.formulations.atlas.local_optimality import Condition, model_conditions
from lockedjoint.formulations.measures import locked_sets
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError


@dataclass(frozen=True)
class QuadraticConstraint:
    """A constraint Σ products[i, j] x_i x_j + Σ linear[i] x_i = level; ≤ level if a limit."""

    products: Mapping[tuple[int, int], float]
    linear: Mapping[int, float]
    level: float = 0.0
    limit: bool = False


@dataclass(frozen=True, eq=False)
class QuadraticProgram:
    """A quadratic program in x, which maximises the last variable.

    Attributes
    ----------
    name
        The entry's name.
    constraints
        The constraints, those without products last.
    not_negative
        Which variables have the lower bound 0, shape (size,); the others have none.
    start
        A feasible x, shape (size,).
    """

    name: str
    constraints: Sequence[QuadraticConstraint]
    not_negative: npt.NDArray[np.bool_]
    start: FloatArray

    @property
    def size(self) -> int:
        """Number of variables."""
        return len(self.start)

    @cached_property
    def _terms(self) -> tuple[npt.NDArray[np.intp], ...]:
        """QuadraticConstraint, both variables and factor of each term, as four arrays.

        The second variable of a linear term is one more, number `size`, which is 1.
        """
        terms: list[tuple[int, int, int, float]] = []
        for number, one in enumerate(self.constraints):
            terms += [(number, i, j, factor) for (i, j), factor in one.products.items()]
            terms += [(number, i, self.size, factor) for i, factor in one.linear.items()]
        numbers, first, second, factors = zip(*terms, strict=True)
        return np.array(numbers), np.array(first), np.array(second), np.array(factors)

    def values(self, x: FloatArray) -> FloatArray:
        """Return the left sides of the constraints at x, shape (constraints,)."""
        numbers, first, second, factors = self._terms
        with_one = np.append(x, 1.0)
        terms = factors * with_one[first] * with_one[second]
        return np.bincount(numbers, terms, len(self.constraints)).astype(np.float64)

    def jax_values(self) -> Callable[[Any], Any]:
        """Return `values` as a JAX function, to be differentiated and compiled."""
        import jax

        numbers, first, second, factors = self._terms

        def values(x: Any) -> Any:
            extended = jax.numpy.append(x, 1.0)
            terms = factors * extended[first] * extended[second]
            return jax.ops.segment_sum(terms, numbers, len(self.constraints))

        return values


def quadratic_program(entry: Entry, seed: int = 0) -> QuadraticProgram:
    """State an entry on the worst case, with J of the start drawn; InputError for others.

    The variables are J row after row, the entries of L_F on and below the diagonal, row after
    row, for one F after the other, and t.
    """
    if entry.formulation != max_min.NAME:
        raise InputError("entry", entry.name, f"one of {max_min.NAME}: without a further word")
    m, n = entry.task_dimension, entry.joints
    jacobian = entry.arm.jacobian(entry.arm.sample(np.random.default_rng(seed)))
    locked_together = locked_sets(jacobian, entry.failures)
    # Places on and below the diagonal of L_F.
    lower = [(a, b) for a in range(m) for b in range(a + 1)]
    # The number of the variable t, the last one.
    t = m * n + len(locked_together) * len(lower)
    constraints: list[QuadraticConstraint] = []
    start: list[FloatArray] = [jacobian.ravel()]
    for number, locked in enumerate(locked_together):
        kept = [joint for joint in range(n) if joint not in locked]
        first = m * n + number * len(lower)
        variable_of = {place: first + k for k, place in enumerate(lower)}
        for a, b in lower:
            products = {(b * n + joint, a * n + joint): 1.0 for joint in kept}
            products |= {(variable_of[b, c], variable_of[a, c]): -1.0 for c in range(b + 1)}
            constraints.append(QuadraticConstraint(products, {t: -1.0} if a == b else {}))
        root = np.linalg.cholesky(jacobian[:, kept] @ jacobian[:, kept].T)
        start.append(np.asarray(root[np.tril_indices(m)], dtype=np.float64))
    constraints += map(_model_constraint, model_conditions(entry))
    on_diagonal = np.tile([a == b for a, b in lower], len(locked_together))
    return QuadraticProgram(
        name=entry.name,
        constraints=sorted(constraints, key=lambda constraint: not constraint.products),
        not_negative=np.concatenate([np.zeros(m * n, dtype=bool), on_diagonal, [True]]),
        start=np.concatenate([*start, [0.0]]),
    )


def _model_constraint(condition: Condition) -> QuadraticConstraint:
    """Return a condition ½ jᵀHj + ℓ·j = c of the model as a constraint."""
    products = {
        (i, j): float(condition.form[i, j]) * (0.5 if i == j else 1.0)
        for i, j in np.argwhere(np.triu(condition.form)).tolist()
    }
    linear = {int(i): float(condition.linear[i]) for i in np.flatnonzero(condition.linear)}
    return QuadraticConstraint(products, linear, float(condition.level), condition.limit)
