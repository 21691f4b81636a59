"""Squares and localisers with multipliers: bounds on rounding and distances from invariants.

A Krylov localiser with X = LLᵀ is Σ ⟨H_f, Σ_j r_j r_jᵀ⟩, H_f = Vᵀ(J_f J_fᵀ − tI)V, with r_k =
(U_T L_k)ᵀφ of the rows L_k of L that go with the power k of M. Plain and scaled blocks are the
same with V = H = 1. Errors w_k of r_k, and e_k and ℓ as in `enclosed_squares`, change it by at
most Σ_kl |H_kl|(2|r_k|w_l + w_k w_l + |r_k| ℓe_l + ℓe_k ℓe_l) (docs/bounds.md, section 4).
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from formulations.bounds.so3_moments.enclosed_squares import (
    EXTENDED_UNIT,
    ROTATION_ENTRY,
    SAFETY,
    UNIT,
    EnclosedBlock,
    block_values,
    enclosed_block,
    gamma,
    plain_norms,
    product_error,
)
from formulations.bounds.so3_moments.sampled_blocks import (
    RowBlocks,
    krylov_values,
    krylov_vectors,
)
from formulations.bounds.so3_moments.symmetric_rows import AdaptedRows
from formulations.bounds.so3_moments.wigner import jacobians_of, wigner_matrices
from nlp.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class EnclosedSum:
    """Values of an invariant function at configurations, with bounds."""

    values: FloatArray
    #: Bounds on the distance from the exact values.
    errors: FloatArray
    #: Bounds on the sums of the absolute values of what was added up.
    sizes: FloatArray


def enclosed_residuals(rotations: FloatArray) -> EnclosedSum:
    """Return ρ = ½‖JJᵀ − (n/3)I‖_F² with bounds on its error, of extended rotations."""
    jacobians = jacobians_of(rotations)
    joints, unit = jacobians.shape[-1], EXTENDED_UNIT
    entry = joints * (2.1 * ROTATION_ENTRY * unit + 1.1 * gamma(joints + 4, unit))
    third = rotations.dtype.type(joints) / 3  # off by a unit, relative
    gram = jacobians @ jacobians.swapaxes(-1, -2) - third * np.eye(6)
    square = np.sum(gram**2, axis=(-1, -2))
    whole = 6.0 * entry
    error = np.sqrt(square) * whole + whole**2 + (gamma(40, unit) + UNIT) * square
    values = np.asarray(square / 2, float)
    return EnclosedSum(values, np.asarray(SAFETY * error, float), values)


def enclosed_scaled(
    limit: float, unit: float, squares: EnclosedSum, rotations: FloatArray
) -> EnclosedSum:
    """Return g·s̄ with g = (limit − ρ)/unit of squares s̄ ≥ 0; the two numbers are exact."""
    residuals = enclosed_residuals(rotations)
    factor = (limit - residuals.values) / unit
    # ρ, then a difference and a division.
    wrong = SAFETY * (residuals.errors / unit + 5 * UNIT * np.abs(factor))
    values = factor * squares.values
    errors = np.abs(factor) * squares.errors + wrong * (squares.values + squares.errors)
    sizes = SAFETY * np.abs(values)
    return EnclosedSum(values, SAFETY * (errors + UNIT * sizes), sizes)


def enclosed_powers(
    family: RowBlocks, block: AdaptedRows, root: FloatArray
) -> dict[int, EnclosedBlock]:
    """Return A_{T,k} = U_T L_k of a block for each power k that occurs.

    L, `root`, has a row for each of the family's `selection` from the block.
    """
    chosen, powers = family.selection(block)
    found = {}
    for power in range(len(family.lowered)):
        own = powers == power
        columns = np.zeros((block.size, root.shape[1]))
        columns[chosen[own]] = root[own]
        enclosed = enclosed_block(family, block, columns)
        if enclosed.parts:
            found[power] = enclosed
    return found


def enclosed_sum(
    family: RowBlocks,
    blocks: Sequence[Mapping[int, EnclosedBlock]],
    rotations: FloatArray,
) -> EnclosedSum:
    """Return the sum over the blocks of one family, averaged over all orders of the joints.

    The errors include the difference from its average; `blocks` holds `enclosed_powers` of
    each.
    """
    count = len(rotations)
    wigner = wigner_matrices(rotations, family.largest_spin)
    cases = list(_forms(family, rotations))
    blocks = [powers for powers in blocks if powers]
    mistakes = [
        [product_error(family, block) for block in powers.values()] for powers in blocks
    ]
    total, errors, sizes = np.zeros(count), np.zeros(count), np.zeros(count)
    terms = 0
    for forms, form_errors, orders in cases:
        bounds = SAFETY * np.abs(forms).astype(float) + form_errors[:, None, None]
        for order in orders:
            plain = family.plain_values(wigner, order)
            norms = plain_norms(family, plain)
            for powers, mistake in zip(blocks, mistakes, strict=True):
                chosen = np.array(list(powers))
                values = [block_values(block, plain, count) for block in powers.values()]
                grams = _grams(values)
                here = (slice(None), chosen[:, None], chosen)
                found = np.sum(forms[here] * grams, axis=(1, 2)).astype(float)
                squares = np.trace(grams, axis1=1, axis2=2).astype(float)
                wrong = np.array([fixed + relative @ norms for fixed, relative in mistake]).T
                steps = np.array([block.step(norms) for block in powers.values()]).T
                lengths = np.diagonal(grams, axis1=1, axis2=2).astype(float)
                lengths = SAFETY * np.sqrt(lengths) + wrong
                h = bounds[here]
                size = _form_value(lengths, lengths, h)
                # Squares are added up in extended precision: at most 2¹¹ terms for one more
                # unit. Then nine products with H, if there is one.
                units = 4 + values[0].shape[0] * values[0].shape[2] // 2**11
                units += 20 if len(family.lowered) > 1 else 0
                # `lengths` holds w already: 2(|r| + w)w is more than 2|r|w + w².
                error = _form_value(lengths, 2 * wrong + steps, h)
                error += _form_value(steps, steps, h) + gamma(units) * size
                error += form_errors * squares
                weight = 1.0 / (len(cases) * len(orders) * next(iter(powers.values())).scale)
                total += weight * found
                errors += SAFETY * weight * error
                sizes += SAFETY * weight * size
                terms += 1
    # Weights and sums over blocks and orders.
    return EnclosedSum(total, SAFETY * (errors + gamma(terms + 8) * sizes), SAFETY * sizes)


def _forms(
    family: RowBlocks, rotations: FloatArray
) -> Iterator[tuple[FloatArray, FloatArray, Sequence[Sequence[int]]]]:
    """Give H, bounds on its error, and orders of the joints; H = 1 for plain squares."""
    if family.form is None:
        count = len(rotations)
        yield np.ones((count, 1, 1), dtype=np.longdouble), np.zeros(count), family.orders()
        return
    if family.form.limit is None:
        raise NotImplementedError("no error bounds for this form")
    jacobians = jacobians_of(rotations)
    for locked in range(family.joints):
        yield *krylov_forms(jacobians, locked, family.form.limit), family.orders(locked)


def krylov_forms(
    jacobians: FloatArray, locked: int, limit: float
) -> tuple[FloatArray, FloatArray]:
    """Return H = Vᵀ(J_f J_fᵀ − tI)V, (…, powers, powers), and bounds on its error."""
    joints, unit = jacobians.shape[2], EXTENDED_UNIT
    vectors, kept = krylov_vectors(jacobians, locked)
    form = krylov_values(vectors, kept, limit)
    whole = SAFETY * sqrt(2 * joints)
    entries = ROTATION_ENTRY * unit * sqrt(6 * joints)
    lengths = SAFETY * np.sqrt(np.sum(vectors**2, axis=1).astype(float))
    # v_0: six entries over √2, each off by ROTATION_ENTRY units; √2 and a division.
    wrong = [np.full(len(jacobians), (ROTATION_ENTRY * sqrt(3) + 4) * unit)]
    for power in range(1, vectors.shape[2]):
        # v_k = J(Jᵀv)/(n/3): J twice, v, two products and two divisions.
        own = whole**2 * wrong[-1]
        rest = 2 * whole * entries + 2 * whole**2 * gamma(joints + 12, unit)
        wrong.append(SAFETY * 3 / joints * (own + rest * lengths[:, power - 1]))
    vector_error = _norm_of(wrong)
    length = _norm_of(lengths.T)
    kept_length = SAFETY * np.sqrt(np.sum(kept**2, axis=(1, 2)).astype(float))
    kept_error = whole * vector_error + (entries + whole * gamma(8, unit)) * length
    error = kept_error * (2 * kept_length + kept_error) + limit * vector_error * (
        2 * length + vector_error
    )
    # Sums of at most n − 1 or six products, t in front of one, and the difference.
    error += gamma(joints + 12, unit) * (kept_length**2 + limit * length**2)
    return form, SAFETY * error


def _grams(values: Sequence[FloatArray]) -> FloatArray:
    """Return Σ r_k r_l, (configurations, powers, powers), added up in extended precision."""
    count = values[0].shape[1]
    found = np.zeros((count, len(values), len(values)), dtype=np.longdouble)
    for k, first in enumerate(values):
        for other, second in enumerate(values[: k + 1]):
            products = np.sum(first * second, axis=(0, 2), dtype=np.longdouble)
            found[:, k, other] = found[:, other, k] = products
    return np.asarray(found)


def _form_value(first: FloatArray, second: FloatArray, forms: FloatArray) -> FloatArray:
    """Return aᵀHb, (configurations,), of a and b, (configurations, powers)."""
    return np.asarray(np.sum(first[:, :, None] * forms * second[:, None, :], axis=(1, 2)))


def _norm_of(parts: Iterable[FloatArray]) -> FloatArray:
    """Return the root of the sum of squares, rounded up, (configurations,)."""
    return np.asarray(SAFETY * np.sqrt(sum(part**2 for part in parts)))
