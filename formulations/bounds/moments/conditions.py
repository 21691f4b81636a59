"""What a worst case σ² ≥ t of unit revolute joints implies, as matrices that are then ⪰ 0.

Without the signs of the columns: ρ ≤ ρ_max(t), and J_f J_fᵀ ⪰ tI on Krylov vectors, because the
eigenvector of a worst case is (M − tI)⁻¹j_f, M = JJᵀ. With the signs such that the null vector
of J is not negative, s = Σ j_f is small: δ₀M ⪰ ssᵀ. And ρ ≤ α + β tr E³, E = M − (n/3)I, for a
number β. docs/bounds.md, section 4, derives all conditions. Search and verification both
evaluate them here, with bounds on the error.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import sqrt
from typing import TypeAlias

import numpy as np

from lockedjoint.formulations.bounds.closed_form import largest_residual, mean_residual
from lockedjoint.formulations.bounds.moments.enclosed_matrix import EnclosedMatrix
from lockedjoint.formulations.bounds.spectral_limit import CUBIC, Spectrum, spectral_limit

_ROOT_2, _ROOT_6 = np.sqrt(np.longdouble(2)), np.sqrt(np.longdouble(6))
# Units of s: between its size at a random configuration, √14, and √δ₀.
_UNIT = 0.6
#: Conditions whose rows change with the signs of the columns.
WITH_SIGNS = ("unsigned", "near", "unsigned_scaled", "gram", "deviation")


@dataclass(frozen=True)
class WorstCaseCondition:
    """A matrix H on vectors w_a: Σ ⟨H, r rᵀ⟩ ≥ 0 for all polynomials r_a where σ² ≥ t."""

    name: str
    #: H at Jacobians (…, 6, n); of a localiser with a joint locked, else with None.
    values: Callable[[EnclosedMatrix, int | None], EnclosedMatrix]
    #: Degree of each w_a in the entries of J, less that of the first.
    lowered: tuple[int, ...] = (0,)


Conditions: TypeAlias = Mapping[str, WorstCaseCondition]


def worst_case_conditions(
    joints: int, t: float, spectrum: Spectrum
) -> dict[str, WorstCaseCondition]:
    """Return all conditions by their names; InputError if the spectrum is not proved."""
    limit, unit = largest_residual(joints, t), mean_residual(joints)
    deviation = null_vector_deviation(t)
    found = [
        residual_distance("scaled", limit, unit),
        krylov_form(t),
        spectral_distance(spectral_limit(t, spectrum)),
        nearness(deviation * (joints / 3 + sqrt(5 * limit / 3)) + 1e-12),
        residual_distance("unsigned_scaled", limit, unit),
        gram_form(t),
        deviation_form(deviation),
    ]
    return {condition.name: condition for condition in found}


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
    """Return (limit − ρ)/unit."""

    def values(jacobian: EnclosedMatrix, _: int | None) -> EnclosedMatrix:
        return _less(limit, residual(jacobian)).times(1 / np.longdouble(unit))

    return WorstCaseCondition(name, values)


def spectral_distance(limit: float) -> WorstCaseCondition:
    """Return α + β tr E³ − ρ, α being the limit."""

    def values(jacobian: EnclosedMatrix, _: int | None) -> EnclosedMatrix:
        defect = _defect(jacobian)
        square = defect @ defect
        cubic = square.inner(defect).times(CUBIC)
        return _less(limit, defect.inner(defect).times(0.5) - cubic)

    return WorstCaseCondition("spectral", values)


def nearness(limit: float) -> WorstCaseCondition:
    """Return (limit − |s|²)/2."""

    def values(jacobian: EnclosedMatrix, _: int | None) -> EnclosedMatrix:
        total = _total(jacobian)
        return _less(limit, total.inner(total)).times(0.5)

    return WorstCaseCondition("near", values)


def _less(limit: float, number: EnclosedMatrix) -> EnclosedMatrix:
    return EnclosedMatrix.exact([[limit]], number) - number


def _total(jacobian: EnclosedMatrix) -> EnclosedMatrix:
    """Return s, (…, 6, 1)."""
    return jacobian @ EnclosedMatrix.exact(np.ones((jacobian.values.shape[-1], 1)), jacobian)


def krylov_form(t: float) -> WorstCaseCondition:
    """Return J_f J_fᵀ − tI on j_f, M j_f and M² j_f, in units of √2 and n/3."""
    lowered = (0, 2, 4)

    def values(jacobian: EnclosedMatrix, locked: int | None) -> EnclosedMatrix:
        kept, own = _parts(jacobian, locked)
        vectors = [own]
        for _ in lowered[1:]:
            vectors.append(_image(jacobian, vectors[-1]))
        whole = EnclosedMatrix.beside(vectors)
        return _square(kept.transposed @ whole) - _square(whole).times(t)

    return WorstCaseCondition("krylov", values, lowered)


def gram_form(t: float) -> WorstCaseCondition:
    """Return J_fᵀJ_f − tI on (1, …, 1), J_fᵀj_f and J_fᵀs."""

    def values(jacobian: EnclosedMatrix, locked: int | None) -> EnclosedMatrix:
        kept, own = _parts(jacobian, locked)
        count = kept.values.shape[-1]
        ones = EnclosedMatrix.exact(np.ones((count, 1)), jacobian).times(1 / _ROOT_6)
        sums = _total(jacobian).times(1 / np.longdouble(_UNIT))
        images = [kept.transposed @ own, kept.transposed @ sums]
        whole = EnclosedMatrix.beside([ones, *images])
        return _square(kept @ whole) - _square(whole).times(t)

    return WorstCaseCondition("gram", values, (0, 2, 2))


def deviation_form(deviation: float) -> WorstCaseCondition:
    """Return δ₀M − ssᵀ, in units of s, on j_f, s, M j_f and M s."""

    def values(jacobian: EnclosedMatrix, locked: int | None) -> EnclosedMatrix:
        _, own = _parts(jacobian, locked)
        sums = _total(jacobian).times(1 / np.longdouble(_UNIT))
        images = [_image(jacobian, own), _image(jacobian, sums)]
        whole = EnclosedMatrix.beside([own, sums, *images])
        share = np.longdouble(deviation) / np.longdouble(_UNIT) ** 2
        along = _square(sums.transposed @ whole)
        return _square(jacobian.transposed @ whole).times(share) - along

    return WorstCaseCondition("deviation", values, (0, 0, 2, 2))


def _parts(
    jacobian: EnclosedMatrix, locked: int | None
) -> tuple[EnclosedMatrix, EnclosedMatrix]:
    """Return J_f and j_f/√2."""
    place = locked or 0
    return jacobian.without(place), jacobian.column(place).times(1 / _ROOT_2)


def _image(jacobian: EnclosedMatrix, vector: EnclosedMatrix) -> EnclosedMatrix:
    """Return M v/(n/3)."""
    third = np.longdouble(jacobian.values.shape[-1]) / 3
    return (jacobian @ (jacobian.transposed @ vector)).times(1 / third)


def _square(matrix: EnclosedMatrix) -> EnclosedMatrix:
    return matrix.transposed @ matrix


def null_vector_deviation(t: float) -> float:
    """Return δ₀, at least sᵀM⁻¹s wherever the squared worst case of 7 joints is t or more."""
    share = t / (2 + t)
    total = 6 * sqrt(share) + sqrt(1 - 6 * share)
    return 7 - total**2 + 1e-12
