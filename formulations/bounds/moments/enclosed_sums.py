"""Squares and conditions times multipliers: bounds on rounding and distance from invariance.

A sum of squares, or of a condition H with the multiplier X = LLᵀ, is Σ_j ⟨H, r_j r_jᵀ⟩. Here
r_k = (U_T L_k)ᵀφ of the rows L_k of L that go with vector w_k; H = 1 for squares. Errors w_k of
r_k, and e_k and ℓ as in `enclosed_squares`, change it by at most

    Σ_k |Σ_l H_kl r_l| (2w_k + ℓe_k) + Σ_kl |H_kl| (w_k w_l + ℓe_k ℓe_l)

(docs/bounds.md, section 4).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.bounds.moments.block_values import (
    block_values,
    in_chunks,
    plain_norms,
)
from lockedjoint.formulations.bounds.moments.enclosed_matrix import (
    SAFETY,
    UNIT,
    EnclosedMatrix,
    gamma,
    require_extended_precision,
)
from lockedjoint.formulations.bounds.moments.enclosed_squares import EnclosedBlock
from lockedjoint.formulations.bounds.moments.row_rounding import unit_of
from lockedjoint.formulations.bounds.moments.sampled_blocks import BlockFamily
from lockedjoint.formulations.bounds.moments.wigner import wigner_matrices
from lockedjoint.nlp.arrays import FloatArray

# Slack of each |r_l| relative to it: grams are off by at most 2u|r_k||r_l|, whose root is below
# 1e-7|r|.
_GRAM_SLACK = 1e-7
# Number of terms added up in extended precision whose rounding is one unit of double precision.
_TERMS_PER_UNIT = 2**11


@dataclass(frozen=True, eq=False)
class EnclosedSum:
    """Values of an invariant function at configurations, with bounds.

    Attributes
    ----------
    values
        The values, shape (configurations,).
    errors
        Bounds on the distance from the exact values.
    sizes
        Bounds on the sums of the absolute values of what was added up.
    """

    values: FloatArray
    errors: FloatArray
    sizes: FloatArray


def enclosed_sum(
    family: BlockFamily,
    blocks: Sequence[EnclosedBlock],
    rotations: FloatArray,
) -> EnclosedSum:
    """Return the sum over the blocks of one family, averaged over all orders of the joints.

    The errors include the difference from its average.
    """
    require_extended_precision()  # this may be the process of a worker
    configurations = len(rotations)
    jacobian = EnclosedMatrix.jacobian(rotations)
    rounded = unit_of(family) == UNIT
    wigner = wigner_matrices(rotations, family.largest_spin, rounded=rounded)
    components = 2 * family.sector.spin + 1
    cases = family.cases
    blocks = [block for block in blocks if block.parts]
    values = np.zeros(configurations, np.longdouble)
    errors, sizes = np.zeros(configurations), np.zeros(configurations)
    for case in cases:
        condition = _condition_matrix(family, jacobian, case.locked)
        for order in case.orders:
            plain = family.plain_values(wigner, order)
            norms = plain_norms(family, plain)
            chunks = in_chunks(plain, configurations)
            for block in blocks:
                chunk_values = (block_values(block, chunk, 2 * components) for chunk in chunks)
                grams = np.concatenate([_grams(some) for some in chunk_values])
                term = _enclosed_term(block, condition, grams, norms, 2 * components)
                weight = 1.0 / (len(cases) * len(case.orders) * components * block.tableaux)
                values += weight * term.values
                errors += SAFETY * weight * term.errors
                sizes += SAFETY * weight * term.sizes
    # γ_4: weights, sums over fewer than 2¹¹ blocks and orders in extended precision, and the
    # rounding to double at the end.
    return EnclosedSum(
        values.astype(float), SAFETY * (errors + gamma(4) * sizes), SAFETY * sizes
    )


def _enclosed_term(
    block: EnclosedBlock,
    condition: EnclosedMatrix,
    grams: FloatArray,
    norms: FloatArray,
    components: int,
) -> EnclosedSum:
    """Return ⟨H, Σ r rᵀ⟩ of one block and one order of the joints.

    Parameters
    ----------
    block
        The block.
    condition
        H, shape (configurations, vectors, vectors).
    grams
        Σ r rᵀ, shape (configurations, vectors, vectors).
    norms
        Bounds on |φ| of each label set, shape (label sets, configurations).
    components
        Number of real and imaginary parts of a value of φ.
    """
    here = (slice(None), block.vectors[:, None], block.vectors)
    h = condition.values[here]
    h_errors = condition.errors
    h_bounds = (SAFETY * np.abs(condition.values).astype(float) + h_errors[:, None, None])[here]
    values = np.sum(h * grams, axis=(1, 2))
    mistakes, steps = block.mistakes(norms).T, block.steps(norms).T
    squares = np.trace(grams, axis1=1, axis2=2).astype(float)
    computed = SAFETY * np.sqrt(np.diagonal(grams, axis1=1, axis2=2).astype(float))
    lengths = computed + mistakes  # at least |r_k|
    sizes = _form_value(lengths, lengths, h_bounds)
    pulls = _pulls(h, grams, h_bounds, _GRAM_SLACK * lengths + mistakes)
    pulls += (h_errors * lengths.sum(axis=1))[:, None]
    errors = np.sum(pulls * (2 * mistakes + steps), axis=1)
    errors += _form_value(mistakes, mistakes, h_bounds) + _form_value(steps, steps, h_bounds)
    # Squares are added up, and multiplied by H, in extended precision.
    terms = components * block.tableaux * block.factors.shape[2]
    errors += gamma(5 + terms // _TERMS_PER_UNIT) * sizes
    errors += h_errors * squares
    return EnclosedSum(values, errors, sizes)


def _condition_matrix(
    family: BlockFamily, jacobian: EnclosedMatrix, locked: int | None
) -> EnclosedMatrix:
    """Return H, (configurations, vectors, vectors), with bounds on its error; 1 for squares."""
    configurations = len(jacobian.values)
    if family.condition is None:
        one: FloatArray = np.ones((configurations, 1, 1), dtype=np.longdouble)
        return EnclosedMatrix(one, np.zeros(configurations))
    return family.condition.values(jacobian, locked)


def _grams(values: FloatArray) -> FloatArray:
    """Return Σ r_k r_l, (configurations, vectors, vectors), added up in extended precision."""
    configurations = values[0].shape[2]
    grams = np.zeros((configurations, len(values), len(values)), dtype=np.longdouble)
    for k, first in enumerate(values):
        for other, second in enumerate(values[: k + 1]):
            products = np.sum(first * second, axis=(0, 1), dtype=np.longdouble)
            grams[:, k, other] = products
            grams[:, other, k] = products
    return np.asarray(grams)


def _pulls(
    h: FloatArray, grams: FloatArray, h_bounds: FloatArray, slack: FloatArray
) -> FloatArray:
    """Return bounds on |Σ_l H_kl r_l|, (configurations, vectors).

    `slack` bounds how much each |r_l| may be off what the grams Σ r_k r_l say.
    """
    squares = np.diagonal(h @ grams @ h, axis1=1, axis2=2).astype(float)
    added = np.sum(h_bounds * slack[:, None, :], axis=2)
    return np.asarray(SAFETY * (np.sqrt(np.maximum(squares, 0.0)) + added))


def _form_value(first: FloatArray, second: FloatArray, h: FloatArray) -> FloatArray:
    """Return aᵀHb, (configurations,), of a and b, (configurations, vectors)."""
    return np.asarray(np.sum(first[:, :, None] * h * second[:, None, :], axis=(1, 2)))
