"""A-priori bounds on the rounding errors of Wigner functions and plain rows.

Standard model of double precision: every operation has a relative error of at most u = 2⁻⁵³,
and sums of K products, in any order, one of at most γ_K = Ku/(1 − Ku) relative to the sum
of the absolute values (Higham, 2002). Exact values have norms that are known: columns of D^l
are unit vectors, and coupling is an isometry; that keeps the bounds small.

A configuration is a list of quaternions whose entries are doubles; its rotations are those of
the exactly normalised quaternions.
"""

from math import sqrt

from formulations.bounds.so3_moments.representations.permuted_rows import PermutedRows

UNIT = 2.0**-53
# Entries of a rotation: numerator and denominator have 4 products and 3 sums each, relative
# to |q|²; then one division. Below 16u.
ROTATION_ENTRY = 16 * UNIT
# Frobenius norm: 3 · 16u from R; the spherical unit vectors are rounded (2u on each side, times
# the norm 1 of R); two complex products of 3×3 matrices with absolute values of norm √3 each,
# 2√2γ_4 · 3 each. Below 120u.
_FIRST_SPIN = 120 * UNIT
# Growth of errors by factors 1 + error, none above 1e-9, over fewer than 20 steps.
_GROWTH = 1.0 + 1e-6


def gamma(operations: int) -> float:
    """Return γ_K."""
    product = operations * UNIT
    return product / (1.0 - product)


def wigner_error(spin: int) -> float:
    """Return a bound on the spectral norm of the error of D^spin.

    One step from l to l + 1 computes Cᵀ(D^l ⊗ D^1)C with a table C of couplings whose entries
    are off by two units in the last place. A row of C has one entry that is not 0, since the
    components add up, so |C| has orthonormal columns as C has; a column has at most three. The
    absolute values of D^l ⊗ D^1 have a norm of at most √(2l+1)√3.
    """
    if spin == 0:
        return 0.0
    error = _FIRST_SPIN
    for before in range(1, spin):
        # Two sums of 3 products, one complex product, two tables off by 2u: real and
        # imaginary parts taken together cost a factor √2 < 2.
        error += _FIRST_SPIN + 2 * gamma(2 * 3 + 10) * sqrt(3 * (2 * before + 1))
    return error * _GROWTH


def row_error(rows: PermutedRows) -> float:
    """Return a bound on the error of the rows of one assignment, all ways and components.

    It is the Euclidean norm of the error of a vector whose exact norm is at most 1. A step
    couples spins l' and s: a sum has at most 2 min(l', s) + 1 products that are not 0, and
    there are as many possible total spins, each with a table |C| of norm 1.
    """
    error, reached = 0.0, 0
    for spin in rows.spins:
        terms = 2 * min(reached, spin) + 1
        error += wigner_error(spin) + 2 * gamma(terms + 10) * sqrt(terms)
        reached += spin
    return error * _GROWTH


def exchange_error(rows: PermutedRows) -> float:
    """Return a bound on the Frobenius norm of the error of an exchange for one assignment.

    It is a matrix of inner products of tensors of norm 1, (ways, ways). An entry of a tensor
    with p factors is a single product of p − 1 couplings, since the components fix the
    intermediate ones; each coupling is off by two units. The components of all factors but the
    longest fix that of the longest.
    """
    if all(len(set(part)) == len(part) for part in rows.parts):
        return 0.0  # nothing is reordered: a permutation matrix
    entries = 1
    for spin in sorted(rows.spins)[:-1]:
        entries *= 2 * spin + 1
    tensor = gamma(3 * len(rows.spins))
    return rows.ways * (2 * tensor + gamma(entries + 2)) * _GROWTH
