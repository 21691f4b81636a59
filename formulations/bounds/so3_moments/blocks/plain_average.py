"""The blocks once more, by a longer road: a check of `sampled_blocks`.

Wigner functions come from Euler angles and the exponential of J_y instead of Clebsch–Gordan
coefficients, and the order of the joints is averaged by summing over all n! orders with one
tableau, instead of over tableaux with one order.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from formulations.bounds.so3_moments.blocks.sampled_blocks import (
    SectorBlocks,
    joint_factors,
    plain_rows,
)
from formulations.bounds.so3_moments.representations.adapted_rows import AdaptedRows
from formulations.bounds.so3_moments.representations.clebsch_gordan import Floats

_ORDERS_AT_ONCE = 720


def averaged_sum_of_squares(
    family: SectorBlocks, rotations: Floats, multipliers: Sequence[Floats]
) -> Floats:
    """Return Σ ⟨X, B(x)⟩ over the blocks of a sector at configurations, (configurations,)."""
    orders = np.array(list(permutations(range(family.joints))))
    roots = [multiplier_root(x) for x in multipliers]
    components = 2 * family.sector.spin + 1
    found = np.zeros(len(rotations))
    for number, configuration in enumerate(rotations):
        single = [
            wigner_by_angles(configuration, spin) for spin in range(family.largest_spin + 1)
        ]
        for start in range(0, len(orders), _ORDERS_AT_ONCE):
            wigner = [matrix[orders[start : start + _ORDERS_AT_ONCE]] for matrix in single]
            factors = joint_factors(wigner, range(family.joints))
            plain = [plain_rows(rows, factors) for rows in family.rows]
            for block, root in zip(family.blocks, roots, strict=True):
                found[number] += np.sum(first_tableau(block, root, plain) ** 2)
    return found / (len(orders) * components)


def first_tableau(block: AdaptedRows, root: Floats, plain: list[Floats]) -> Floats:
    """Return rootᵀ times the values of the block's rows for one tableau."""
    size = max(values[0].size for values in plain)
    total = np.zeros((root.shape[1], size))
    for number, columns, coefficients in block.parts:
        weights = coefficients[0] @ root[columns.start : columns.stop]
        values = weights.T @ plain[number].reshape(len(plain[number]), -1)
        total += np.tile(values, size // values.shape[1])
    return total


def multiplier_root(multiplier: Floats) -> Floats:
    """Return R with RRᵀ = X, positive semidefinite."""
    values, vectors = np.linalg.eigh(multiplier)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def wigner_by_angles(rotations: Floats, spin: int) -> NDArray[np.complex128]:
    """Return D^spin, (n, 2·spin+1, 2·spin+1), of R = R_z(α) R_y(β) R_z(γ)."""
    m = np.arange(-spin, spin + 1)
    raising = np.diag(np.sqrt(spin * (spin + 1) - m[:-1] * (m[:-1] + 1)), -1)
    generator = 0.5 * (raising - raising.T)  # i J_y
    beta = np.arccos(np.clip(rotations[:, 2, 2], -1, 1))
    alpha = np.arctan2(rotations[:, 1, 2], rotations[:, 0, 2])
    gamma = np.arctan2(rotations[:, 2, 1], -rotations[:, 2, 0])
    middle = np.stack([expm(-b * generator) for b in beta])
    left, right = np.exp(-1j * np.outer(alpha, m)), np.exp(-1j * np.outer(gamma, m))
    return np.asarray(left[:, :, None] * middle * right[:, None, :])
