"""Squares and localisers with multipliers: bounds on rounding and distances from invariants.

A localiser with X = LLᵀ is Σ ⟨H, Σ_j r_j r_jᵀ⟩, H that of its `WorstCaseCondition`, with r_k =
(U_T L_k)ᵀφ of the rows L_k of L that go with vector k. Squares are the same with H = 1. Errors
w_k of r_k, and e_k and ℓ as in `enclosed_squares`, change it by at most Σ_k |Σ_l H_kl r_l|
(2w_k + ℓe_k) + Σ_kl |H_kl|(w_k w_l + ℓe_k ℓe_l) (docs/bounds.md, section 4).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.bounds.so3_moments.enclosed_matrix import (
    SAFETY,
    UNIT,
    EnclosedMatrix,
    gamma,
)
from lockedjoint.formulations.bounds.so3_moments.enclosed_squares import (
    EnclosedBlock,
    block_values,
    grouped,
    plain_norms,
    require_extended_precision,
    unit_of,
)
from lockedjoint.formulations.bounds.so3_moments.sampled_blocks import RowBlocks
from lockedjoint.formulations.bounds.so3_moments.wigner import wigner_matrices
from lockedjoint.nlp.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class EnclosedSum:
    """Values of an invariant function at configurations, with bounds."""

    values: FloatArray
    #: Bounds on the distance from the exact values.
    errors: FloatArray
    #: Bounds on the sums of the absolute values of what was added up.
    sizes: FloatArray


def enclosed_sum(
    family: RowBlocks,
    blocks: Sequence[EnclosedBlock],
    rotations: FloatArray,
) -> EnclosedSum:
    """Return the sum over the blocks of one family, averaged over all orders of the joints.

    The errors include the difference from its average.
    """
    require_extended_precision()  # this may be the process of a worker
    count, jacobian = len(rotations), EnclosedMatrix.jacobian(rotations)
    rounded = unit_of(family) == UNIT
    wigner = wigner_matrices(rotations, family.largest_spin, rounded=rounded)
    cases, spins = family.cases, 2 * family.sector.spin + 1
    blocks = [block for block in blocks if block.parts]
    total, errors, sizes = np.zeros(count, np.longdouble), np.zeros(count), np.zeros(count)
    for locked, orders in cases:
        forms, form_errors = _form(family, jacobian, locked)
        bounds = SAFETY * np.abs(forms).astype(float) + form_errors[:, None, None]
        for order in orders:
            plain = family.plain_values(wigner, order)
            norms, groups = plain_norms(family, plain), grouped(plain, count)
            for block in blocks:
                some = (block_values(block, group, 2 * spins) for group in groups)
                grams = np.concatenate([_grams(values) for values in some])
                here = (slice(None), block.powers[:, None], block.powers)
                found = np.sum(forms[here] * grams, axis=(1, 2))
                squares = np.trace(grams, axis1=1, axis2=2).astype(float)
                wrong, steps = block.mistakes(norms).T, block.steps(norms).T
                lengths = np.diagonal(grams, axis1=1, axis2=2).astype(float)
                lengths = SAFETY * np.sqrt(lengths)
                lengths = lengths + wrong
                h = bounds[here]
                size = _form_value(lengths, lengths, h)
                # Squares are added up, and multiplied by H, in extended precision: at most 2¹¹
                # terms for one more unit.
                units = 5 + 2 * spins * block.tableaux * block.factors.shape[2] // 2**11
                pull = _pulls(forms[here], grams, h, 1e-7 * lengths + wrong)
                pull += (form_errors * lengths.sum(axis=1))[:, None]
                error = np.sum(pull * (2 * wrong + steps), axis=1)
                error += _form_value(wrong, wrong, h) + _form_value(steps, steps, h)
                error += gamma(units) * size
                error += form_errors * squares
                weight = 1.0 / (len(cases) * len(orders) * spins * block.tableaux)
                total += weight * found
                errors += SAFETY * weight * error
                sizes += SAFETY * weight * size
    # Weights, sums over fewer than 2¹¹ blocks and orders in extended precision, the last cast.
    return EnclosedSum(
        total.astype(float), SAFETY * (errors + gamma(4) * sizes), SAFETY * sizes
    )


def _form(
    family: RowBlocks, jacobian: EnclosedMatrix, locked: int | None
) -> tuple[FloatArray, FloatArray]:
    """Return H, (configurations, vectors, vectors), and bounds on its error; 1 for squares."""
    count = len(jacobian.values)
    if family.condition is None:
        return np.ones((count, 1, 1), dtype=np.longdouble), np.zeros(count)
    found = family.condition.values(jacobian, locked)
    return found.values, found.errors


def _grams(values: FloatArray) -> FloatArray:
    """Return Σ r_k r_l, (configurations, powers, powers), added up in extended precision."""
    count = values[0].shape[2]
    found = np.zeros((count, len(values), len(values)), dtype=np.longdouble)
    for k, first in enumerate(values):
        for other, second in enumerate(values[: k + 1]):
            products = np.sum(first * second, axis=(0, 1), dtype=np.longdouble)
            found[:, k, other] = found[:, other, k] = products
    return np.asarray(found)


def _pulls(
    forms: FloatArray, grams: FloatArray, sizes: FloatArray, slack: FloatArray
) -> FloatArray:
    """Return bounds on |Σ_l H_kl r_l|, (configurations, powers), of grams Σ r_k r_l.

    The slack of each |r_l|: grams are off by 2u|r_k||r_l| at most, whose root is below 1e-7,
    and r by its own error.
    """
    squares = np.diagonal(forms @ grams @ forms, axis1=1, axis2=2).astype(float)
    more = np.sum(sizes * slack[:, None, :], axis=2)
    return np.asarray(SAFETY * (np.sqrt(np.maximum(squares, 0.0)) + more))


def _form_value(first: FloatArray, second: FloatArray, forms: FloatArray) -> FloatArray:
    """Return aᵀHb, (configurations,), of a and b, (configurations, powers)."""
    return np.asarray(np.sum(first[:, :, None] * forms * second[:, None, :], axis=(1, 2)))
