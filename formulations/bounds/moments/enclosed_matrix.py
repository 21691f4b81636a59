"""Matrices in floating point with bounds on their errors, in the Frobenius norm.

A product AB whose entries are sums of K terms has an error of at most

    ‖A‖ε_B + ε_A(‖B‖ + ε_B) + γ_K‖A‖‖B‖,   γ_K = Ku/(1 − Ku),

with bounds ε_A and ε_B on the errors of the factors, and the unit of rounding u of their
precision: a result of one operation is off by at most u, relative to itself. Norms are
computed, and rounded up by `SAFETY`. Leading axes of arrays, written …, are configurations.

An `EnclosedMatrix` follows every error to the end. The functions below it make products of
large matrices of doubles whose rounding is known: `enclosed_squares` says how.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import frexp, sqrt
from typing import Any

import numpy as np

from lockedjoint.formulations.bounds.moments.rotations import jacobians_of
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import LockedJointError

#: Unit of rounding of double precision.
UNIT = 2.0**-53
#: Unit of rounding of extended precision, ``numpy.longdouble``.
EXTENDED_UNIT = 2.0**-64
#: Factor by which computed norms are raised: their relative errors are far below 1e-6. A larger
#: one makes bounds worse by so much, a smaller one would have to be proved.
SAFETY = 1.0 + 1e-6
#: Bound on the error of an entry of a rotation, in units of rounding. Numerator and denominator
#: have 4 products and 3 sums each, relative to |q|²; one division follows.
ROTATION_ENTRY = 16
# Number of significant bits that extended precision must have: those of x86 processors.
_EXTENDED_BITS = 64


def gamma(operations: int, unit: float = UNIT) -> float:
    """Return γ_K = Ku/(1 − Ku), which bounds the relative error of K operations.

    `operations` is K and `unit` is u.
    """
    product = operations * unit
    return product / (1.0 - product)


class NoExtendedPrecisionError(LockedJointError):
    """``numpy.longdouble`` has fewer than 64 significant bits here."""


def require_extended_precision() -> None:
    """Raise NoExtendedPrecisionError unless ``numpy.longdouble`` has 64 significant bits.

    That is tried, in sums and in products: libraries of others can set the processor to fewer.
    Every process that computes with it has to ask, since each has a setting of its own.
    """
    one = np.ones(4, dtype=np.longdouble)
    last = 1 - _EXTENDED_BITS
    above = one + np.ldexp(one, last)
    sums = above != one
    # (1 + 2⁻³²)(1 + 2⁻³¹) has a last bit, 2⁻⁶³, that is lost with fewer than 64.
    products = (one + np.ldexp(one, -32)) * (one + np.ldexp(one, -31))
    rest = products - one - np.ldexp(one, -31) - np.ldexp(one, -32)
    if not (sums.all() and np.all(rest == np.ldexp(one, last))):
        raise NoExtendedPrecisionError(
            "a rigorous bound needs extended precision: numpy.longdouble does not compute with "
            f"{_EXTENDED_BITS} significant bits here"
        )


@dataclass(frozen=True, eq=False)
class EnclosedMatrix:
    """Matrices with bounds on their errors.

    Attributes
    ----------
    values
        The matrices, shape (…, a, b).
    errors
        Bounds on the Frobenius norms of their errors, shape (…,).
    """

    values: FloatArray
    errors: FloatArray

    @classmethod
    def exact(cls, values: Any, like: EnclosedMatrix) -> EnclosedMatrix:
        """Return a matrix, shape (a, b), that is exact, in the precision of `like`.

        Its errors have the shape (1,): it combines with matrices at any configurations.
        """
        return cls(np.asarray(values, dtype=like.values.dtype), np.zeros(1))

    @classmethod
    def jacobian(cls, rotations: FloatArray) -> EnclosedMatrix:
        """Return J, (…, 6, n), at rotations (…, n, 3, 3) of `random_rotations`.

        Each entry is off by at most `ROTATION_ENTRY` units of rounding.
        """
        values = jacobians_of(rotations)
        exact = cls(values, np.zeros(values.shape[:-2]))
        error = ROTATION_ENTRY * exact.unit * sqrt(values.shape[-1] * values.shape[-2])
        return cls(values, exact.errors + error)

    @property
    def unit(self) -> float:
        """Return the unit of rounding of the entries."""
        return EXTENDED_UNIT if self.values.dtype == np.longdouble else UNIT

    @property
    def norm(self) -> FloatArray:
        """Frobenius norms, rounded up."""
        return np.asarray(SAFETY * np.sqrt(np.sum(self.values**2, axis=(-2, -1)).astype(float)))

    @property
    def transposed(self) -> EnclosedMatrix:
        """The transposed matrices."""
        return EnclosedMatrix(self.values.swapaxes(-2, -1), self.errors)

    def __matmul__(self, other: EnclosedMatrix) -> EnclosedMatrix:
        values = self.values @ other.values
        return EnclosedMatrix(values, self._product_errors(other, self.values.shape[-1]))

    def inner(self, other: EnclosedMatrix) -> EnclosedMatrix:
        """Return Σ a_ij b_ij, as matrices with one entry, shape (…, 1, 1)."""
        values = np.sum(self.values * other.values, axis=(-2, -1), keepdims=True)
        count = self.values.shape[-2] * self.values.shape[-1]
        return EnclosedMatrix(values, self._product_errors(other, count))

    def _product_errors(self, other: EnclosedMatrix, terms: int) -> FloatArray:
        """Return the bound of the header for sums of `terms` products, shape (…,)."""
        a, b = self.norm, other.norm
        error = a * other.errors + self.errors * (b + other.errors)
        return np.asarray(SAFETY * (error + gamma(terms, self.unit) * a * b))

    def __add__(self, other: EnclosedMatrix) -> EnclosedMatrix:
        total = EnclosedMatrix(self.values + other.values, self.errors + other.errors)
        rounding = 2 * self.unit * total.norm
        return EnclosedMatrix(total.values, SAFETY * (total.errors + rounding))

    def __sub__(self, other: EnclosedMatrix) -> EnclosedMatrix:
        return self + EnclosedMatrix(-other.values, other.errors)

    def times(self, number: Any) -> EnclosedMatrix:
        """Return the matrices times a number that is exact up to a unit of their precision."""
        values = self.values * self.values.dtype.type(number)
        error = abs(float(number)) * (self.errors + 4 * self.unit * self.norm)
        return EnclosedMatrix(values, SAFETY * error)

    def column(self, place: int) -> EnclosedMatrix:
        """Return one column, (…, a, 1)."""
        return EnclosedMatrix(self.values[..., place : place + 1], self.errors)

    def without(self, place: int) -> EnclosedMatrix:
        """Return all columns but one, (…, a, b − 1)."""
        return EnclosedMatrix(np.delete(self.values, place, axis=-1), self.errors)

    @staticmethod
    def beside(parts: Sequence[EnclosedMatrix]) -> EnclosedMatrix:
        """Return matrices with as many rows side by side, (…, a, sum of the b)."""
        count = max((part.values.shape[:-2] for part in parts), key=len)
        values = [np.broadcast_to(a.values, (*count, *a.values.shape[-2:])) for a in parts]
        errors = np.sqrt(sum(part.errors**2 for part in parts))
        return EnclosedMatrix(np.concatenate(values, axis=-1), np.asarray(SAFETY * errors))


def spectral_norm(matrix: FloatArray) -> float:
    """Return the spectral norm of a matrix, rounded up."""
    square = matrix @ matrix.T if len(matrix) < matrix.shape[1] else matrix.T @ matrix
    return SAFETY * sqrt(max(float(np.linalg.eigvalsh(square)[-1]), 0.0))


def short_sums(first: FloatArray, second: FloatArray, terms: int) -> FloatArray:
    """Return the product of matrices (…, a, K) and (…, K, b), with little rounding.

    The sums of K products are cut into sums of at most `terms`, which are added up.
    """
    total = first[..., :terms] @ second[..., :terms, :]
    for start in range(terms, first.shape[-1], terms):
        here = slice(start, start + terms)
        total += first[..., here] @ second[..., here, :]
    return total


def operations(count: int, terms: int) -> int:
    """Return the k of γ_k, which bounds the rounding of `short_sums` of `count` products."""
    return min(count, terms) + -(-count // terms)


def on_grid(matrix: FloatArray, bits: int) -> FloatArray:
    """Return a matrix rounded to a grid of numbers that have `bits` bits.

    The step of the grid is the power of 2 above the largest absolute value, over 2^`bits`.
    """
    grid = 2.0 ** (frexp(float(np.abs(matrix).max()))[1] - bits)
    return np.asarray(np.rint(matrix / grid) * grid)


def rounded_once(first: FloatArray, second: FloatArray, bits: int) -> FloatArray:
    """Return a product of matrices, (a, K) and (K, b), most of which is exact.

    Entries of `second` are at most 1 in absolute value. Each factor is a part on a grid and a
    small rest. The product of the parts on grids is exact: only what the rests add is rounded.
    """
    first_grid = on_grid(first, bits)
    second_grid = np.rint(second * 2.0**bits) / 2.0**bits
    rest = (first - first_grid) @ second + first_grid @ (second - second_grid)
    return np.asarray(first_grid @ second_grid + rest)
