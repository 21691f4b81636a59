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
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from lockedjoint.formulations.bounds.so3_moments.enclosed_matrix import (
    EXTENDED_UNIT,
    SAFETY,
    UNIT,
    gamma,
    on_grid,
    operations,
    rounded_once,
    short_sums,
    spectral_norm,
)
from lockedjoint.formulations.bounds.so3_moments.sampled_blocks import RowBlocks
from lockedjoint.formulations.bounds.so3_moments.symmetric_rows import AdaptedRows, PermutedRows
from lockedjoint.formulations.bounds.so3_moments.tableaux import (
    first_tableau,
    young_form,
    young_image,
)
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import LockedJointError

# Frobenius norm: 3 · 16u from R; the spherical unit vectors are rounded (2u on each side, times
# the norm 1 of R); two complex products of 3×3 matrices with absolute values of norm √3 each,
# 2√2γ_4 · 3 each. Below 120u.
_FIRST_SPIN = 120
# Products are added up in sums of so many terms, for so many configurations at once.
_TERMS, _FEW_TERMS, _AT_ONCE = 32, 8, 64
# Columns that are nearer to dependent stay as they are.
_LEAST_PIVOT = 1e-6
# Multipliers from which rounding counts.
_LARGE = 100.0
# Growth of errors by factors 1 + error, none above 1e-9, over fewer than 20 steps.
_GROWTH = 1.0 + 1e-6


class NoExtendedPrecisionError(LockedJointError):
    """``numpy.longdouble`` has fewer than 64 significant bits here."""


def require_extended_precision() -> None:
    """Raise NoExtendedPrecisionError unless ``numpy.longdouble`` has 64 significant bits.

    That is tried, in sums and in products: libraries of others can set the processor to fewer.
    Every process that computes with it has to ask, since each has a setting of its own.
    """
    one = np.ones(4, dtype=np.longdouble)
    above = one + np.ldexp(one, -63)
    sums = above != one
    # (1 + 2⁻³²)(1 + 2⁻³¹) has a last bit, 2⁻⁶³, that is lost with fewer than 64.
    products = (one + np.ldexp(one, -32)) * (one + np.ldexp(one, -31))
    rest = products - one - np.ldexp(one, -31) - np.ldexp(one, -32)
    if not (sums.all() and np.all(rest == np.ldexp(one, -63))):
        raise NoExtendedPrecisionError(
            "a rigorous bound needs extended precision: numpy.longdouble does not compute with "
            "64 significant bits here"
        )


def wigner_error(spin: int, unit: float = UNIT) -> float:
    """Bound the error of a column of D^spin, made from extended rotations; perhaps rounded.

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
    return (error + (unit if unit > EXTENDED_UNIT else 0.0)) * _GROWTH


def row_error(rows: PermutedRows, unit: float = UNIT) -> float:
    """Bound the error, Euclidean norm, of the rows of one assignment, all ways and components.

    They are made with this unit of rounding, and rounded at the end.

    A step couples spins l' and s: complex products, then for each total spin a table |C| of
    norm 1, off by two units, whose sums have at most 2 min(l', s) + 1 products that are not 0.
    The first one only multiplies by 1.
    """
    error = sum(wigner_error(spin, unit) for spin in rows.spins[:1])
    reached = sum(rows.spins[:1])
    for spin in rows.spins[1:]:
        terms = 2 * min(reached, spin) + 1
        error += wigner_error(spin, unit)
        error += gamma(3, unit) + gamma(terms + 3, unit) * sqrt(terms)
        reached += spin
    return (error + (UNIT if unit < UNIT else 0.0)) * _GROWTH


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
    """A block times multipliers: A_T = U_T L for each vector, and r = Lᵀ(U_Tᵀφ)."""

    #: Number of a set of labels, its columns of the block, and U_Tᵀ there, shape (tableaux ·
    #: columns, plain rows).
    parts: tuple[tuple[int, slice, FloatArray], ...]
    #: The vectors that occur, and L of each, shape (vectors, size, columns).
    powers: NDArray[np.intp]
    factors: FloatArray
    #: Bounds on ‖E‖ for each vector, exchange and part.
    differences: FloatArray
    #: Number ℓ of exchanges that make any permutation.
    exchanges: int
    #: Of Aᵀφ: bounds on errors that φ of each part causes, (vectors, parts), times |φ|; and
    #: what is caused besides, (vectors,).
    relative: FloatArray
    fixed: FloatArray
    #: ‖U‖ of each part, times what bounds the rounding of Lᵀ by |Uᵀφ|, (vectors, parts).
    last: FloatArray
    tableaux: int
    #: Of the grids on which products with U are exact, see `_bits`.
    bits: int

    def steps(self, norms: FloatArray) -> FloatArray:
        """Return ℓe, (vectors, configurations), from bounds on |φ| of each set of labels."""
        largest = np.max(self.differences @ self._used(norms), axis=1, initial=0.0)
        return np.asarray(SAFETY * self.exchanges * largest)

    def mistakes(self, norms: FloatArray) -> FloatArray:
        """Return bounds on the errors of r, (vectors, configurations)."""
        used = self._used(norms)
        last = np.sqrt(self.last**2 @ used**2)
        return np.asarray(SAFETY * (self.fixed[:, None] + self.relative @ used + last))

    def _used(self, norms: FloatArray) -> FloatArray:
        return norms[[number for number, _, _ in self.parts]]


def enclosed_block(family: RowBlocks, block: AdaptedRows, root: FloatArray) -> EnclosedBlock:
    """Return what multiplies the rows of a block, with its bounds.

    `root` has a row for each of the family's `selection` from the block.
    """
    chosen, which = family.selection(block)
    powers = np.unique(which[root.any(axis=1)])
    factors = np.zeros((len(powers), block.size, root.shape[1]))
    for own, power in zip(factors, powers, strict=True):
        own[chosen[which == power]] = root[which == power]
    parts, factors = _orthonormal(block, factors)
    places = family.sector.places(family.joints)
    sizes = np.array([[spectral_norm(own[place]) for _, place, _ in parts] for own in factors])
    sizes = sizes.reshape(len(powers), len(parts))
    covered = np.zeros(block.size, dtype=int)
    for _, place, _ in parts:
        covered[place] += 1
    together = int(covered.max(initial=1))  # parts that are added up
    fixed, relative, norms = np.zeros((3, len(parts)))
    bits, components = _bits(family, factors), 2 * (2 * family.sector.spin + 1)
    for part, (number, _, basis) in enumerate(parts):
        rows, flat = family.rows[number], _flat(basis)
        norms[part] = spectral_norm(flat)
        fixed[part] = (
            norms[part] * row_error(rows, unit_of(family)) * sqrt(len(rows.assignments))
        )
        if bits:
            grid = on_grid(flat, bits)
            products = gamma(rows.length + 2)
            beside = 2.0 ** -(bits + 1) * sqrt(rows.length * components)
            fixed[part] += products * spectral_norm(np.abs(grid)) * beside
            relative[part] = products * spectral_norm(np.abs(flat - grid))
            relative[part] += 1.1 * gamma(1 + together) * norms[part]
        else:
            terms = operations(rows.length, _TERMS) + together
            relative[part] = gamma(terms) * spectral_norm(np.abs(flat))
    last = gamma(operations(block.size, _terms(bits)))
    rounding = [last * spectral_norm(np.abs(own)) for own in factors]
    return EnclosedBlock(
        parts=tuple((number, place, _flat(basis)) for number, place, basis in parts),
        powers=powers,
        factors=factors,
        differences=SAFETY * _differences(family, block, parts, factors, sizes),
        exchanges=sum(len(place) * (len(place) - 1) // 2 for place in places),
        relative=SAFETY * sizes * relative,
        fixed=SAFETY * sizes @ fixed,
        # |Uᵀφ|² ≤ Σ |U_sᵀφ_s|² times the number of parts that share a column, rounded.
        last=1.1 * sqrt(together) * np.outer(rounding, norms),
        tableaux=block.tableaux,
        bits=bits,
    )


def _orthonormal(
    block: AdaptedRows, factors: FloatArray
) -> tuple[list[tuple[int, slice, FloatArray]], FloatArray]:
    """Return U R⁻¹ of the parts that are of use, with nearly orthonormal columns, and R L.

    Whatever R is and however this is rounded, what it gives is what is enclosed.
    """
    factors, found = factors.copy(), []
    for place in dict.fromkeys(place for _, place, _ in block.parts):
        here = slice(place.start, place.stop)
        own = [(number, basis) for number, at, basis in block.parts if at == place]
        if not factors[:, here].any():
            continue
        first = np.vstack([basis[first_tableau(block.shapes)] for _, basis in own])
        triangle = np.linalg.qr(first, mode="r")
        scales = np.abs(np.diag(triangle))
        if len(triangle) == len(place) and scales.min() > _LEAST_PIVOT * scales.max():
            own = [(number, basis @ np.linalg.inv(triangle)) for number, basis in own]
            factors[:, here] = triangle @ factors[:, here]
        found += [(number, here, basis) for number, basis in own]
    return found, factors


def _differences(
    family: RowBlocks,
    block: AdaptedRows,
    parts: Sequence[tuple[int, slice, FloatArray]],
    factors: FloatArray,
    sizes: FloatArray,
) -> FloatArray:
    """Return bounds on ‖E‖ for each of the factors, each exchange and each part."""
    places = family.sector.places(family.joints)
    form = young_form(block.shapes, places)
    neighbours = [joint for place in places for joint in place[:-1]]
    found = np.zeros((len(factors), len(neighbours), len(parts)))
    for part, (number, place, basis) in enumerate(parts):
        entry, size = family.rows[number], float(np.linalg.norm(basis))
        rounding = (exchange_error(entry) + 12 * EXTENDED_UNIT) * size
        for row, joint in enumerate(neighbours):
            # E = (P U_T − Σ U_T' Y_{T'T}) L. An exchange has at most `ways` entries in a row.
            image = young_image(basis.astype(np.longdouble), form[joint])
            difference = (entry.exchanged(joint, basis) - image).astype(float)
            for own, factor in enumerate(factors):
                own_rows, off = factor[place], np.linalg.norm(difference)
                largest = np.linalg.norm(difference @ own_rows)
                largest += gamma(len(own_rows)) * off * np.linalg.norm(own_rows)
                found[own, row, part] = largest + rounding * sizes[own, part]
    return found


def plain_norms(family: RowBlocks, plain: Sequence[FloatArray]) -> FloatArray:
    """Return bounds on |φ| of each set of labels, (sets, configurations)."""
    count = max(values.shape[2] for values in plain)
    norms = [
        np.broadcast_to(np.sqrt(np.sum(values**2, axis=(0, 1))), count)
        + sqrt(len(rows.assignments)) * row_error(rows, unit_of(family))
        for values, rows in zip(plain, family.rows, strict=True)
    ]
    return SAFETY * np.array(norms)


def _flat(basis: FloatArray) -> FloatArray:
    """Return U_Tᵀ, (tableaux · columns, plain rows)."""
    return basis.transpose(0, 2, 1).reshape(-1, basis.shape[1])


def grouped(plain: Sequence[FloatArray], count: int) -> list[list[FloatArray]]:
    """Return plain rows of some configurations after the other, (rows, components · some).

    Those of no joint are the same at all configurations.
    """
    groups = []
    for first in range(0, count, _AT_ONCE):
        some = min(_AT_ONCE, count - first)
        groups.append(
            [
                np.repeat(values[..., 0], some, axis=1)
                if values.shape[2] < count
                else values[:, :, first : first + some].reshape(len(values), -1)
                for values in plain
            ]
        )
    return groups


def block_values(
    block: EnclosedBlock, plain: Sequence[FloatArray], components: int
) -> FloatArray:
    """Return r of one group, (vectors, tableaux · columns, components, configurations)."""
    vectors, size, _ = block.factors.shape
    width = plain[0].shape[1]
    rows = np.zeros((block.tableaux, size, width))
    for number, place, basis in block.parts:
        own = (
            rounded_once(basis, plain[number], block.bits)
            if block.bits
            else short_sums(basis, plain[number], _TERMS)
        )
        rows[:, place] += own.reshape(block.tableaux, -1, width)
    values = short_sums(block.factors.transpose(0, 2, 1)[:, None], rows, _terms(block.bits))
    return values.reshape(vectors, -1, components, width // components)


def _terms(bits: int) -> int:
    return _FEW_TERMS if bits else _TERMS


def unit_of(family: RowBlocks) -> float:
    """Return the unit of rounding with which φ is made.

    The smaller one where there is one order of the joints: many would take too long.
    """
    return EXTENDED_UNIT if family.sector.odd is None else UNIT


def _bits(family: RowBlocks, factors: FloatArray) -> int:
    """Return the bits of grids on which sums of products of U and φ are exact.

    0, that is none, where many orders of the joints would take three times as long, and where
    errors are small as L is.
    """
    if unit_of(family) == UNIT or np.linalg.norm(factors) < _LARGE:
        return 0
    return (52 - sum(rows.length for rows in family.rows).bit_length()) // 2
