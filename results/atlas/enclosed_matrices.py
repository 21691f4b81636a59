"""Properties of matrices of exact numbers, decided by rational numbers that enclose them.

A matrix is definite, or of full rank, if an integer matrix near it is by more than the
rounding: each entry is rounded to a whole multiple of 2⁻¹²⁸. Elimination in integers decides.

`Exact` arrays have the dtype object. Matrices of numbers hold `Number`; `rational` makes
matrices of `Fraction` from doubles, without rounding. Bounds are `Fraction`.
"""

from fractions import Fraction

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations.atlas.proved_value import determinant
from lockedjoint.formulations.bounds.rational_roots import rational_root_above
from lockedjoint.nlp.arrays import FloatArray
from results.atlas.number_field import Number

#: An array of `Number`, of fractions, or of integers of any size.
Exact = npt.NDArray[np.object_]
# Number of units in 1: entries are rounded to whole units. More units prove matrices that are
# nearer to singular, and take longer; numbers are known to about 1000 binary digits.
_UNITS = 1 << 128


def is_definite(matrix: Exact) -> bool:
    """Whether a symmetric matrix of numbers is proved to be positive definite."""
    size = len(matrix)
    # Each entry is off by at most one unit, so that no eigenvalue is off by more than `size`.
    return determinant(_in_units(matrix) - _identity(size) * size) > 0


def has_full_rank(matrix: Exact) -> bool:
    """Whether the columns of a matrix of numbers are proved to be independent."""
    rows, columns = matrix.shape
    if rows < columns:
        return False
    rounded = _in_units(matrix)
    # The Frobenius norm of what is rounded away is at most √(number of entries) units, and no
    # singular value changes by more than that.
    return determinant(rounded.T @ rounded - _identity(columns) * rounded.size) > 0


def rational(values: FloatArray) -> Exact:
    """Return doubles as fractions with the same values, of the same shape."""
    return np.asarray(np.frompyfunc(Fraction, 1, 1)(values))


def distance_of_roots(values: Exact, factors: Exact, squares: Exact) -> Fraction:
    """Return a bound on the Euclidean distance of the vectors (x_i) and (y_i), y_i = a_i √s_i.

    The three arrays have one shape (N,): `values` the x_i, fractions; `factors` the a_i and
    `squares` the s_i > 0, numbers of a field. Roots are avoided: y_i² is of the field.
    """
    total = Fraction(0)
    for x, a, s in zip(values, factors, squares, strict=True):
        square = a * a * s
        if x * a.sign > 0:
            # Of one sign: |x − y| = |x² − y²|/|x + y| ≤ |x² − y²|/|x|.
            total += (square.distance_bound(x * x) / x) ** 2
        else:
            # Of opposite signs, or one of them zero: (x − y)² ≤ 2(x² + y²).
            total += 2 * (x * x + square.distance_bound(Fraction(0)))
    return rational_root_above(total)


def norm_bound(matrix: Exact) -> Fraction:
    """Return an upper bound on the Frobenius norm of a matrix of fractions."""
    return rational_root_above(np.sum(matrix * matrix))


def _identity(size: int) -> Exact:
    """Return the identity of Python's integers, which do not overflow, shape (size, size)."""
    return np.eye(size, dtype=int).astype(object)


def _in_units(matrix: Exact) -> Exact:
    """Return integers that differ by at most 1 from the entries in units of 2⁻¹²⁸."""

    def rounded(number: Number) -> int:
        value, error = number.enclosed()
        if 2 * error * _UNITS > 1:
            raise ValueError("a number is not known well enough")
        return round(value * _UNITS)

    return np.asarray(np.frompyfunc(rounded, 1, 1)(matrix))
