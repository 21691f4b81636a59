"""An optimum of free columns in numbers of many digits.

What comes in: a Jacobian J to many digits, shape (m, n), and its squared worst case t. What
goes out: a `DigitOptimum`, frame, columns, worst sets and multipliers, which `exact_search` has
to recognise. Arrays have the dtype object and hold `mpmath.mpf`.

f is a joint, and F a set of locked joints after whose loss the worst case is least:

- the columns of J are j_f = ±√w_f B x_f, with a frame B of the task space, shape (m, m);
- S = BᵀB, shape (m, m); x_f: the coordinates of column f, shape (m,); w_f: the square of its
  scale;
- v_F: null vector of Σ_{f∉F} w_f x_f x_fᵀ − tS⁻¹, shape (m,); u_F = B⁻ᵀv_F is the eigenvector
  at t of JJᵀ without the columns F;
- c_F: the multiplier of F for the vector u_F as it is, not of length 1.
"""

from dataclasses import dataclass
from typing import Any

import mpmath as mp
import numpy as np

from lockedjoint.formulations.atlas.entry import EntryPage
from lockedjoint.formulations.atlas.local_maximum import LocalMaximum
from lockedjoint.formulations.atlas.local_optimality import worst_failures
from lockedjoint.nlp.arrays import FloatArray
from results.atlas.frame_invariants import DigitArray, DigitNumber, invariants, inverted
from results.atlas.many_digits import NumberTable, nearest_solution, numbers, small

# A product of a matrix and its null vector counts as zero below 10 to minus (number of digits
# over this).
_ZERO_PART = 2


@dataclass(frozen=True, eq=False)
class DigitOptimum:
    """An optimum of free columns in numbers of many digits."""

    t: DigitNumber
    #: S, shape (m, m).
    gram: DigitArray
    #: S⁻¹, shape (m, m).
    gram_inverse: DigitArray
    #: The x_f as columns, shape (m, n).
    coordinates: DigitArray
    #: The w_f, shape (n,).
    squared_scales: DigitArray
    #: The sets F as doubles, shape (sets, n): 0 for a joint that locks, 1 for one that is left.
    remaining: FloatArray
    #: The v_F as rows, shape (sets, m).
    eigenvectors: DigitArray
    #: The c_F, shape (sets,).
    multipliers: DigitArray

    @property
    def scalars(self) -> list[DigitNumber]:
        """Numbers of which one may generate the field, or its sum with t."""
        return [self.t, *self.gram.ravel(), *self.coordinates.ravel(), *self.squared_scales]

    def recorded(self, table: NumberTable) -> dict[str, Any]:
        """Return its record: places of numbers in a table, where new ones are added.

        ArithmeticError if one is not of the field.
        """
        # The record says that t is the first number.
        table.place(self.t)
        return {
            "gram": table.places(self.gram),
            "gram_inverse": table.places(self.gram_inverse),
            "coordinates": table.places(self.coordinates),
            "squared_scales": table.places(self.squared_scales),
            "worst_sets": [np.flatnonzero(row == 0).tolist() for row in self.remaining],
            "eigenvectors": table.places(self.eigenvectors),
            "multipliers": table.places(self.multipliers),
        }


def digit_optimum(
    page: EntryPage, jacobian: DigitArray, t: DigitNumber, maximum: LocalMaximum | None
) -> DigitOptimum:
    """Return the optimum whose exact form `exact_optimum` states, to many digits.

    `jacobian` has the shape (m, n), and `t` has to be an eigenvalue for each worst set to
    working precision: ArithmeticError if not. If `maximum`, a proof of a local maximum, is
    given, only the worst sets with a multiplier in it get one here.
    """
    gram, coordinates, squared_scales = invariants(jacobian)
    gram_inverse = inverted(gram)
    failures = worst_failures(page.jacobian, page.entry.failures)
    remaining = np.array([one.kept for one in failures])
    # w_f x_f x_fᵀ along the last axis, shape (m, m, n): its product with 0 or 1 for each joint
    # sums those that are left.
    products = squared_scales * coordinates[:, None] * coordinates
    eigenvectors = np.array(
        [_null_vector(products @ left - t * gram_inverse) for left in numbers(remaining)]
    )
    # Sets with a multiplier: those of the proof, if there is one.
    active = np.ones(len(remaining), dtype=bool)
    if maximum is not None:
        active = (remaining[:, None] == maximum.kept).all(axis=2).any(axis=1)
    # |u_F|² = v_FᵀS⁻¹v_F, shape (sets,). Multipliers of unit vectors are divided by it.
    squared_lengths = np.sum(eigenvectors @ gram_inverse * eigenvectors, axis=1)
    # v_F·x_f of the joints that are left, 0 of those that lock, shape (sets, n).
    pairings = eigenvectors @ coordinates * remaining
    # v_F (v_F·x_f)/|u_F|², shape (sets, m, n).
    gradients = eigenvectors[:, :, None] * pairings[:, None] / squared_lengths[:, None, None]
    shared = page.entry.model != "free"
    of_unit_vectors = _multipliers(gradients[active], gram @ coordinates, shared)
    multipliers = numbers(np.zeros(len(remaining)))
    multipliers[active] = of_unit_vectors / squared_lengths[active]
    return DigitOptimum(
        t=t,
        gram=gram,
        gram_inverse=gram_inverse,
        coordinates=coordinates,
        squared_scales=squared_scales,
        remaining=remaining,
        eigenvectors=eigenvectors,
        multipliers=multipliers,
    )


def _null_vector(matrix: DigitArray) -> DigitArray:
    """Return the vector, shape (m,), that a symmetric matrix maps to zero, with an entry 1.

    With e, the unit vector of this entry, it is (matrix + e eᵀ)⁻¹e.
    """
    # The entry is the largest of the vector in double precision.
    place = int(np.abs(np.linalg.svd(matrix.astype(float))[2][-1]).argmax())
    unit = numbers(np.eye(len(matrix))[place])
    vector = inverted(matrix + np.outer(unit, unit)) @ unit
    if max(abs(v) for v in matrix @ vector) > small(_ZERO_PART):
        raise ArithmeticError("t is no eigenvalue")
    return vector


def _multipliers(
    gradients: DigitArray, dual_coordinates: DigitArray, shared: bool
) -> DigitArray:
    """Return the multipliers: of sum 1, and of all solutions the nearest to equal ones.

    They solve Σ c_F gradient_F = λ_f S x_f for every f, with one λ if it is `shared`: the
    optimum of max-min is stationary under the limit on the norms of columns. The solution need
    not be unique, so the nearest to equal multipliers is taken.

    Parameters
    ----------
    gradients
        Shape (sets, m, n).
    dual_coordinates
        The S x_f as columns, shape (m, n).
    shared
        Whether the model limits the mean norm of the columns, not each norm.
    """
    size, n = len(gradients), dual_coordinates.shape[1]
    # Each λ is multiplied with these, shape (m, n): all columns, or column f alone.
    normals = [dual_coordinates]
    if not shared:
        normals = [np.where(np.arange(n) == f, dual_coordinates, 0) for f in range(n)]
    # The unknowns are the c_F, then the λ. Equations: one for each entry, then Σ c_F = 1.
    columns = [one.ravel() for one in [*gradients, *(-normal for normal in normals)]]
    sums = [1] * size + [0] * len(normals)
    matrix = numbers(np.vstack([np.array(columns).T, sums]))
    right = numbers(np.eye(len(matrix))[-1])
    equal = np.array([mp.mpf(1) / size] * size + [mp.mpf(0)] * len(normals))
    return nearest_solution(matrix, right, equal)[:size]
