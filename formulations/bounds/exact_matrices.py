"""Matrices of fractions: the few operations that a check in rational arithmetic takes.

They are NumPy arrays with the dtype object, whose entries are all `fractions.Fraction`: sums,
products and ``@`` of NumPy are exact then. Semidefinite means positive semidefinite.
"""

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

#: A matrix of fractions.
Exact: TypeAlias = NDArray[Any]
#: Multiples of the largest entry that are added to the diagonal, until a matrix is
#: semidefinite: 0, then from the rounding of doubles (1e-16) to the errors of a solver (1e-6).
MARGINS = (0.0, *(10.0**-k for k in range(16, 5, -1)))


def exact(values: Any) -> Exact:
    """Return numbers, in an array of any shape, as the fractions that they are."""
    array = np.array(values, dtype=object)
    return np.array([Fraction(x) for x in array.ravel()], dtype=object).reshape(array.shape)


def zeros(size: int) -> Exact:
    """Return the square matrix of zeros."""
    return exact(np.zeros((size, size)))


def solved(matrix: Exact, right: Exact) -> Exact:
    """Return matrix⁻¹ · right of a positive definite matrix (m, m) and `right`, (m, k).

    It is Gauss–Jordan elimination: pivots of a positive definite matrix are not 0.
    """
    rows = [[*row, *other] for row, other in zip(matrix.tolist(), right.tolist(), strict=True)]
    size = len(rows)
    for k in range(size):
        rows[k] = [x / rows[k][k] for x in rows[k]]
        for i in range(size):
            if i != k and rows[i][k]:
                factor = rows[i][k]
                rows[i] = [x - factor * y for x, y in zip(rows[i], rows[k], strict=True)]
    return np.array([row[size:] for row in rows], dtype=object)


def is_semidefinite(matrix: Exact, strictly: bool = False) -> bool:
    """Whether a matrix of fractions is symmetric and semidefinite; definite if `strictly`.

    Elimination without exchanges decides: a pivot must not be negative, and if it is 0 its
    whole row must be 0.
    """
    if not np.array_equal(matrix, matrix.T):
        return False
    rows: list[Sequence[Fraction]] = matrix.tolist()
    while rows:
        pivot, *first = rows[0]
        if pivot < 0 or (pivot == 0 and (strictly or any(first))):
            return False
        rest = [row[1:] for row in rows[1:]]
        if pivot > 0:
            rest = [
                [x - below * y / pivot for x, y in zip(row, first, strict=True)]
                for row, below in zip(rest, first, strict=True)
            ]
        rows = list(rest)
    return True
