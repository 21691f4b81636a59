"""Sums of squares of rows: bounds on all rounding and on how far they are from invariant.

For a block with bases U_T (floating-point numbers, taken as they are) and X = LLᵀ let A_T be
the rounded U_T L. Then

    s(x) = Σ_orders Σ_T |A_Tᵀφ(x)|² / (orders · (2L+1) · tableaux) ≥ 0,

for any A_T. Over rotations of the frame, phase, conjugation and signs s is invariant
exactly, since φ stands for the exact rows; over permutations only if A obeys Young's
orthogonal form exactly: P A_T = Σ A_T' Y_{T'T} for exchanges P of neighbours. If the two sides
differ by E with |Eᵀφ| ≤ e, an exchange changes |Aᵀφ| by at most e, and a permutation of k and
of n − k joints takes at most ℓ = k(k−1)/2 + (n−k)(n−k−1)/2 exchanges: with a = |Aᵀφ|, a²
differs from its average over permutations, which is invariant and not negative, by at most
ℓe(2a + ℓe).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from formulations.bounds.so3_moments.blocks.sampled_blocks import SectorBlocks
from formulations.bounds.so3_moments.representations.adapted_rows import AdaptedRows
from formulations.bounds.so3_moments.representations.permuted_rows import PermutedRows
from formulations.bounds.so3_moments.representations.rounding import (
    UNIT,
    exchange_error,
    gamma,
    row_error,
)
from formulations.bounds.so3_moments.representations.wigner import wigner_matrices
from formulations.bounds.so3_moments.representations.young_basis import young_form
from nlp.arrays import FloatArray

# Norms are computed in floating point; their relative errors are far below this.
SAFETY = 1.0 + 1e-6


@dataclass(frozen=True, eq=False)
class EnclosedBlock:
    """A block with other columns instead of its rows: A_T = U_T · columns.

    Parameters
    ----------
    parts
        Number of a set of labels and A_T there, shape (tableaux, plain rows, columns).
    difference
        Bound e on |Eᵀφ| for all configurations.
    exchanges
        Number ℓ of exchanges that make any permutation.
    scale
        (2L+1) · tableaux.
    """

    parts: tuple[tuple[int, FloatArray], ...]
    difference: float
    exchanges: int
    scale: int

    def asymmetry(self, norm: FloatArray) -> FloatArray:
        """Return a bound on how far |Aᵀφ|² is from its average, for |Aᵀφ| up to `norm`."""
        step = self.exchanges * self.difference
        return np.asarray(SAFETY * step * (2 * norm + step))


def enclosed_block(
    family: SectorBlocks, block: AdaptedRows, columns: FloatArray
) -> EnclosedBlock:
    """Return A_T = U_T · columns of a block, with its bounds; columns (size, count)."""
    merged: dict[int, FloatArray] = {}
    for number, place, coefficients in block.parts:
        part = coefficients @ columns[place.start : place.stop]
        merged[number] = merged[number] + part if number in merged else part
    parts = tuple(merged.items())
    rows = [family.rows[number] for number, _ in parts]
    exchanges = sum(len(place) * (len(place) - 1) // 2 for place in rows[0].places)
    difference = _exchange_difference(rows, [a for _, a in parts], block)
    return EnclosedBlock(
        parts, difference, exchanges, (2 * family.sector.spin + 1) * block.tableaux
    )


def _exchange_difference(
    rows: Sequence[PermutedRows], parts: Sequence[FloatArray], block: AdaptedRows
) -> float:
    """Return a bound on |Eᵀφ|, E = P A_T − Σ A_T' Y_{T'T}, for all exchanges and φ."""
    places = rows[0].places
    form = young_form(block.shapes, places)
    worst = 0.0
    for joint in (joint for place in places for joint in place[:-1]):
        total = 0.0
        for entry, a in zip(rows, parts, strict=True):
            exchange = entry.exchange(joint)
            rounding = exchange_error(entry) + sqrt(entry.ways) * gamma(entry.ways + 4)
            difference = exchange @ a
            for number, (goal, distance) in enumerate(form[joint]):
                difference[number] -= a[number] / distance
                if abs(distance) > 1:
                    difference[number] -= sqrt(1 - 1 / distance**2) * a[goal]
            size = float(np.linalg.norm(a))
            # An exchange has at most `ways` entries in a row.
            norm = float(np.linalg.norm(difference)) + (rounding + 12 * UNIT) * size
            total += norm * sqrt(len(entry.assignments))
        worst = max(worst, total)
    return worst * SAFETY


def enclosed_sums(
    family: SectorBlocks, blocks: Sequence[EnclosedBlock], rotations: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return Σ s̄(x) over blocks of one family, and bounds on the errors, (configurations,).

    The errors include the difference between s and its average s̄.
    """
    count = len(rotations)
    wigner = wigner_matrices(rotations, family.largest_spin)
    orders = family.orders
    total, errors = np.zeros(count), np.zeros(count)
    mistakes = [product_error(family, block) for block in blocks]
    for order in orders:
        plain = family.plain_values(wigner, order)
        for block, mistake in zip(blocks, mistakes, strict=True):
            squares, wrong = _block_sum(block, plain, mistake, count)
            weight = 1.0 / (len(orders) * block.scale)
            total += weight * squares
            errors += weight * (wrong + block.asymmetry(np.sqrt(squares + wrong)))
    # Weights and sums of positive numbers over blocks and orders.
    return total, SAFETY * (errors + gamma(len(orders) * len(blocks) + 8) * total)


def product_error(family: SectorBlocks, block: EnclosedBlock) -> float:
    """Return a bound on the Euclidean norm of the error of Aᵀφ for one order."""
    wrong = 0.0
    for number, a in block.parts:
        rows = family.rows[number]
        flat = a.transpose(1, 0, 2).reshape(a.shape[1], -1)
        products = gamma(a.shape[1] + len(block.parts) + 1)
        size = _norm(flat) * row_error(rows) + 1.1 * _norm(np.abs(flat)) * products
        wrong += size * sqrt(len(rows.assignments))
    return SAFETY * wrong


def _norm(matrix: FloatArray) -> float:
    """Return the spectral norm of a matrix with few rows, rounded up."""
    square = matrix @ matrix.T
    return SAFETY * sqrt(max(float(np.linalg.eigvalsh(square)[-1]), 0.0))


def _block_sum(
    block: EnclosedBlock, plain: Sequence[FloatArray], wrong: float, count: int
) -> tuple[FloatArray, FloatArray]:
    """Return Σ_T |A_Tᵀφ|² and a bound on its error, of one order."""
    components = plain[0].shape[2]
    found = np.zeros((1, 1))
    for number, a in block.parts:
        values = np.tile(plain[number], (1, count // plain[number].shape[1], 1))
        flat = a.transpose(0, 2, 1).reshape(-1, a.shape[1])
        found = found + flat @ values.reshape(len(values), -1)
    squared = np.sum(found.reshape(-1, count, components) ** 2, axis=(0, 2))
    terms = found.shape[0] * components
    error = 2 * np.sqrt(squared) * wrong + wrong**2 + gamma(terms + 2) * squared
    return squared, SAFETY * error
