"""What a worst case σ² ≥ t of unit revolute joints implies: matrices H that are then ⪰ 0.

With M = JJᵀ, E = M − (n/3)I and ρ = ½‖E‖_F², docs/bounds.md, section 4, derives

- ρ ≤ ρ_max(t) and ρ ≤ α + β tr E³, for a number β and an α that depends on t;
- J_f J_fᵀ ⪰ tI, where J_f is J without column j_f. The vectors j_f, M j_f and M² j_f test it,
  because the eigenvector of a worst case is (M − tI)⁻¹j_f;
- δ₀M ⪰ ssᵀ with s = Σ j_f, a small vector, where the signs of the columns are those for which
  the null vector of J is not negative. It follows that |s|² is small.

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

_ROOT_2 = np.sqrt(np.longdouble(2))
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
        H at Jacobians (…, 6, n), and for the locked joint; None if the condition has none.
    lowered
        Degree of each w_a in the entries of J, less that of the first.
    """

    name: str
    values: Callable[[EnclosedMatrix, int | None], EnclosedMatrix]
    lowered: tuple[int, ...] = (0,)


Conditions: TypeAlias = Mapping[str, WorstCaseCondition]


def worst_case_conditions(
    joints: int, t: float, spectrum: Spectrum
) -> dict[str, WorstCaseCondition]:
    """Return all conditions by their names; InputError if the spectrum is not proved."""
    residual_limit, unit = largest_residual(joints, t), mean_residual(joints)
    deviation = null_vector_deviation(t)
    largest_eigenvalue = joints / 3 + sqrt(5 * residual_limit / 3)  # of M
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
    """Return ρ = ½‖JJᵀ − (n/3)I‖_F²."""
    defect = _defect(jacobian)
    return defect.inner(defect).times(0.5)


def _defect(jacobian: EnclosedMatrix) -> EnclosedMatrix:
    """Return E = JJᵀ − (n/3)I."""
    third = np.longdouble(jacobian.values.shape[-1]) / 3
    identity = EnclosedMatrix.exact(np.eye(6), jacobian)
    return jacobian @ jacobian.transposed - identity.times(third)


def residual_distance(name: str, limit: float, unit: float) -> WorstCaseCondition:
    """Return the condition (limit − ρ)/unit ≥ 0."""

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
    """Return the condition (limit − |s|²)/2 ≥ 0."""

    def values(jacobian: EnclosedMatrix, _: int | None) -> EnclosedMatrix:
        s = _sum_of_columns(jacobian)
        return _limit_minus(limit, s.inner(s)).times(0.5)

    return WorstCaseCondition("near", values)


def _limit_minus(limit: float, number: EnclosedMatrix) -> EnclosedMatrix:
    return EnclosedMatrix.exact([[limit]], number) - number


def _sum_of_columns(jacobian: EnclosedMatrix) -> EnclosedMatrix:
    """Return s, (…, 6, 1)."""
    return jacobian @ EnclosedMatrix.exact(np.ones((jacobian.values.shape[-1], 1)), jacobian)


def krylov_form(t: float) -> WorstCaseCondition:
    """Return the condition J_f J_fᵀ − tI ⪰ 0 on j_f, M j_f and M² j_f.

    The vectors are in units of √2, the length of a column, and M is in units of n/3.
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
    """Return the condition J_fᵀJ_f − tI ⪰ 0 on (1, …, 1), J_fᵀj_f and J_fᵀs."""

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
    """Return the condition δ₀M − ssᵀ ⪰ 0 on j_f, s, M j_f and M s; δ₀ is the `deviation`."""

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
    """Return J_f and j_f/√2; f is the first joint if none is locked."""
    place = locked or 0
    return jacobian.without(place), jacobian.column(place).times(1 / _ROOT_2)


def _image(jacobian: EnclosedMatrix, vector: EnclosedMatrix) -> EnclosedMatrix:
    """Return M v/(n/3)."""
    third = np.longdouble(jacobian.values.shape[-1]) / 3
    return (jacobian @ (jacobian.transposed @ vector)).times(1 / third)


def _square(matrix: EnclosedMatrix) -> EnclosedMatrix:
    """Return AᵀA."""
    return matrix.transposed @ matrix


def null_vector_deviation(t: float) -> float:
    """Return δ₀, at least sᵀM⁻¹s wherever the squared worst case of 7 joints is t or more."""
    least_square = t / (2 + t)  # of an entry of the null vector
    least_sum = 6 * sqrt(least_square) + sqrt(1 - 6 * least_square)
    return 7 - least_sum**2 + _ROUNDING
