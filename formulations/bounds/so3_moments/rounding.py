"""A-priori bounds on the rounding errors of Wigner functions and plain rows.

Standard model of floating point without underflow: every operation has a relative error of at
most u, and sums of K products, in any order, one of at most γ_K = Ku/(1 − Ku) relative to the
sum of the absolute values (Higham, 2002); u = 2⁻⁵³ in double precision, 2⁻⁶⁴ or less in
extended precision. A complex product has one of at most √5 u. Exact values have norms that are
known: columns of D^l are unit vectors, and coupling is an isometry; that keeps the bounds
small.

A configuration is a list of quaternions whose entries are doubles; its rotations are those of
the exactly normalised quaternions.
"""

from math import sqrt

import numpy as np

from formulations.bounds.so3_moments.symmetric_rows import PermutedRows
from nlp.errors import LockedJointError

UNIT = 2.0**-53
EXTENDED_UNIT = 2.0**-64
# Entries of a rotation: numerator and denominator have 4 products and 3 sums each, relative
# to |q|²; then one division. Below 16u.
ROTATION_ENTRY = 16
# Frobenius norm: 3 · 16u from R; the spherical unit vectors are rounded (2u on each side, times
# the norm 1 of R); two complex products of 3×3 matrices with absolute values of norm √3 each,
# 2√2γ_4 · 3 each. Below 120u.
_FIRST_SPIN = 120
# Growth of errors by factors 1 + error, none above 1e-9, over fewer than 20 steps.
_GROWTH = 1.0 + 1e-6


class NoExtendedPrecisionError(LockedJointError):
    """``numpy.longdouble`` has fewer than 64 significant bits here."""

    def __init__(self) -> None:
        bits = np.finfo(np.longdouble).nmant + 1
        super().__init__(
            f"a rigorous bound needs extended precision: numpy.longdouble has {bits} "
            "significant bits on this machine, 64 are needed"
        )


def require_extended_precision() -> None:
    """Raise NoExtendedPrecisionError unless ``numpy.longdouble`` has 64 significant bits."""
    if np.finfo(np.longdouble).nmant < 63:
        raise NoExtendedPrecisionError


def gamma(operations: int, unit: float = UNIT) -> float:
    """Return γ_K."""
    product = operations * unit
    return product / (1.0 - product)


def wigner_error(spin: int) -> float:
    """Bound the error of a column of D^spin, made from extended rotations.

    One step from l to l + 1 computes Cᵀ(D^l ⊗ D^1)C with a table C of couplings whose entries
    are off by two units in the last place. A row of C has one entry that is not 0, since the
    components add up, so |C| has orthonormal columns as C has; a column has at most three. The
    absolute values of D^l ⊗ D^1 have a norm of at most √(2l+1)√3. At the end every entry, of a
    unit vector, is rounded to double.
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
    """Bound the error of the rows of one assignment, all ways and components.

    It is the Euclidean norm of the error of a vector whose exact norm is at most 1. A step
    couples spins l' and s: complex products, then for each possible total spin a table |C| of
    norm 1, off by two units, whose sums have at most 2 min(l', s) + 1 products that are not 0.
    """
    error, reached = 0.0, 0
    for spin in rows.spins:
        terms = 2 * min(reached, spin) + 1
        error += wigner_error(spin) + gamma(3) + gamma(terms + 3) * sqrt(terms)
        reached += spin
    return error * _GROWTH


def exchange_error(rows: PermutedRows) -> float:
    """Bound the spectral norm of the error of an exchange for one assignment.

    It is a matrix of inner products of tensors of norm 1, (ways, ways), in extended precision,
    rounded at the end; its rows have norm 1. An entry of a tensor with p factors is a single
    product of p − 1 couplings, since the components fix the intermediate ones; each coupling is
    off by two units. The components of all factors but the longest fix that of the longest.
    """
    if all(len(set(part)) == len(part) for part in rows.parts):
        return 0.0  # nothing is reordered: a permutation matrix
    entries = 1
    for spin in sorted(rows.spins)[:-1]:
        entries *= 2 * spin + 1
    tensor = gamma(3 * len(rows.spins), EXTENDED_UNIT)
    inner = rows.ways * (2 * tensor + gamma(entries + 2, EXTENDED_UNIT))
    return (inner + sqrt(rows.ways) * UNIT) * _GROWTH
