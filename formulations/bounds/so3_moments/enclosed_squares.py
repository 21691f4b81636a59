"""Sums of squares of rows, with bounds on all rounding, and on how far from invariant they are.

For a block with bases U_T (floating-point numbers, taken as they are) and X = LLᵀ let A_T be the
rounded U_T L. Then

    s(x) = Σ_orders Σ_T |A_Tᵀφ(x)|² / (orders · (2L+1) · tableaux) ≥ 0,

whatever A_T is. Over rotations of the frame, phase, conjugation and signs s is invariant
exactly, since φ stands for the exact rows; over permutations only if A obeys Young's orthogonal
form exactly: P A_T = Σ A_T' Y_{T'T} for exchanges P of neighbours. If the two sides differ by E,
‖PQPᵀ − Q‖ ≤ ‖E‖(2‖A‖ + ‖E‖) for Q = Σ A_T A_Tᵀ, and a permutation of k and of n − k joints takes
at most k(k−1)/2 + (n−k)(n−k−1)/2 exchanges. So s differs from its average over all
permutations, which is invariant and not negative, by no more than `asymmetry`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from formulations.bounds.so3_moments.adapted_rows import AdaptedRows
from formulations.bounds.so3_moments.clebsch_gordan import Floats
from formulations.bounds.so3_moments.permuted_rows import PermutedRows
from formulations.bounds.so3_moments.rounding import (
    UNIT,
    exchange_error,
    gamma,
    row_error,
)
from formulations.bounds.so3_moments.sampled_blocks import (
    SectorBlocks,
    joint_factors,
    plain_rows,
)
from formulations.bounds.so3_moments.wigner import wigner_matrices
from formulations.bounds.so3_moments.young_basis import neighbours, tableau_contents

# Norms are computed in floating point; their relative errors are far below this.
SAFETY = 1.0 + 1e-6


@dataclass(frozen=True, eq=False)
class EnclosedBlock:
    """A block with other columns instead of its rows: A_T = U_T · columns.

    Parameters
    ----------
    parts
        Number of a set of labels and A_T there, shape (tableaux, plain rows, columns).
    largest
        Bound on the spectral norm of A, all tableaux side by side.
    asymmetry
        Bound on |φᵀ(Q − average of Q)φ| over the scale of the block, for all configurations.
    trace
        Bound on Σ_T |A_Tᵀφ|² over the scale of the block, for all configurations.
    scale
        (2L+1) · tableaux.
    """

    parts: tuple[tuple[int, Floats], ...]
    largest: float
    asymmetry: float
    trace: float
    scale: int

    @property
    def frobenius(self) -> float:
        """Bound on the Frobenius norm of A."""
        return SAFETY * sqrt(sum(float(np.sum(a**2)) for _, a in self.parts))


def enclosed_block(family: SectorBlocks, block: AdaptedRows, columns: Floats) -> EnclosedBlock:
    """Return A_T = U_T · columns of a block, with its bounds; columns (size, count)."""
    merged: dict[int, Floats] = {}
    for number, place, coefficients in block.parts:
        part = coefficients @ columns[place.start : place.stop]
        merged[number] = merged[number] + part if number in merged else part
    parts = tuple(merged.items())
    rows = [family.rows[number] for number, _ in parts]
    together = np.concatenate([a for _, a in parts], axis=1)
    flat = together.transpose(1, 0, 2).reshape(together.shape[1], -1)
    largest = SAFETY * float(np.linalg.norm(flat, 2))
    difference = _exchange_difference(rows, [a for _, a in parts], block)
    exchanges = sum(len(place) * (len(place) - 1) // 2 for place in rows[0].places)
    assignments = sum(len(entry.assignments) for entry in rows)
    scale = (2 * family.sector.spin + 1) * block.tableaux
    asymmetry = exchanges * difference * (2 * largest + difference) * assignments / scale
    # |Aᵀφ| ≤ Σ_parts |A_partᵀ φ_part|, but columns of different parts may be different too, so
    # the norm of A as a whole is the better bound: at most `assignments` for |φ|².
    weights = sum(
        (SAFETY * _norm(a)) ** 2 * len(entry.assignments)
        for (_, a), entry in zip(parts, rows, strict=True)
    )
    trace = min(largest**2 * assignments, len(parts) * weights) / scale
    return EnclosedBlock(parts, largest, asymmetry * SAFETY, trace * SAFETY, scale)


def _exchange_difference(
    rows: Sequence[PermutedRows], parts: Sequence[Floats], block: AdaptedRows
) -> float:
    """Return a bound on the Frobenius norm of P A_T − Σ A_T' Y_{T'T}, over all exchanges."""
    names = tableau_contents(block.shapes)
    numbers = {name: number for number, name in enumerate(names)}
    places = rows[0].places
    worst = 0.0
    for joint in (joint for place in places for joint in place[:-1]):
        squared = 0.0
        for entry, a in zip(rows, parts, strict=True):
            exchange = entry.exchange(joint)
            rounding = exchange_error(entry) + sqrt(entry.ways) * gamma(entry.ways + 4)
            difference = exchange @ a
            for number, name in enumerate(names):
                goal, distance = neighbours(name, places)[joint]
                difference[number] -= a[number] / distance
                if abs(distance) > 1:
                    difference[number] -= sqrt(1 - 1 / distance**2) * a[numbers[goal]]
            size = float(np.linalg.norm(a))
            # An exchange has at most `ways` entries in a row.
            squared += (float(np.linalg.norm(difference)) + (rounding + 12 * UNIT) * size) ** 2
        worst = max(worst, sqrt(squared))
    return worst * SAFETY


def enclosed_sums(
    family: SectorBlocks, blocks: Sequence[EnclosedBlock], rotations: Floats
) -> tuple[Floats, Floats]:
    """Return Σ s(x) over blocks of one family, and bounds on the errors, (configurations,)."""
    count = len(rotations)
    wigner = wigner_matrices(rotations, family.largest_spin)
    orders = family.orders
    total, errors = np.zeros(count), np.zeros(count)
    off = [row_error(rows) for rows in family.rows]
    for order in orders:
        factors = joint_factors(wigner, order)
        plain = [plain_rows(rows, factors) for rows in family.rows]
        for block in blocks:
            squares, wrong = _block_sum(family, block, plain, off, count)
            weight = 1.0 / (len(orders) * block.scale)
            total += weight * squares
            errors += weight * wrong
    # Weights and sums of positive numbers over blocks and orders.
    return total, SAFETY * (errors + gamma(len(orders) * len(blocks) + 8) * total)


def _block_sum(
    family: SectorBlocks,
    block: EnclosedBlock,
    plain: Sequence[Floats],
    off: Sequence[float],
    count: int,
) -> tuple[Floats, Floats]:
    """Return Σ_T |A_Tᵀφ|² and a bound on its error, of one order."""
    components = plain[0].shape[2]
    found: Floats | None = None
    wrong = 0.0
    length = 0
    for number, a in block.parts:
        values = np.broadcast_to(
            plain[number], (len(plain[number]), count, components)
        ).reshape(len(plain[number]), -1)
        flat = a.transpose(0, 2, 1).reshape(-1, a.shape[1])
        part = flat @ values
        found = part if found is None else found + part
        size = SAFETY * float(np.linalg.norm(a))
        exact = sqrt(len(family.rows[number].assignments))
        wrong += size * exact * (off[number] + 1.1 * gamma(a.shape[1] + len(block.parts)))
        length += a.shape[1]
    if found is None:
        return np.zeros(count), np.zeros(count)
    squared = np.sum(found.reshape(-1, count, components) ** 2, axis=(0, 2))
    terms = found.shape[0] * components
    error = 2 * np.sqrt(squared) * wrong + wrong**2 + gamma(terms + 2) * squared
    return squared, SAFETY * error


def _norm(a: Floats) -> float:
    return float(np.linalg.norm(a.transpose(1, 0, 2).reshape(a.shape[1], -1), 2))
