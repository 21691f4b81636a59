"""Rows of a block with multipliers: bounds on rounding, and on how far they are from invariant.

Standard model of floating point without underflow: γ_K = Ku/(1 − Ku) bounds the error of sums
of K products (Higham, 2002), u = 2⁻⁵³, or 2⁻⁶⁴ in extended precision. Exact values have norms
that are known: columns of D^l are unit vectors, and coupling is an isometry. A configuration is
a list of quaternions whose entries are doubles. Let A_T be the rounded U_T L. If it is off
Young's orthogonal form by E for an exchange of neighbours, |Eᵀφ| ≤ e, then a² = |Aᵀφ|² differs
from its average over permutations by at most ℓe(a + ℓe) (docs/bounds.md, section 3).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import frexp, sqrt

import numpy as np

from formulations.bounds.so3_moments.enclosed_matrix import (
    EXTENDED_UNIT,
    SAFETY,
    UNIT,
    gamma,
)
from formulations.bounds.so3_moments.sampled_blocks import RowBlocks
from formulations.bounds.so3_moments.symmetric_rows import AdaptedRows, PermutedRows
from formulations.bounds.so3_moments.tableaux import young_form, young_image
from nlp.arrays import FloatArray
from nlp.errors import LockedJointError

# Frobenius norm: 3 · 16u from R; the spherical unit vectors are rounded (2u on each side, times
# the norm 1 of R); two complex products of 3×3 matrices with absolute values of norm √3 each,
# 2√2γ_4 · 3 each. Below 120u.
_FIRST_SPIN = 120
# Growth of errors by factors 1 + error, none above 1e-9, over fewer than 20 steps.
_GROWTH = 1.0 + 1e-6


class NoExtendedPrecisionError(LockedJointError):
    """``numpy.longdouble`` has fewer than 64 significant bits here."""


def require_extended_precision() -> None:
    """Raise NoExtendedPrecisionError unless ``numpy.longdouble`` has 64 significant bits."""
    bits = np.finfo(np.longdouble).nmant + 1
    if bits < 64:
        raise NoExtendedPrecisionError(
            f"a rigorous bound needs extended precision: numpy.longdouble has {bits} "
            "significant bits on this machine, 64 are needed"
        )


def wigner_error(spin: int) -> float:
    """Bound the error of a column of D^spin, made from extended rotations.

    A step computes Cᵀ(D^l ⊗ D^1)C with a table C off by two units. |C| has orthonormal columns
    as C has, of at most three entries, and |D^l ⊗ D^1| a norm of at most √(2l+1)√3.
    """
    if spin == 0:
        return 0.0
    error = _FIRST_SPIN * EXTENDED_UNIT
    for before in range(1, spin):
        # Two sums of 3 products, one complex product, two tables off by 2u: real and
        # imaginary parts taken together cost a factor √2 < 2.
        step = 2 * gamma(2 * 3 + 10, EXTENDED_UNIT) * sqrt(3 * (2 * before + 1))
        error += _FIRST_SPIN * EXTENDED_UNIT + step
    return (error + UNIT) * _GROWTH


def row_error(rows: PermutedRows) -> float:
    """Bound the error, Euclidean norm, of the rows of one assignment, all ways and components.

    A step couples spins l' and s: complex products, then for each total spin a table |C| of
    norm 1, off by two units, whose sums have at most 2 min(l', s) + 1 products that are not 0.
    The first one only multiplies by 1.
    """
    error, reached = sum(map(wigner_error, rows.spins[:1])), sum(rows.spins[:1])
    for spin in rows.spins[1:]:
        terms = 2 * min(reached, spin) + 1
        error += wigner_error(spin) + gamma(3) + gamma(terms + 3) * sqrt(terms)
        reached += spin
    return error * _GROWTH


def exchange_error(rows: PermutedRows) -> float:
    """Bound the spectral norm of the error of `PermutedRows.exchanged` for one assignment.

    Its entries are inner products of tensors of norm 1, whose entries are products of
    couplings. The components of all factors but the longest fix that of the longest.
    """
    if all(len(set(part)) == len(part) for part in rows.parts):
        return 0.0  # nothing is reordered: a permutation matrix
    entries = 1
    for spin in sorted(rows.spins)[:-1]:
        entries *= 2 * spin + 1
    tensor = gamma(3 * len(rows.spins), EXTENDED_UNIT)
    inner = rows.ways * (2 * tensor + gamma(entries + 2, EXTENDED_UNIT))
    return (inner + sqrt(rows.ways) * gamma(rows.ways + 4, EXTENDED_UNIT)) * _GROWTH


@dataclass(frozen=True, eq=False)
class EnclosedBlock:
    """A block with other columns instead of its rows: A_T = U_T · columns."""

    #: Number of a set of labels and A_T there, shape (tableaux, plain rows, columns).
    parts: tuple[tuple[int, FloatArray], ...]
    #: Bits of coarse factors, see `block_values`.
    bits: int
    #: Bounds on ‖E‖ for each exchange and each set of labels of `parts`.
    differences: FloatArray
    #: Number ℓ of exchanges that make any permutation.
    exchanges: int
    #: (2L+1) · tableaux.
    scale: int

    @cached_property
    def coarse(self) -> tuple[FloatArray, ...]:
        """A_T of each part, (tableaux · columns, plain rows), on one grid of `bits` bits."""
        if not self.bits:
            return tuple(map(np.zeros_like, self._flat))
        largest = max(float(np.abs(a).max()) for a in self._flat)
        grid = 2.0 ** (frexp(largest)[1] - self.bits)
        return tuple(np.rint(a / grid) * grid for a in self._flat)

    @cached_property
    def fine(self) -> tuple[FloatArray, ...]:
        """What `coarse` leaves of A_T, exactly."""
        return tuple(a - grid for a, grid in zip(self._flat, self.coarse, strict=True))

    @cached_property
    def _flat(self) -> tuple[FloatArray, ...]:
        return tuple(a.transpose(0, 2, 1).reshape(-1, a.shape[1]) for _, a in self.parts)

    def step(self, plain_norms: FloatArray) -> FloatArray:
        """Return ℓe, (configurations,), from bounds on |φ| of each set of labels, (sets, …)."""
        used = plain_norms[[number for number, _ in self.parts]]
        largest = np.max(self.differences @ used, axis=0, initial=0.0)
        return np.asarray(SAFETY * self.exchanges * largest)


def enclosed_block(family: RowBlocks, block: AdaptedRows, columns: FloatArray) -> EnclosedBlock:
    """Return A_T = U_T · columns of a block, with its bounds; columns (size, count)."""
    merged: dict[int, FloatArray] = {}
    for number, place, coefficients in block.parts:
        part = coefficients @ columns[place.start : place.stop]
        merged[number] = merged[number] + part if number in merged else part
    parts = tuple((number, a) for number, a in merged.items() if a.any())
    places = family.sector.places(family.joints)
    form = young_form(block.shapes, places)
    neighbours = [joint for place in places for joint in place[:-1]]
    differences = np.zeros((len(neighbours), len(parts)))
    for row, joint in zip(differences, neighbours, strict=True):
        for column, (number, a) in enumerate(parts):
            entry = family.rows[number]
            # E = P A_T − Σ A_T' Y_{T'T}. An exchange has at most `ways` entries in a row.
            image = young_image(a.astype(np.longdouble), form[joint])
            difference = (entry.exchanged(joint, a) - image).astype(float)
            rounding = exchange_error(entry) + 12 * EXTENDED_UNIT
            size = float(np.linalg.norm(a))
            row[column] = float(np.linalg.norm(difference)) + rounding * size
    exchanges = sum(len(place) * (len(place) - 1) // 2 for place in places)
    scale = (2 * family.sector.spin + 1) * block.tableaux
    return EnclosedBlock(parts, _bits(family), differences * SAFETY, exchanges, scale)


def _bits(family: RowBlocks) -> int:
    """Return the bits of coarse factors: sums of products of two of them are exact.

    0, that is none, where many orders of the joints would take three times as long.
    """
    return (
        0
        if family.sector.odd
        else (52 - sum(rows.length for rows in family.rows).bit_length()) // 2
    )


def coarse_values(family: RowBlocks, plain: Sequence[FloatArray]) -> list[FloatArray]:
    """Return φ on a grid: its entries are at most 1 in size, as φ of an assignment is."""
    if not _bits(family):
        return list(plain)
    return [np.rint(values * 2.0 ** _bits(family)) / 2.0 ** _bits(family) for values in plain]


def plain_norms(family: RowBlocks, plain: Sequence[FloatArray]) -> FloatArray:
    """Return bounds on |φ| of each set of labels, (sets, configurations)."""
    count = max(values.shape[1] for values in plain)
    norms = [
        np.broadcast_to(np.sqrt(np.sum(values**2, axis=(0, 2))), count)
        + sqrt(len(rows.assignments)) * row_error(rows)
        for values, rows in zip(plain, family.rows, strict=True)
    ]
    return SAFETY * np.array(norms)


def product_error(family: RowBlocks, block: EnclosedBlock) -> tuple[float, FloatArray]:
    """Bound the Euclidean norm of the error of Aᵀφ for one order, see `block_values`.

    First what the errors of φ cause, and its part beside the grid; then factors for |φ| of each
    set of labels.
    """
    fixed, relative = 0.0, np.zeros(len(family.rows))
    components = 2 * (2 * family.sector.spin + 1)
    parts = zip(block.parts, block.coarse, block.fine, strict=True)
    for (number, a), coarse, fine in parts:
        rows = family.rows[number]
        # The sum of a product, then the products of all parts.
        products = gamma(a.shape[1] + 2 * len(block.parts))
        beside = sqrt(a.shape[1] * components) * 2.0 ** -(block.bits + 1)
        fixed += _norm(coarse + fine) * row_error(rows) * sqrt(len(rows.assignments))
        fixed += products * _norm(np.abs(coarse)) * beside
        relative[number] += 1.1 * products * _norm(np.abs(fine))
    return SAFETY * fixed, SAFETY * relative


def _norm(matrix: FloatArray) -> float:
    """Return the spectral norm of a matrix, rounded up."""
    square = matrix @ matrix.T if len(matrix) < matrix.shape[1] else matrix.T @ matrix
    return SAFETY * sqrt(max(float(np.linalg.eigvalsh(square)[-1]), 0.0))


def block_values(
    block: EnclosedBlock,
    plain: Sequence[FloatArray],
    coarse: Sequence[FloatArray],
    count: int,
) -> FloatArray:
    """Return A_Tᵀφ of one order, (tableaux · columns, configurations, components).

    With A and φ on grids their products and sums are exact; what is beside the grids is small,
    and so is its rounding. The last sum is rounded once. Without bits all is beside the grids.
    """
    exact, rest = np.zeros((1, 1)), np.zeros((1, 1))
    parts = zip(block.parts, block.coarse, block.fine, strict=True)
    for (number, _), grid, fine in parts:
        values = _flattened(plain[number], count)
        rest = rest + fine @ values
        if block.bits:
            gridded = _flattened(coarse[number], count)
            exact = exact + grid @ gridded
            rest = rest + grid @ (values - gridded)
    return (exact + rest).reshape(-1, count, plain[0].shape[2])


def _flattened(values: FloatArray, count: int) -> FloatArray:
    """Return plain rows, (rows, configurations · components); those of no joint repeated."""
    if values.shape[1] < count:
        values = np.tile(values, (1, count, 1))
    return values.reshape(len(values), -1)
