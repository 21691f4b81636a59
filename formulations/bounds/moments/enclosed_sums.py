"""Squares and conditions times multipliers: bounds on rounding and distance from invariance.

What comes in: the blocks of one family, times the multipliers of a certificate. What goes out:
the value of their sum at configurations, and a bound on its distance from the exact value of an
invariant function.

- H: the matrix of the condition (`conditions`) at a configuration, shape (vectors, vectors);
  the number 1 for squares. Its rows belong to the vectors w_k on which the condition acts;
- L: the factor of the multiplier X = LLᵀ; L_k: its rows that go with vector w_k;
- r_k = (U_T L_k)ᵀφ, with U_T and φ as in `enclosed_squares`: numbers for each tableau T, column
  of L and component of φ. r_l is the same for w_l. `grams` has the sums Σ r_k r_l of products
  of these numbers, so that the value of the block is ⟨H, grams⟩;
- μ_k: a bound on the Euclidean norm of the errors of r_k, `mistakes` in the code;
- ℓe_k: a bound on what an order of the joints changes, as in `enclosed_squares`, `steps`.

The value is off by at most

    Σ_k |Σ_l H_kl r_l| (2μ_k + ℓe_k) + Σ_kl |H_kl| (μ_k μ_l + ℓe_k ℓe_l)

(docs/bounds.md, section 4, where μ is w). The |Σ_l H_kl r_l| are the `pulls`.
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

# Slack of each |r_l| relative to it, for the rounding of grams: they are off by at most
# 2u|r_k||r_l|, and √(2u) is below 1e-7.
_GRAM_SLACK = 1e-7
# Number of terms added up in extended precision whose rounding is one unit of double precision:
# the latter is 2^11 units of extended precision.
_TERMS_PER_UNIT = 2**11


@dataclass(frozen=True, eq=False)
class EnclosedSum:
    """Values of an invariant function at configurations, with bounds.

    Attributes
    ----------
    values
        The values, shape (configurations,).
    errors
        Bounds on the distance from the exact values, shape (configurations,).
    sizes
        Bounds on the sums of the absolute values of what was added up, shape (configurations,).
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

    The orders of joints that one group of the family's sector has are not evaluated: the errors
    include what they could change.

    Parameters
    ----------
    family
        The sector and the condition of the blocks.
    blocks
        The blocks, times multipliers.
    rotations
        The configurations in extended precision, shape (configurations, n, 3, 3).

    Raises
    ------
    NoExtendedPrecisionError
        If ``numpy.longdouble`` has fewer than 64 significant bits.
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
    """Return ⟨H, grams⟩ of one block and one order of the joints.

    Parameters
    ----------
    block
        The block.
    condition
        H of all vectors, shape (configurations, vectors, vectors).
    grams
        Σ r_k r_l, shape (configurations, vectors of the block, vectors of the block).
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
    # The lengths are at least the exact |r_k|.
    lengths = computed + mistakes
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
    """Return Σ r_k r_l, (configurations, vectors, vectors), added up in extended precision.

    `values` are the r of `block_values`, (vectors, numbers, components, configurations).
    """
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
    """Return bounds on |Σ_l H_kl r_l| for each k, shape (configurations, vectors).

    |Σ_l H_kl r_l|² is entry kk of H·grams·H. `h_bounds` are bounds on |H|, and `slack`, shape
    (configurations, vectors), bounds how much each r_l may be off what the grams say.
    """
    squares = np.diagonal(h @ grams @ h, axis1=1, axis2=2).astype(float)
    added = np.sum(h_bounds * slack[:, None, :], axis=2)
    return np.asarray(SAFETY * (np.sqrt(np.maximum(squares, 0.0)) + added))


def _form_value(first: FloatArray, second: FloatArray, h: FloatArray) -> FloatArray:
    """Return aᵀHb, (configurations,), of a and b, (configurations, vectors)."""
    return np.asarray(np.sum(first[:, :, None] * h * second[:, None, :], axis=(1, 2)))
