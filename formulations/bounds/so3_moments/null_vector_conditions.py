"""What a worst case σ² ≥ t implies with the signs of the null vector, and of the spectrum.

With the signs of the columns such that the null vector of J is not negative, s = Σ j_f is
small: δ₀JJᵀ ⪰ ssᵀ. Blocks are averaged over the symmetries that are left: signs of columns are
not among them, only the sign of all together. And ρ ≤ α + β tr E³ + γ tr E⁴, E = JJᵀ − (n/3)I,
for numbers β and γ. docs/bounds.md, section 4, derives all conditions.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import product
from math import sqrt

import numpy as np
from scipy.optimize import linprog

from formulations.bounds.closed_form import largest_residual, mean_residual
from formulations.bounds.so3_moments.sampled_blocks import (
    Form,
    RowBlocks,
    residual_distance,
    sector_families,
)
from formulations.bounds.so3_moments.wigner import RowSector, jacobians_of, unsigned_sectors
from nlp.arrays import FloatArray

JOINTS = 7
# Units of s: between its size at a random configuration, √14, and √δ₀.
_UNIT = 0.6
#: β of the condition on the spectrum that is maximised under all others.
MAXIMISED = 0.2
#: Conditions ρ ≤ α + β tr E³ + γ tr E⁴ on the spectrum: (β, γ). Those of degree 6 also multiply
#: squares; the others are used as they are.
CUBIC = ((0.1, 0.0), (MAXIMISED, 0.0), (0.35, 0.0))
QUARTIC = tuple(
    product((0.0, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4), (-0.1, -0.05, 0.0, 0.05, 0.1, 0.2))
)
_GRID = 1001


@cache
def spectral_limit(t: float, cubic: float, quartic: float = 0.0) -> float:
    """Return α with ρ ≤ α + β tr E³ + γ tr E⁴ wherever the worst case is σ² ≥ t < 1/3.

    A linear program suggests A + Be + C/(c + e) ≥ ½e² − βe³ − γe⁴; A grows by what is missing.
    """
    mean, limit = JOINTS / 3 - t, (JOINTS - 6) / t
    middle = 2 * mean - 12 / limit
    root = sqrt(middle**2 + 5 * mean**2 - 30 * mean / limit)
    ends = np.array([middle - root, middle + root])
    power = np.polynomial.Polynomial([0.0, 0.0, 0.5, -cubic, -quartic])
    grid = np.linspace(ends[0], ends[1], _GRID)
    rows = np.stack([np.ones(_GRID), grid, 1 / (mean + grid)], axis=1)
    free = (None, None)
    found = linprog(
        [6, 0, limit], A_ub=-rows, b_ub=-power(grid), bounds=[free, free, (0, None)]
    )
    constant, slope, pole = found.x
    turning = (power.deriv() - slope) * np.polynomial.Polynomial([mean, 1.0]) ** 2 + pole
    where = np.clip(np.concatenate([ends, turning.roots().real]), *ends)
    missing = np.max(power(where) - constant - slope * where - pole / (mean + where))
    return float(6 * (constant + max(missing, 0.0)) + limit * pole) + 1e-9


def spectral_distance(
    limit: float, cubic: float, quartic: float, rotations: FloatArray
) -> FloatArray:
    """Return α + β tr E³ + γ tr E⁴ − ρ at rotations (configurations, n, 3, 3)."""
    jacobians = jacobians_of(rotations)
    defect = jacobians @ jacobians.swapaxes(1, 2) - jacobians.shape[2] / 3 * np.eye(6)
    square = defect @ defect
    cube = np.sum(square * defect, axis=(1, 2))
    residual = 0.5 * np.trace(square, axis1=1, axis2=2)
    fourth = np.sum(square**2, axis=(1, 2))
    return np.asarray(limit + cubic * cube + quartic * fourth - residual)


def spectral_families(
    sectors: Sequence[RowSector],
    t: float,
    slopes: Sequence[tuple[float, float]] = CUBIC,
) -> list[RowBlocks]:
    """Return the blocks of the sectors, each multiplied by α + β tr E³ + γ tr E⁴ − ρ."""
    distances = [partial(spectral_distance, spectral_limit(t, *pair), *pair) for pair in slopes]
    return [
        family
        for distance in distances
        for family in sector_families(sectors, JOINTS, factor=distance)
    ]


def null_vector_deviation(t: float) -> float:
    """Return δ₀, at least sᵀM⁻¹s wherever the squared worst case is t or more."""
    share = t / (2 + t)
    total = 6 * sqrt(share) + sqrt(1 - 6 * share)
    return 7 - total**2 + 1e-12


def gram_form(t: float) -> Form:
    """Return J_fᵀJ_f − tI on the vectors (1, …, 1), J_fᵀj_f and J_fᵀs."""

    def values(jacobians: FloatArray, locked: int) -> FloatArray:
        kept = np.delete(jacobians, locked, axis=2)
        ones = np.full((len(jacobians), JOINTS - 1, 1), 1 / sqrt(6))
        images = kept.swapaxes(1, 2) @ _column_and_sum(jacobians, locked)
        vectors = np.concatenate([ones, images], axis=2)
        return _products(kept @ vectors) - t * _products(vectors)

    return Form(values, (0, 2, 2))


def unsigned_krylov_form(t: float) -> Form:
    """Return J_f J_fᵀ − tI on the vectors j_f, s, Mj_f and Ms."""

    def values(jacobians: FloatArray, locked: int) -> FloatArray:
        vectors = _krylov(jacobians, locked)
        kept = np.delete(jacobians, locked, axis=2)
        return _products(kept.swapaxes(1, 2) @ vectors) - t * _products(vectors)

    return Form(values, (0, 0, 2, 2))


def deviation_form(deviation: float) -> Form:
    """Return δ₀M − ssᵀ, in units of s, on the vectors j_f, s, Mj_f and Ms."""

    def values(jacobians: FloatArray, locked: int) -> FloatArray:
        vectors = _krylov(jacobians, locked)
        along = jacobians.sum(axis=2)[:, None, :] @ vectors / _UNIT
        images = jacobians.swapaxes(1, 2) @ vectors
        return deviation / _UNIT**2 * _products(images) - _products(along)

    return Form(values, (0, 0, 2, 2))


def _column_and_sum(jacobians: FloatArray, locked: int) -> FloatArray:
    """Return j_f and s in their units, (configurations, 6, 2)."""
    return np.stack([jacobians[:, :, locked] / sqrt(2), jacobians.sum(axis=2) / _UNIT], axis=2)


def _krylov(jacobians: FloatArray, locked: int) -> FloatArray:
    """Return j_f and s, and M times them in units of n/3."""
    vectors = _column_and_sum(jacobians, locked)
    image = jacobians @ (jacobians.swapaxes(1, 2) @ vectors) / (JOINTS / 3)
    return np.concatenate([vectors, image], axis=2)


def _products(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors.swapaxes(1, 2) @ vectors)


@dataclass(frozen=True)
class UnsignedConditions:
    """The sectors of the conditions on functions that change with the signs of the columns."""

    plain: tuple[RowSector, ...]
    #: Of the blocks that are multiplied by δ − |s|², by ρ_max(t) − ρ, and by
    #: α + β tr E³ − ρ, see `spectral_limit`.
    near: tuple[RowSector, ...]
    scaled: tuple[RowSector, ...]
    spectral: tuple[RowSector, ...]
    #: Of the localisers of J_fᵀJ_f − tI, and of J_f J_fᵀ − tI and δ₀M − ssᵀ.
    gram: tuple[RowSector, ...]
    krylov: tuple[RowSector, ...]


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


def unsigned_families(conditions: UnsignedConditions, t: float) -> list[RowBlocks]:
    """Return the blocks that are positive semidefinite wherever the worst case is σ² ≥ t.

    The signs of the columns are those of the null vector; λ_max ≤ n/3 + √(5ρ_max/3).
    """
    limit = largest_residual(JOINTS, t)
    distance = partial(residual_distance, limit, mean_residual(JOINTS))
    deviation = null_vector_deviation(t)
    nearest = deviation * (JOINTS / 3 + sqrt(5 * limit / 3)) + 1e-12

    def nearness(rotations: FloatArray) -> FloatArray:
        total = jacobians_of(rotations).sum(axis=2)
        return np.asarray((nearest - np.sum(total**2, axis=1)) / 2)

    return [
        *sector_families(conditions.plain, JOINTS),
        *sector_families(conditions.near, JOINTS, factor=nearness),
        *sector_families(conditions.scaled, JOINTS, factor=distance),
        *spectral_families(conditions.spectral, t),
        *sector_families(conditions.gram, JOINTS, gram_form(t)),
        *sector_families(conditions.krylov, JOINTS, unsigned_krylov_form(t)),
        *sector_families(conditions.krylov, JOINTS, deviation_form(deviation)),
    ]
