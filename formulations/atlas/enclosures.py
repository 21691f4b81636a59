"""What is positive, of full rank or near, of exact numbers that are enclosed by rational ones.

Matrices are decided in whole numbers: of entries in units of 2⁻¹²⁸, each off by at most one.
"""

from fractions import Fraction

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations.atlas.exact_numbers import Number
from lockedjoint.formulations.atlas.exact_value import determinant
from lockedjoint.formulations.bounds.closed_form import rational_root_above
from lockedjoint.nlp.arrays import FloatArray

Numbers = npt.NDArray[np.object_]
_UNITS = 1 << 128


def is_definite(matrix: Numbers) -> bool:
    """Whether a symmetric matrix of numbers is proved to be positive definite."""
    # No eigenvalue changes by more than the size where entries change by one.
    return determinant(_in_units(matrix) - _diagonal(len(matrix), len(matrix))) > 0


def has_full_rank(matrix: Numbers) -> bool:
    """Whether the columns of a matrix of numbers are proved to be independent."""
    rows, columns = matrix.shape
    if rows < columns:
        return False
    # The square of what a singular value changes by is at most the number of entries.
    whole = _in_units(matrix)
    return determinant(whole.T @ whole - _diagonal(columns, whole.size)) > 0


def rational(values: FloatArray) -> Numbers:
    """Return doubles as rational numbers."""
    return np.asarray(np.frompyfunc(Fraction, 1, 1)(values))


def off_by(number: Number, near: Fraction) -> Fraction:
    """Return what a number and a rational one differ by at most."""
    value, unsure = number.enclosed()
    return abs(value - near) + unsure


def distance_bound(given: Numbers, factors: Numbers, squares: Numbers) -> Fraction:
    """Return what rational numbers and a_i√s_i differ by at most, as vectors; s_i > 0."""
    total = Fraction(0)
    for x, a, s in zip(given, factors, squares, strict=True):
        square = a * a * s
        if x * a.sign > 0:  # |x − y| ≤ |x² − y²|/|x|
            total += (off_by(square, x * x) / x) ** 2
        else:  # one of them may be zero
            total += 2 * (x * x + off_by(square, Fraction(0)))
    return rational_root_above(total)


def norm_bound(matrix: Numbers) -> Fraction:
    """Return what the Frobenius norm of a matrix of rational numbers is at most."""
    return rational_root_above(np.sum(matrix * matrix))


def _diagonal(size: int, value: int) -> Numbers:
    return value * np.eye(size, dtype=int).astype(object)


def _in_units(numbers: Numbers) -> Numbers:
    def rounded(number: Number) -> int:
        value, unsure = number.enclosed()
        if 2 * unsure * _UNITS > 1:
            raise ValueError("a number is not known well enough")
        return round(value * _UNITS)

    return np.asarray(np.frompyfunc(rounded, 1, 1)(numbers))
