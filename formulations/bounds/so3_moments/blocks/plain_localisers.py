"""Krylov localisers once more, by a longer road: a check of `krylov_localisers`.

The multiplier's root gives vectors w of six polynomials. They are written out in full, and
wᵀ(J_f J_fᵀ − tI)w is evaluated with the matrix itself, for all n! orders of the joints with one
tableau and with Wigner functions from Euler angles, as in `plain_average`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

import numpy as np

from formulations.bounds.so3_moments.blocks.block_family import BlockFamily
from formulations.bounds.so3_moments.blocks.krylov_localisers import POWERS, KrylovLocaliser
from formulations.bounds.so3_moments.blocks.plain_average import (
    averaged_sum_of_squares,
    first_tableau,
    multiplier_root,
    wigner_by_angles,
)
from formulations.bounds.so3_moments.blocks.sampled_blocks import (
    SectorBlocks,
    joint_factors,
    plain_rows,
)
from formulations.bounds.so3_moments.blocks.scaled_blocks import ScaledBlocks
from formulations.bounds.so3_moments.representations.adapted_rows import AdaptedRows
from formulations.bounds.so3_moments.representations.clebsch_gordan import Floats
from formulations.bounds.so3_moments.representations.wigner import jacobians_of

_ORDERS_AT_ONCE = 720


def plain_condition_sum(
    family: BlockFamily, rotations: Floats, multipliers: Sequence[Floats]
) -> Floats:
    """Return Σ ⟨X, B(x)⟩ of a family by summing over all orders, (configurations,).

    Raises
    ------
    TypeError
        If there is no second way to evaluate the family.
    """
    if isinstance(family, ScaledBlocks):
        inner = plain_condition_sum(family.family, rotations, multipliers)
        return np.asarray(family.factor(rotations) * inner)
    if isinstance(family, KrylovLocaliser):
        return averaged_krylov_sum(family, rotations, multipliers)
    if isinstance(family, SectorBlocks):
        return averaged_sum_of_squares(family, rotations, multipliers)
    raise TypeError(f"no second way to evaluate {type(family).__name__}")


def averaged_krylov_sum(
    family: KrylovLocaliser, rotations: Floats, multipliers: Sequence[Floats]
) -> Floats:
    """Return Σ ⟨X, B(x)⟩ over the blocks of a Krylov localiser, (configurations,)."""
    orders = np.array(list(permutations(range(family.joints))))
    roots = [multiplier_root(x) for x in multipliers]
    found = np.zeros(len(rotations))
    for number, configuration in enumerate(rotations):
        jacobian = jacobians_of(configuration)
        single = [
            wigner_by_angles(configuration, spin) for spin in range(family.largest_spin + 1)
        ]
        for start in range(0, len(orders), _ORDERS_AT_ONCE):
            some = orders[start : start + _ORDERS_AT_ONCE]
            factors = joint_factors([matrix[some] for matrix in single], range(family.joints))
            plain = [plain_rows(rows, factors) for rows in family.rows]
            for block, root, selection in zip(
                family.blocks, roots, family.selections, strict=True
            ):
                weights = [
                    _spread(root[selection[1] == power], selection[0][selection[1] == power],
                            block.size)
                    for power in range(POWERS)
                ]  # fmt: skip
                found[number] += _sum(
                    jacobian, family.limit, some, block, weights, plain, family.sector.spin
                )
    return found / (len(orders) * (2 * family.sector.spin + 1))


def _sum(
    jacobian: Floats,
    limit: float,
    orders: Floats,
    block: AdaptedRows,
    weights: list[Floats],
    plain: list[Floats],
    spin: int,
) -> float:
    """Return Σ wᵀ(J_f J_fᵀ − tI)w over orders, components and columns of the root."""
    joints = jacobian.shape[1]
    whole = jacobian @ jacobian.T / (joints / 3)
    polynomials = [first_tableau(block, root, plain) for root in weights]
    # Rows without any joint are the same for all orders: one value for each component.
    columns = len(orders) * (2 * (2 * spin + 1))
    shaped = [
        np.tile(values, columns // values.shape[1]).reshape(len(values), len(orders), -1)
        for values in polynomials
    ]
    total = 0.0
    for locked in range(joints):
        here = orders[:, 0] == locked
        vector = jacobian[:, locked] / np.sqrt(2)
        w = np.zeros((6, *shaped[0][:, here].shape))
        for values in shaped:
            w += vector[:, None, None, None] * values[:, here]
            vector = whole @ vector
        flat = w.reshape(6, -1)
        kept = np.delete(jacobian, locked, axis=1)
        total += float(np.sum(flat * ((kept @ kept.T - limit * np.eye(6)) @ flat)))
    return total


def _spread(rows: Floats, places: Floats, size: int) -> Floats:
    """Return a matrix of `size` rows with the given ones in their places."""
    found = np.zeros((size, rows.shape[1]))
    found[places] = rows
    return found
