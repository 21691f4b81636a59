"""A block of rows times multipliers; bounds on rounding and on the distance from invariance.

Each word is defined in the module that is named here:

- sector: `row_sectors`; products of n Wigner functions with one behaviour under symmetries;
- label set: `row_sectors`; the labels (l, m) of such products, for each group of joints;
- plain row, φ: `plain_rows`; one coupled product; φ holds the values of the plain rows of one
  label set at a configuration;
- tableau: `tableaux`; one of the standard tableaux T of a block's symmetry;
- w_a: `sampled_blocks`; a vector on which a condition H acts; one vector if there is none.

Let U_T, shape (plain rows, size), be the coefficients of a block's rows for tableau T, and L,
shape (size, columns), a factor of the multiplier LLᵀ. The squares of the block are |Aᵀφ|² with
A_T = U_T L. U stands for all U_T together, ‖·‖ for a spectral norm and |A| of a matrix for that
of absolute values. φ has the shape (plain rows, 2(2L + 1) components) at a configuration, where
L is the total spin; `row_rounding` bounds its rounding. A part is what one label set
contributes. K is the number of products in a sum, and γ_K bounds their rounding, see
`enclosed_matrix`.

*Invariance.* The rounded A obeys Young's orthogonal form for an exchange of neighbours up to a
matrix E with |Eᵀφ| ≤ e. Then a² = |Aᵀφ|² differs from its average over permutations by at most
ℓe(a + ℓe), where ℓ exchanges make any permutation (docs/bounds.md, section 3).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lockedjoint.formulations.bounds.moments.enclosed_matrix import (
    EXTENDED_UNIT,
    SAFETY,
    UNIT,
    gamma,
    on_grid,
    operations,
    spectral_norm,
)
from lockedjoint.formulations.bounds.moments.row_rounding import (
    exchange_error,
    row_error,
    unit_of,
)
from lockedjoint.formulations.bounds.moments.sampled_blocks import BlockFamily
from lockedjoint.formulations.bounds.moments.symmetric_rows import AdaptedRows
from lockedjoint.formulations.bounds.moments.tableaux import (
    first_tableau,
    young_form,
    young_image,
)
from lockedjoint.nlp.arrays import FloatArray

#: Number of products in a sum; such sums are added up. A smaller number loses fewer digits, and
#: takes more time. Any number is correct, as are those of the next three constants.
TERMS = 32
# The same number where products with U are exact, and what follows is to lose little.
_FEW_TERMS = 8
# Smallest pivot of a basis, relative to the largest, with which it is made orthonormal.
_LEAST_PIVOT = 1e-6
# Frobenius norm of multipliers L from which products with U are made exact by grids.
_LARGE_MULTIPLIERS = 100.0
# Bound on a norm of rounded values of Uᵀφ, relative to ‖U‖|φ|. It is generous: their relative
# rounding is below 1e-6.
_ROUNDED_NORM = 1.1
# Bits of a sum that are exact in double precision: its 53 bits less one.
_EXACT_BITS = 52
# Rounding of an exchange of neighbours less its Young image, in units of extended precision,
# relative to the norm of the basis. Each term of the image takes at most six operations, and
# the terms have a norm of at most √2; one more operation rounds the exchanged rows.
_IMAGE_OPERATIONS = 12


class EnclosedPart(NamedTuple):
    """What a label set contributes to the rows of a block, as in `BlockPart`.

    Attributes
    ----------
    label_set
        Number of the label set in the sector.
    columns
        Which rows of the block it contributes to.
    basis
        U_Tᵀ, shape (tableaux · columns, plain rows).
    """

    label_set: int
    columns: slice
    basis: FloatArray


class _PartErrors(NamedTuple):
    """Bounds on the errors of Uᵀφ that each part of a block causes, each of shape (parts,).

    Attributes
    ----------
    norms
        Bounds on ‖U‖, of all tableaux together.
    fixed
        Bounds on the errors that do not grow with |φ|.
    relative
        Bounds on the other errors, divided by |φ|.
    """

    norms: FloatArray
    fixed: FloatArray
    relative: FloatArray


@dataclass(frozen=True, eq=False)
class EnclosedBlock:
    """A block times multipliers, A_T = U_T L for each vector w_a, with what bounds its errors.

    The values are r = Lᵀ(U_Tᵀφ). Norms of r are over tableaux, columns of L and components.

    Attributes
    ----------
    parts
        The contributions of the label sets.
    vectors
        The numbers a of the vectors that occur, shape (vectors,).
    factors
        L of each vector, shape (vectors, size, columns).
    differences
        Bounds on ‖E‖ for each vector, exchange and part, shape (vectors, exchanges, parts).
    exchanges
        Number ℓ of exchanges that make any permutation.
    relative
        Bounds on the errors of r that each part causes, divided by its |φ|, shape (vectors,
        parts).
    fixed
        Bounds on the other errors of r, shape (vectors,).
    last
        Bounds on what the product with Lᵀ adds for each part, divided by |φ|, shape (vectors,
        parts). These add up as squares.
    tableaux
        Number of tableaux.
    bits
        Bits of the grids on which products with U are exact, see `_grid_bits`.
    """

    parts: tuple[EnclosedPart, ...]
    vectors: NDArray[np.intp]
    factors: FloatArray
    differences: FloatArray
    exchanges: int
    relative: FloatArray
    fixed: FloatArray
    last: FloatArray
    tableaux: int
    bits: int

    def steps(self, norms: FloatArray) -> FloatArray:
        """Return ℓe, shape (vectors, configurations).

        `norms` are bounds on |φ| of each label set, shape (label sets, configurations).
        """
        largest = np.max(self.differences @ self._of_parts(norms), axis=1, initial=0.0)
        return np.asarray(SAFETY * self.exchanges * largest)

    def mistakes(self, norms: FloatArray) -> FloatArray:
        """Return bounds on |error of r|, (vectors, configurations), from the same `norms`."""
        part_norms = self._of_parts(norms)
        last = np.sqrt(self.last**2 @ part_norms**2)
        return np.asarray(SAFETY * (self.fixed[:, None] + self.relative @ part_norms + last))

    def _of_parts(self, norms: FloatArray) -> FloatArray:
        """Return |φ| of each part, (parts, configurations), from that of each label set."""
        return norms[[part.label_set for part in self.parts]]


def enclosed_block(
    family: BlockFamily, block: AdaptedRows, factor: FloatArray
) -> EnclosedBlock:
    """Return a block times multipliers, with its bounds.

    `factor` is L, shape (selected rows, columns). It has a row for each of the rows that the
    family's `selection` lists, which are pairs of a scalar row and a vector w_a.
    """
    selected = family.selection(block)
    vectors = np.unique(selected.vectors[factor.any(axis=1)])
    factors = np.zeros((len(vectors), block.size, factor.shape[1]))
    for scalar_rows, vector in zip(factors, vectors, strict=True):
        here = selected.vectors == vector
        scalar_rows[selected.rows[here]] = factor[here]
    bases, factors = _orthonormal(block, factors)
    groups = family.sector.groups(family.joints)
    # ‖L‖ on the columns of each part.
    sizes = np.array([[spectral_norm(one[part.columns]) for part in bases] for one in factors])
    sizes = sizes.reshape(len(vectors), len(bases))
    covered = np.zeros(block.size, dtype=int)
    for part in bases:
        covered[part.columns] += 1
    # This is the largest number of parts that share a column.
    added_up = int(covered.max(initial=1))
    bits = _grid_bits(family, factors)
    errors = _part_errors(family, bases, bits, added_up)
    # Lᵀ(Uᵀφ) is a sum of `block.size` products, each rounded relative to |L||Uᵀφ|.
    last = gamma(operations(block.size, terms_of(bits)))
    rounding = [last * spectral_norm(np.abs(one)) for one in factors]
    return EnclosedBlock(
        parts=tuple(part._replace(basis=_transposed(part.basis)) for part in bases),
        vectors=vectors,
        factors=factors,
        differences=SAFETY * _differences(family, block, bases, factors, sizes),
        exchanges=sum(len(group) * (len(group) - 1) // 2 for group in groups),
        relative=SAFETY * sizes * errors.relative,
        fixed=SAFETY * sizes @ errors.fixed,
        # |Uᵀφ|² is at most the number of parts that share a column times Σ |U_pᵀφ_p|², p a
        # part.
        last=_ROUNDED_NORM * sqrt(added_up) * np.outer(rounding, errors.norms),
        tableaux=block.tableaux,
        bits=bits,
    )


def _part_errors(
    family: BlockFamily, parts: Sequence[EnclosedPart], bits: int, added_up: int
) -> _PartErrors:
    """Bound the errors of Uᵀφ for each part, as docs/bounds.md, section 3, lists them.

    With `bits` > 0, U = U_1 + U_2 and φ = φ_1 + φ_2, the first of each on a grid, so that
    U_1ᵀφ_1 is exact. `added_up` is the largest number of parts that share a column.
    """
    # A row has 2L + 1 components, each of a real and an imaginary part.
    components = 2 * (2 * family.sector.spin + 1)
    norms, fixed, relative = np.zeros((3, len(parts)))
    for number, part in enumerate(parts):
        rows, basis = family.rows[part.label_set], _transposed(part.basis)
        norms[number] = spectral_norm(basis)
        # |Uᵀ(φ − exact φ)| ≤ ‖U‖ ε √a: each of the a assignments has rows that are off by ε.
        error = row_error(rows, unit_of(family))
        fixed[number] = norms[number] * error * sqrt(len(rows.assignments))
        if bits:
            # |fl(U_1ᵀφ_2 + U_2ᵀφ) − exact| ≤ γ_{K+2} (‖|U_1|‖ |φ_2| + ‖|U_2|‖ |φ|): an entry
            # takes K products, one difference from the grid, and the sum of the two terms.
            grid = on_grid(basis, bits)
            products = gamma(rows.length + 2)
            # |φ_2| is at most this: every number is off its grid by at most half a step, 2^−b.
            off_grid = 2.0 ** -(bits + 1) * sqrt(rows.length * components)
            fixed[number] += products * spectral_norm(np.abs(grid)) * off_grid
            relative[number] = products * spectral_norm(np.abs(basis - grid))
            # γ_{1+s} |Uᵀφ|: U_1ᵀφ_1 and the rest are added, and then s parts.
            relative[number] += _ROUNDED_NORM * gamma(1 + added_up) * norms[number]
        else:
            # γ_{k+s} ‖|U|‖ |φ|: k operations make short sums of K products, and s parts are
            # added up.
            terms = operations(rows.length, TERMS) + added_up
            relative[number] = gamma(terms) * spectral_norm(np.abs(basis))
    return _PartErrors(norms, fixed, relative)


def _orthonormal(
    block: AdaptedRows, factors: FloatArray
) -> tuple[list[EnclosedPart], FloatArray]:
    """Return U R⁻¹ and R L, with nearly orthonormal columns of U R⁻¹, of the parts with L ≠ 0.

    A basis has the shape (tableaux, plain rows, columns) here, `factors` the shape (vectors,
    size, columns of L). R is the triangle of the QR factorisation of the first tableau's U.
    Whatever R is, and however the products are rounded, the squares that they give are
    enclosed.
    """
    factors, parts = factors.copy(), []
    for columns in dict.fromkeys(part.columns for part in block.parts):
        here = slice(columns.start, columns.stop)
        if not factors[:, here].any():
            continue
        sets = [part.label_set for part in block.parts if part.columns == columns]
        bases = [part.coefficients for part in block.parts if part.columns == columns]
        first = np.vstack([basis[first_tableau(block.shapes)] for basis in bases])
        triangle = np.linalg.qr(first, mode="r")
        pivots = np.abs(np.diag(triangle))
        if len(triangle) == len(columns) and pivots.min() > _LEAST_PIVOT * pivots.max():
            bases = [basis @ np.linalg.inv(triangle) for basis in bases]
            factors[:, here] = triangle @ factors[:, here]
        parts += [
            EnclosedPart(*one) for one in zip(sets, [here] * len(sets), bases, strict=True)
        ]
    return parts, factors


def _differences(
    family: BlockFamily,
    block: AdaptedRows,
    parts: Sequence[EnclosedPart],
    factors: FloatArray,
    sizes: FloatArray,
) -> FloatArray:
    """Return bounds on ‖E‖, shape (vectors, exchanges, parts).

    `factors` are the L, shape (vectors, size, columns), `sizes` their norms ‖L‖ on the rows of
    each part, shape (vectors, parts). For an exchange P of neighbours E = (P U_T − Σ_T' U_T'
    Y_{T'T}) L, with Young's form Y.
    """
    groups = family.sector.groups(family.joints)
    form = young_form(block.shapes, groups)
    neighbours = [joint for group in groups for joint in group[:-1]]
    bounds = np.zeros((len(factors), len(neighbours), len(parts)))
    for number, part in enumerate(parts):
        rows, norm = family.rows[part.label_set], float(np.linalg.norm(part.basis))
        # A row of the exchange has at most `couplings` entries that are not 0.
        rounding = (exchange_error(rows) + _IMAGE_OPERATIONS * EXTENDED_UNIT) * norm
        for place, joint in enumerate(neighbours):
            image = young_image(part.basis.astype(np.longdouble), form[joint])
            difference = (rows.exchanged(joint, part.basis) - image).astype(float)
            difference_norm = np.linalg.norm(difference)
            for k, factor in enumerate(factors):
                multipliers = factor[part.columns]
                bound = np.linalg.norm(difference @ multipliers)
                product_rounding = gamma(len(multipliers)) * difference_norm
                bound += product_rounding * np.linalg.norm(multipliers)
                bounds[k, place, number] = bound + rounding * sizes[k, number]
    return bounds


def _transposed(basis: FloatArray) -> FloatArray:
    """Return U_Tᵀ, (tableaux · columns, plain rows), of (tableaux, plain rows, columns)."""
    return basis.transpose(0, 2, 1).reshape(-1, basis.shape[1])


def terms_of(bits: int) -> int:
    """Return the number of products in a sum, by the bits of the grids."""
    return _FEW_TERMS if bits else TERMS


def _grid_bits(family: BlockFamily, factors: FloatArray) -> int:
    """Return the bits b of grids on which sums of products of U and φ are exact.

    `factors` are the L, shape (vectors, size, columns). There are no grids, 0 bits, where many
    orders of the joints would take three times as long, and where errors are small because L
    is.
    """
    if unit_of(family) == UNIT or np.linalg.norm(factors) < _LARGE_MULTIPLIERS:
        return 0
    # Products of two numbers of b bits have 2b bits, and a sum of K of them bit_length(K) more.
    terms = sum(rows.length for rows in family.rows)
    return (_EXACT_BITS - terms.bit_length()) // 2
