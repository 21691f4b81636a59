"""Conditions on the spectrum of M = JJᵀ that a worst case implies, of degree 6 and 8 in J.

With E = M − (n/3)I they are ρ ≤ α + β tr E³ + γ tr E⁴, for numbers β and γ and the α that
follows from the worst case.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from math import sqrt

import numpy as np
from scipy.optimize import linprog

from formulations.bounds.so3_moments.blocks.localisers import ScaledBlocks
from formulations.bounds.so3_moments.blocks.null_vector import JOINTS
from formulations.bounds.so3_moments.blocks.sampled_blocks import (
    BlockFamily,
    sector_families,
)
from formulations.bounds.so3_moments.representations.row_sectors import (
    RowSector,
    UnsignedSector,
)
from formulations.bounds.so3_moments.representations.wigner import jacobians_of
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


@cache
def spectral_limit(t: float, cubic: float, quartic: float = 0.0, joints: int = JOINTS) -> float:
    """Return α with ρ ≤ α + β tr E³ + γ tr E⁴ wherever the worst case is σ² ≥ t.

    Parameters
    ----------
    t
        The squared worst case, below (n − 6)/3.
    cubic, quartic
        β and γ.
    joints
        Number n of joints.

    Notes
    -----
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


@dataclass(frozen=True)
class SpectralDistance:
    """The function α + β tr E³ + γ tr E⁴ − ρ of rotations (configurations, n, 3, 3).

    Parameters
    ----------
    limit, cubic, quartic
        α, β and γ.
    """

    limit: float
    cubic: float
    quartic: float = 0.0

    def __call__(self, rotations: FloatArray) -> FloatArray:
        """Return its values, (configurations,)."""
        jacobians = jacobians_of(rotations)
        defect = jacobians @ jacobians.swapaxes(1, 2) - jacobians.shape[2] / 3 * np.eye(6)
        square = defect @ defect
        cube = np.sum(square * defect, axis=(1, 2))
        residual = 0.5 * np.trace(square, axis1=1, axis2=2)
        fourth = np.sum(square**2, axis=(1, 2))
        return np.asarray(self.limit + self.cubic * cube + self.quartic * fourth - residual)


def spectral_families(
    sectors: Sequence[RowSector | UnsignedSector],
    t: float,
    slopes: Sequence[tuple[float, float]] = CUBIC,
) -> list[BlockFamily]:
    """Return the blocks of the sectors, each multiplied by α + β tr E³ + γ tr E⁴ − ρ."""
    blocks = sector_families(sectors, JOINTS)
    distances = [SpectralDistance(spectral_limit(t, *pair), *pair) for pair in slopes]
    return [ScaledBlocks(one, distance) for distance in distances for one in blocks]
