"""What a worst case σ² ≥ t implies: blocks that are positive semidefinite where it is.

If M − j_f j_fᵀ ⪰ tI for every joint f, then t Σ_k 1/(λ_k − t) ≤ n − 6 for the eigenvalues λ of
M = JJᵀ (see `closed_form`), and Σ λ_k = 2n for unit revolute columns. Hence
ρ = ½ Σ (λ_k − n/3)² is at most some ρ_max(t), which falls as t grows; and, with
E = M − (n/3)I, ρ ≤ α + β tr E³ + γ tr E⁴ for numbers β and γ and the α that follows from t.

The conditions are the plain blocks B ⪰ 0; (ρ_max(t) − ρ)B ⪰ 0 for blocks of low degree, and the
same with the other distances; and localisers of J_f J_fᵀ − tI.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import product
from math import sqrt

import numpy as np
from scipy.optimize import linprog

from formulations.bounds.closed_form import largest_residual, mean_residual
from formulations.bounds.so3_moments.localisers import KrylovLocaliser, ScaledBlocks
from formulations.bounds.so3_moments.row_sectors import (
    DEGREE_4,
    RowSector,
    UnsignedSector,
    without_repetition,
)
from formulations.bounds.so3_moments.sampled_blocks import BlockFamily, sector_families
from formulations.bounds.so3_moments.wigner import jacobians_of, residual_values
from nlp.arrays import FloatArray

#: β of the condition on the spectrum that is maximised under all others.
MAXIMISED = 0.2
#: Conditions ρ ≤ α + β tr E³ + γ tr E⁴ on the spectrum: (β, γ). Those of degree 6 also multiply
#: squares; the others are used as they are.
CUBIC = ((0.1, 0.0), (MAXIMISED, 0.0), (0.35, 0.0))
QUARTIC = tuple(
    product((0.0, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4), (-0.1, -0.05, 0.0, 0.05, 0.1, 0.2))
)
_GRID = 1001


@dataclass(frozen=True)
class WorstCaseConditions:
    """The sectors of the conditions of a worst case that are used."""

    #: Of the plain blocks, of those that are multiplied by ρ_max(t) − ρ, and of the localisers
    #: of J_f J_fᵀ − tI on Krylov vectors.
    plain: tuple[RowSector, ...]
    scaled: tuple[RowSector, ...]
    krylov: tuple[RowSector, ...] = ()


# Squares of total spin 2 and 3 matter here, though not for the residual.
_SQUARES = [
    *(RowSector(0, c, spin, 6) for c in (0, 2) for spin in (0, 1, 2)),
    RowSector(0, 0, 3, 6),
    *(RowSector(2, 0, spin, 6) for spin in (0, 1, 2)),
    RowSector(2, 2, 0, 6),
    RowSector(4, 0, 0, 6),
    *(RowSector(6, c, 0, 6) for c in (0, 2)),
]
CONDITIONS = WorstCaseConditions(
    plain=without_repetition([*DEGREE_4, *_SQUARES]),
    scaled=DEGREE_4,
    krylov=tuple(
        RowSector(k, c, spin, 4, locked)
        for k, locked in ((0, 0), (2, 0), (1, 1))
        for spin in range(3)
        for c in (0, 2, 4)
    ),
)
# With the signs of the null vector, squares of larger total spin are worth their time.
_MORE_SQUARES = (RowSector(0, 2, 3, 6), RowSector(0, 0, 4, 6))
SIGNED = replace(CONDITIONS, plain=without_repetition([*CONDITIONS.plain, *_MORE_SQUARES]))


def residual_distance(limit: float, unit: float, rotations: FloatArray) -> FloatArray:
    """Return (limit − ρ(x))/unit at rotations (configurations, n, 3, 3), in their precision."""
    return np.asarray((limit - residual_values(rotations)) / unit)


def condition_families(
    conditions: WorstCaseConditions, joints: int, t: float
) -> list[BlockFamily]:
    """Return the blocks that are positive semidefinite wherever the worst case is σ² ≥ t."""
    distance = partial(residual_distance, largest_residual(joints, t), mean_residual(joints))
    krylov = [KrylovLocaliser(sector, joints, t) for sector in conditions.krylov]
    return [
        *sector_families(conditions.plain, joints),
        *(ScaledBlocks(one, distance) for one in sector_families(conditions.scaled, joints)),
        *(family for family in krylov if family.blocks),
    ]


@cache
def spectral_limit(t: float, cubic: float, quartic: float = 0.0, joints: int = 7) -> float:
    """Return α with ρ ≤ α + β tr E³ + γ tr E⁴ wherever the worst case is σ² ≥ t < (n − 6)/3.

    The eigenvalues e_k of E = JJᵀ − (n/3)I add up to 0, and Σ 1/(c + e_k) ≤ (n − 6)/t with
    c = n/3 − t and all c + e_k > 0. The other five have the mean −e/5, so every one of them has
    1/(c + e) + 25/(5c − e) ≤ (n − 6)/t: it lies between the roots of a quadratic equation. If
    ½e² − βe³ − γe⁴ ≤ A + Be + C/(c + e) there and C ≥ 0, the sum over k is at most
    6A + (n − 6)C/t. A linear program on a grid suggests A, B and C; then A grows by what is
    missing, at the ends and wherever the derivative of the difference is 0.
    """
    mean, limit = joints / 3 - t, (joints - 6) / t
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
    sectors: Sequence[RowSector | UnsignedSector],
    t: float,
    slopes: Sequence[tuple[float, float]] = CUBIC,
) -> list[BlockFamily]:
    """Return the blocks of the sectors, each multiplied by α + β tr E³ + γ tr E⁴ − ρ."""
    blocks = sector_families(sectors, 7)
    distances = [partial(spectral_distance, spectral_limit(t, *pair), *pair) for pair in slopes]
    return [ScaledBlocks(one, distance) for distance in distances for one in blocks]
