"""Bounds on rounding of the values of plain rows φ, see `plain_rows` and `plain_values`.

In the standard model of floating point without underflow, γ_K = Ku/(1 − Ku) bounds the error of
sums of K products (Higham, 2002), u = 2⁻⁵³, or 2⁻⁶⁴ in extended precision. The exact values
have known norms: columns of D^l are unit vectors, and coupling is an isometry. A configuration
is a list of quaternions whose entries are doubles; its rotations R, shape (3, 3), are made in
extended precision.

- l, L, m: spin of a label, total spin, column of D^l, see `row_sectors`;
- C: a table of couplings ⟨l a, l' b | L c⟩, as a matrix from pairs (a, b) to c. |A| is the
  matrix of absolute values;
- u: the unit of rounding; `unit` in the code is that of the precision of a computation;
- assignment: the joints that carry the labels; coupling: one of the ways to couple them.

Nothing here has a unit of length. Bounds must not be made smaller without a new proof.
"""

from math import sqrt

from lockedjoint.formulations.bounds.moments.enclosed_matrix import EXTENDED_UNIT, UNIT, gamma
from lockedjoint.formulations.bounds.moments.plain_rows import PlainRows
from lockedjoint.formulations.bounds.moments.sampled_blocks import BlockFamily

# Bound on the error of D^1 in the Frobenius norm, in units of rounding. R is off by 3·16u; the
# spherical unit vectors are rounded, 2u on each side times the norm 1 of R; two complex
# products of 3×3 matrices, with absolute values of norm √3 each, are off by 2√2γ_4·3 each.
# Together that is below 120u.
_ERROR_OF_SPIN_1 = 120
# Factor for what errors do to errors: factors 1 + error, none above 1e-9, over fewer than 20
# steps.
_GROWTH = 1.0 + 1e-6


def wigner_error(spin: int, unit: float = UNIT) -> float:
    """Bound the error of a column of D^spin, as a vector, made from extended rotations.

    The result is rounded to a larger `unit` at the end, if that is u of double precision. A
    step from l to l + 1 computes Cᵀ(D^l
    ⊗ D^1)C with a table C that is off by two units. |C| has orthonormal columns as C has, of at
    most three entries, and |D^l ⊗ D^1| has a norm of at most √(2l + 1)√3.
    """
    if spin == 0:
        return 0.0
    error = _ERROR_OF_SPIN_1 * EXTENDED_UNIT
    for before in range(1, spin):
        # Two sums of 3 products, a complex product and two tables off by 2u make γ_16. Real and
        # imaginary parts taken together cost a factor √2 < 2.
        step = 2 * gamma(2 * 3 + 10, EXTENDED_UNIT) * sqrt(3 * (2 * before + 1))
        error += _ERROR_OF_SPIN_1 * EXTENDED_UNIT + step
    return (error + (unit if unit > EXTENDED_UNIT else 0.0)) * _GROWTH


def row_error(rows: PlainRows, unit: float = UNIT) -> float:
    """Bound the error of the plain rows of one assignment, in the Euclidean norm.

    The norm is over all couplings and components. The rows are made with a `unit` of rounding,
    and rounded to double precision at the end.

    The first step only multiplies by 1. Any other step couples a spin s to a spin l' before:
    complex products, then for each total spin a table |C| of norm 1, off by two units, whose
    sums have at most 2 min(l', s) + 1 products that are not 0.
    """
    error = sum(wigner_error(spin, unit) for spin in rows.spins[:1])
    largest_before = sum(rows.spins[:1])
    for spin in rows.spins[1:]:
        terms = 2 * min(largest_before, spin) + 1
        error += wigner_error(spin, unit)
        error += gamma(3, unit) + gamma(terms + 3, unit) * sqrt(terms)
        largest_before += spin
    return (error + (UNIT if unit < UNIT else 0.0)) * _GROWTH


def exchange_error(rows: PlainRows) -> float:
    """Bound the spectral norm of the error of `PlainRows.exchanged` for one assignment.

    The entries of its matrix are inner products of tensors of norm 1, whose entries are
    products of couplings. The components of all factors but that of the largest spin fix the
    latter.
    """
    # Nothing is reordered if no labels are equal: the matrix is a permutation.
    if all(len(set(labels)) == len(labels) for labels in rows.group_labels):
        return 0.0
    entries = 1
    for spin in sorted(rows.spins)[:-1]:
        entries *= 2 * spin + 1
    tensor = gamma(3 * len(rows.spins), EXTENDED_UNIT)
    inner = rows.couplings * (2 * tensor + gamma(entries + 2, EXTENDED_UNIT))
    return (inner + sqrt(rows.couplings) * gamma(rows.couplings + 4, EXTENDED_UNIT)) * _GROWTH


def unit_of(family: BlockFamily) -> float:
    """Return the unit of rounding u with which φ is made for a family of blocks.

    It is that of extended precision where there is one order of the joints; many orders would
    take too long.
    """
    return EXTENDED_UNIT if family.sector.odd is None else UNIT
