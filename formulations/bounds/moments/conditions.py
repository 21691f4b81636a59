"""What a worst case σ² ≥ t of unit revolute joints implies: matrices H that are then ⪰ 0.

Nothing here has a unit.

- J: the Jacobian of n unit revolute joints, shape (6, n), columns j_f; σ: its worst case after
  one locked joint f; t: a value that σ² is assumed to reach;
- M = JJᵀ; E = M − (n/3)I, of trace 0; ρ = ½‖E‖_F², the residual;
- s = Σ j_f, the sum of all columns, shape (6, 1);
- w_a: the vectors on which a condition acts, numbered by a. They are the columns of a matrix W.
  A condition A ⪰ 0 on them is the matrix H = WᵀAW, shape (vectors, vectors);
- r_a: polynomials in the entries of J that multiply the w_a in the sums of squares.

docs/bounds.md, section 4, derives

- ρ ≤ ρ_max(t) and ρ ≤ α + β tr E³, for a number β and an α that depends on t;
- J_f J_fᵀ ⪰ tI and J_fᵀJ_f ⪰ tI, where J_f is J without column j_f. The vectors j_f, M j_f and
  M² j_f test it, because the eigenvector of a worst case is (M − tI)⁻¹j_f;
- δ₀M ⪰ ssᵀ with s = Σ j_f, a small vector, where the signs of the columns are those for which
  the null vector of J is not negative. It follows that |s|² ≤ δ is small.

Conditions and vectors are divided by numbers, so that H has entries of ordinary sizes: j_f by
√2, (1, …, 1) by √6, s by `_LENGTH_OF_S`, and M by n/3. Any numbers are correct; certificates on
record hold for these. The second inequality for
J_f is one for 7 joints, where J_f is square.

Search and verifier both evaluate the conditions here, with bounds on the error.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import sqrt
from typing import TypeAlias

import numpy as np

from lockedjoint.formulations.bounds.moments.enclosed_matrix import EnclosedMatrix
from lockedjoint.formulations.bounds.revolute_exclusions import largest_residual, mean_residual
from lockedjoint.formulations.bounds.spectral_limit import CUBIC, Spectrum, spectral_limit

# Length of a column (v; ω) of a unit revolute joint.
_ROOT_2 = np.sqrt(np.longdouble(2))
# Length of the vector (1, …, 1) of the 6 joints that are left.
_ROOT_6 = np.sqrt(np.longdouble(6))
# Length of s that counts as 1: between its length at a random configuration, √14, and √δ₀.
_LENGTH_OF_S = 0.6
# What δ₀ and δ are raised by: more than rounding loses in their few operations.
_ROUNDING = 1e-12
#: Names of the conditions whose rows change with the signs of the columns.
WITH_SIGNS = ("unsigned", "near", "unsigned_scaled", "gram", "deviation")


@dataclass(frozen=True)
class WorstCaseCondition:
    """A matrix H on vectors w_a: Σ ⟨H, r rᵀ⟩ ≥ 0 for all polynomials r_a where σ² ≥ t.

    Attributes
    ----------
    name
        Its name in certificates.
    values
        A function of Jacobians J, shape (…, 6, n), and of the number of the locked joint f, or
        None where there is none. It returns H, shape (…, vectors, vectors), with bounds on the
        error.
    lowered
        Degree of each w_a in the entries of J, less that of the first, shape (vectors,). The
        r_a may have a degree that is so much lower.
    """

    name: str
    values: Callable[[EnclosedMatrix, int | None], EnclosedMatrix]
    lowered: tuple[int, ...] = (0,)


Conditions: TypeAlias = Mapping[str, WorstCaseCondition]


def worst_case_conditions(
    joints: int, t: float, spectrum: Spectrum
) -> dict[str, WorstCaseCondition]:
    """Return all conditions by their names.

    Parameters
    ----------
    joints
        n. Conditions with the signs of the columns hold for 7 joints.
    t
        The value that σ² reaches.
    spectrum
        A, B and C of `spectral_limit`, which prove α.

    Raises
    ------
    InputError
        If the spectrum is not proved for this t.
    """
    residual_limit, unit = largest_residual(joints, t), mean_residual(joints)
    deviation = null_vector_deviation(t)
    # One eigenvalue of M that is d above the mean n/3 costs ρ ≥ (3/5)d².
    largest_eigenvalue = joints / 3 + sqrt(5 * residual_limit / 3)
    conditions = [
        residual_distance("scaled", residual_limit, unit),
        krylov_form(t),
        spectral_distance(spectral_limit(t, spectrum)),
        nearness(deviation * largest_eigenvalue + _ROUNDING),
        residual_distance("unsigned_scaled", residual_limit, unit),
        gram_form(t),
        deviation_form(deviation),
    ]
    return {condition.name: condition for condition in conditions}


def residual(jacobian: EnclosedMatrix) -> EnclosedMatrix:
    """Return ρ = ½‖JJᵀ − (n/3)I‖_F², shape (…, 1, 1), of J, shape (…, 6, n)."""
    defect = _defect(jacobian)
    return defect.inner(defect).times(0.5)


def _defect(jacobian: EnclosedMatrix) -> EnclosedMatrix:
    """Return E = JJᵀ − (n/3)I, shape (…, 6, 6)."""
    third = np.longdouble(jacobian.values.shape[-1]) / 3
    identity = EnclosedMatrix.exact(np.eye(6), jacobian)
    return jacobian @ jacobian.transposed - identity.times(third)


def residual_distance(name: str, limit: float, unit: float) -> WorstCaseCondition:
    """Return the condition (limit − ρ)/unit ≥ 0, a number: limit = ρ_max(t) bounds ρ."""

    def values(jacobian: EnclosedMatrix, _: int | None) -> EnclosedMatrix:
        return _limit_minus(limit, residual(jacobian)).times(1 / np.longdouble(unit))

    return WorstCaseCondition(name, values)


def spectral_distance(limit: float) -> WorstCaseCondition:
    """Return the condition α + β tr E³ − ρ ≥ 0, α being the limit."""

    def values(jacobian: EnclosedMatrix, _: int | None) -> EnclosedMatrix:
        defect = _defect(jacobian)
        square = defect @ defect
        cubic = square.inner(defect).times(CUBIC)
        return _limit_minus(limit, defect.inner(defect).times(0.5) - cubic)

    return WorstCaseCondition("spectral", values)


def nearness(limit: float) -> WorstCaseCondition:
    """Return the condition (limit − |s|²)/2 ≥ 0, a number: limit = δ bounds |s|²."""

    def values(jacobian: EnclosedMatrix, _: int | None) -> EnclosedMatrix:
        s = _sum_of_columns(jacobian)
        return _limit_minus(limit, s.inner(s)).times(0.5)

    return WorstCaseCondition("near", values)


def _limit_minus(limit: float, number: EnclosedMatrix) -> EnclosedMatrix:
    """Return limit − number, matrices with one entry, shape (…, 1, 1)."""
    return EnclosedMatrix.exact([[limit]], number) - number


def _sum_of_columns(jacobian: EnclosedMatrix) -> EnclosedMatrix:
    """Return s = J(1, …, 1), shape (…, 6, 1)."""
    return jacobian @ EnclosedMatrix.exact(np.ones((jacobian.values.shape[-1], 1)), jacobian)


def krylov_form(t: float) -> WorstCaseCondition:
    """Return the condition J_f J_fᵀ − tI ⪰ 0 on j_f, M j_f and M² j_f: H = |J_fᵀW|² − t|W|².

    |A|² stands for AᵀA. The degrees of the vectors in J are 1, 3 and 5.
    """
    lowered = (0, 2, 4)

    def values(jacobian: EnclosedMatrix, locked: int | None) -> EnclosedMatrix:
        remaining, column = _without_column(jacobian, locked)
        vectors = [column]
        for _ in lowered[1:]:
            vectors.append(_image(jacobian, vectors[-1]))
        w = EnclosedMatrix.beside(vectors)
        return _square(remaining.transposed @ w) - _square(w).times(t)

    return WorstCaseCondition("krylov", values, lowered)


def gram_form(t: float) -> WorstCaseCondition:
    """Return the condition J_fᵀJ_f − tI ⪰ 0 on (1, …, 1), J_fᵀj_f and J_fᵀs.

    The degrees of the vectors in J are 0, 2 and 2.
    """

    def values(jacobian: EnclosedMatrix, locked: int | None) -> EnclosedMatrix:
        remaining, column = _without_column(jacobian, locked)
        count = remaining.values.shape[-1]
        ones = EnclosedMatrix.exact(np.ones((count, 1)), jacobian).times(1 / _ROOT_6)
        s = _sum_of_columns(jacobian).times(1 / np.longdouble(_LENGTH_OF_S))
        images = [remaining.transposed @ column, remaining.transposed @ s]
        w = EnclosedMatrix.beside([ones, *images])
        return _square(remaining @ w) - _square(w).times(t)

    return WorstCaseCondition("gram", values, (0, 2, 2))


def deviation_form(deviation: float) -> WorstCaseCondition:
    """Return the condition δ₀M − ssᵀ ⪰ 0 on j_f, s, M j_f and M s; δ₀ is the `deviation`.

    Vectors and s are divided by their lengths as the header says, so that δ₀ is divided by the
    square of the length of s. The degrees of the vectors in J are 1, 1, 3 and 3.
    """

    def values(jacobian: EnclosedMatrix, locked: int | None) -> EnclosedMatrix:
        _, column = _without_column(jacobian, locked)
        s = _sum_of_columns(jacobian).times(1 / np.longdouble(_LENGTH_OF_S))
        images = [_image(jacobian, column), _image(jacobian, s)]
        w = EnclosedMatrix.beside([column, s, *images])
        scaled_deviation = np.longdouble(deviation) / np.longdouble(_LENGTH_OF_S) ** 2
        along_s = _square(s.transposed @ w)
        return _square(jacobian.transposed @ w).times(scaled_deviation) - along_s

    return WorstCaseCondition("deviation", values, (0, 0, 2, 2))


def _without_column(
    jacobian: EnclosedMatrix, locked: int | None
) -> tuple[EnclosedMatrix, EnclosedMatrix]:
    """Return J_f, shape (…, 6, n − 1), and j_f/√2, (…, 6, 1).

    f = `locked` counts from 0; it is the first joint if none is locked.
    """
    place = locked or 0
    return jacobian.without(place), jacobian.column(place).times(1 / _ROOT_2)


def _image(jacobian: EnclosedMatrix, vector: EnclosedMatrix) -> EnclosedMatrix:
    """Return M v/(n/3), shape (…, 6, 1), of v = `vector`."""
    third = np.longdouble(jacobian.values.shape[-1]) / 3
    return (jacobian @ (jacobian.transposed @ vector)).times(1 / third)


def _square(matrix: EnclosedMatrix) -> EnclosedMatrix:
    """Return AᵀA."""
    return matrix.transposed @ matrix


def null_vector_deviation(t: float) -> float:
    """Return δ₀, at least sᵀM⁻¹s wherever the squared worst case of 7 joints is t or more.

    With the unit null vector n of J, sᵀM⁻¹s = 7 − (Σ n_f)². All n_f² are at least t/(2 + t), so
    that Σ n_f is least where six of them are equal to that.
    """
    least_square = t / (2 + t)
    least_sum = 6 * sqrt(least_square) + sqrt(1 - 6 * least_square)
    return 7 - least_sum**2 + _ROUNDING
