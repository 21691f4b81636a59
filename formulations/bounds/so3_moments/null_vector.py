"""Localisers of a worst case where the signs of the columns are fixed by the null vector.

J has one joint more than rows. Let n be its unit null vector, and choose the signs of the
columns such that every n_f ≥ 0. If J_fᵀJ_f ⪰ tI for every joint f, then 2n_f² ≥ t(1 − n_f²):
n_f j_f = −Σ n_g j_g over the others. So n_f² ≥ ν = t/(2 + t), the sum of the n_f is at least
6√ν + √(1 − 6ν), and the distance of the vector (1, …, 1) from the multiples of n at most √δ₀,

    δ₀ = 7 − (6√ν + √(1 − 6ν))².

Hence s = Σ j_f = J(1, …, 1) has sᵀM⁻¹s ≤ δ₀, that is δ₀M ⪰ ssᵀ, and |s|² ≤ δ₀ λ_max(M).

The blocks are averaged over the symmetries that are left: signs of columns are not among them,
only the sign of all together.
"""

from dataclasses import dataclass
from functools import partial
from math import sqrt

import numpy as np

from formulations.bounds.closed_form import largest_residual
from formulations.bounds.so3_moments.localisers import Form, FormLocaliser, ScaledBlocks
from formulations.bounds.so3_moments.row_sectors import UnsignedSector
from formulations.bounds.so3_moments.sampled_blocks import BlockFamily, sector_families
from formulations.bounds.so3_moments.wigner import jacobians_of
from formulations.bounds.so3_moments.worst_case_conditions import (
    residual_distance,
    spectral_families,
)
from nlp.arrays import FloatArray

JOINTS = 7
#: Units of s: between its size at a random configuration, √14, and √δ₀.
_UNIT = 0.6


def null_vector_deviation(t: float) -> float:
    """Return δ₀, at least sᵀM⁻¹s wherever the squared worst case is t or more."""
    share = t / (2 + t)
    total = 6 * sqrt(share) + sqrt(1 - 6 * share)
    return 7 - total**2 + 1e-12


def gram_form(t: float) -> Form:
    """Return J_fᵀJ_f − tI on the vectors (1, …, 1), J_fᵀj_f and J_fᵀs."""

    def values(jacobians: FloatArray, locked: int) -> FloatArray:
        kept, column, total = _parts(jacobians, locked)
        ones = np.full((len(jacobians), JOINTS - 1, 1), 1 / sqrt(6))
        vectors = np.concatenate([ones, kept.swapaxes(1, 2) @ _units(column, total)], axis=2)
        return _products(kept @ vectors) - t * _products(vectors)

    return Form(values, (0, 2, 2))


def krylov_form(t: float) -> Form:
    """Return J_f J_fᵀ − tI on the vectors j_f, s, Mj_f and Ms."""

    def values(jacobians: FloatArray, locked: int) -> FloatArray:
        kept, column, total = _parts(jacobians, locked)
        vectors = _krylov(jacobians, _units(column, total))
        return _products(kept.swapaxes(1, 2) @ vectors) - t * _products(vectors)

    return Form(values, (0, 0, 2, 2))


def deviation_form(deviation: float) -> Form:
    """Return M − ssᵀ/δ₀, in units of s, on the vectors j_f, s, Mj_f and Ms."""

    def values(jacobians: FloatArray, locked: int) -> FloatArray:
        _, column, total = _parts(jacobians, locked)
        vectors = _krylov(jacobians, _units(column, total))
        along = total.swapaxes(1, 2) @ vectors / _UNIT
        return deviation / _UNIT**2 * _products(jacobians.swapaxes(1, 2) @ vectors) - _products(
            along
        )

    return Form(values, (0, 0, 2, 2))


def _parts(jacobians: FloatArray, locked: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return J_f, j_f and s; vectors have shape (configurations, 6, 1)."""
    kept = np.delete(jacobians, locked, axis=2)
    total = jacobians.sum(axis=2, keepdims=True)
    return kept, jacobians[:, :, locked, None], total


def _units(column: FloatArray, total: FloatArray) -> FloatArray:
    return np.concatenate([column / sqrt(2), total / _UNIT], axis=2)


def _krylov(jacobians: FloatArray, vectors: FloatArray) -> FloatArray:
    """Return the vectors, and M times them in units of n/3."""
    image = jacobians @ (jacobians.swapaxes(1, 2) @ vectors) / (JOINTS / 3)
    return np.concatenate([vectors, image], axis=2)


def _products(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors.swapaxes(1, 2) @ vectors)


@dataclass(frozen=True)
class UnsignedConditions:
    """The sectors of the conditions on functions that change with the signs of the columns."""

    plain: tuple[UnsignedSector, ...]
    #: Of the blocks that are multiplied by δ − |s|², by ρ_max(t) − ρ, and by
    #: α + β tr E³ − ρ, see `spectral_limit`.
    near: tuple[UnsignedSector, ...]
    scaled: tuple[UnsignedSector, ...]
    spectral: tuple[UnsignedSector, ...]
    #: Of the localisers of J_fᵀJ_f − tI, and of J_f J_fᵀ − tI and δ₀M − ssᵀ.
    gram: tuple[UnsignedSector, ...]
    krylov: tuple[UnsignedSector, ...]


def unsigned_sectors(
    degree: int, spins: range, *, locked: bool = False
) -> tuple[UnsignedSector, ...]:
    """Return the sectors of all charges of a degree, within the given total spins."""
    charges = range(degree % 2, degree + 1, 2)
    return tuple(UnsignedSector(c, spin, degree, locked) for spin in spins for c in charges)


UNSIGNED = UnsignedConditions(
    plain=unsigned_sectors(4, range(5)) + unsigned_sectors(3, range(4)),
    near=unsigned_sectors(3, range(4)),
    scaled=unsigned_sectors(2, range(3)),
    spectral=unsigned_sectors(1, range(2)),
    gram=unsigned_sectors(2, range(3), locked=True)
    + unsigned_sectors(3, range(3), locked=True),
    krylov=unsigned_sectors(1, range(3), locked=True)
    + unsigned_sectors(2, range(3), locked=True),
)


def unsigned_families(conditions: UnsignedConditions, t: float) -> list[BlockFamily]:
    """Return the blocks that are positive semidefinite wherever the worst case is σ² ≥ t.

    The signs of the columns are those of the null vector. For the spectrum with one deviation
    d of an eigenvalue from its mean, ρ ≥ (3/5)d²; so λ_max ≤ n/3 + √(5ρ_max/3).
    """
    limit = largest_residual(JOINTS, t)
    distance = partial(residual_distance, limit, 5 * JOINTS / 3)
    deviation = null_vector_deviation(t)
    nearest = deviation * (JOINTS / 3 + sqrt(5 * limit / 3)) + 1e-12

    def nearness(rotations: FloatArray) -> FloatArray:
        total = jacobians_of(rotations).sum(axis=2)
        return np.asarray((nearest - np.sum(total**2, axis=1)) / 2)

    localisers = [
        *(FormLocaliser(sector, JOINTS, gram_form(t)) for sector in conditions.gram),
        *(
            FormLocaliser(sector, JOINTS, form)
            for form in (krylov_form(t), deviation_form(deviation))
            for sector in conditions.krylov
        ),
    ]
    return [
        *sector_families(conditions.plain, JOINTS),
        *(ScaledBlocks(one, nearness) for one in sector_families(conditions.near, JOINTS)),
        *(ScaledBlocks(one, distance) for one in sector_families(conditions.scaled, JOINTS)),
        *spectral_families(conditions.spectral, t),
        *(family for family in localisers if family.blocks),
    ]
