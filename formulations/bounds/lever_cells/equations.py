"""Equations and inequalities that arms of a tight frame fulfil, and their multipliers.

O = (V̂; q) in SO(4) has the rows V̂ (3×4) and q. As o, 16 numbers row after row, it fulfils 37
quadratic equations. With n = Fᵀq, F the frame's second part, every n_i lies between √ν and
√(1 − 6ν), ν = (1 − 3A)/7, if no lever arm is longer than A: |n| = 1.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.cases import Cases
from lockedjoint.formulations.bounds.lever_cells.corners import BoolArray
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError

#: Number of equations.
EQUATION_COUNT = 37
#: Numbers of the multipliers of one cell: 37 + 16 + 21 + 7 + 7 + 1.
MULTIPLIER_COUNT = 89
#: Greatest length of the multipliers of a cell, so that rounding is small; those of programs
#: were at most 0.5 long.
GREATEST_LENGTH = 2.0
#: First members of the 21 pairs i < j of columns.
PAIR_I = np.triu_indices(7, 1)[0]
#: Their second members.
PAIR_J = np.triu_indices(7, 1)[1]
#: Where the packed parts of multipliers end: 37, 53, 74, 81, 88.
_ENDS = np.cumsum([EQUATION_COUNT, 16, 21, 7, 7])


def _sign(order: tuple[int, ...]) -> int:
    """Return the sign of a permutation."""
    return int((-1) ** sum(first > second for first, second in combinations(order, 2)))


def _quadratic(terms: Iterable[tuple[int, int, float]]) -> FloatArray:
    """Return symmetric E, 16×16, with oᵀEo = Σ value·o_i o_j."""
    E = np.zeros((16, 16))
    for i, j, value in terms:
        E[i, j] += value / 2
        E[j, i] += value / 2
    return E


def equations() -> tuple[FloatArray, FloatArray]:
    """Return E, 37×16×16, and b, 37, of the equations oᵀE o = b of matrices of SO(4).

    Nine say that the rows are orthonormal (the last row's length follows from the others), ten
    that the columns are. Eighteen say that a 2×2 minor of two of the first three rows is, but
    for a sign, the minor of the other rows and columns: so it is if the determinant is 1.
    """
    E, right = [], []
    for a in range(3):
        for c in range(a, 4):
            E.append(_quadratic((4 * a + j, 4 * c + j, 1.0) for j in range(4)))
            right.append(float(a == c))
    for i in range(4):
        for j in range(i, 4):
            E.append(_quadratic((4 * a + i, 4 * a + j, 1.0) for a in range(4)))
            right.append(float(i == j))
    for a, c in combinations(range(3), 2):
        d = 3 - a - c
        for i, j in combinations(range(4), 2):
            k, m = (other for other in range(4) if other not in (i, j))
            sign = float(_sign((a, c, d, 3)) * _sign((i, j, k, m)))
            minor = [(4 * a + i, 4 * c + j, 1.0), (4 * a + j, 4 * c + i, -1.0)]
            other_minor = [(4 * d + k, 12 + m, -sign), (4 * d + m, 12 + k, sign)]
            E.append(_quadratic(minor + other_minor))
            right.append(0.0)
    return np.array(E), np.array(right)


_SYSTEM = equations()
#: The equations' matrices, 37×16×16.
EQUATIONS = _SYSTEM[0]
#: Their right sides, 37.
RIGHT = _SYSTEM[1]


@dataclass(frozen=True)
class Multipliers(Cases):
    """Multipliers of equations and inequalities, for N cells.

    Attributes
    ----------
    equations
        Of the 37 equations, of any sign, (N,37).
    shared
        The block of q in the form of (V̂, q): the form of (1, q) has the rest, (N,4,4).
    products
        Of (n_i − √ν)(n_j − √ν) ≥ 0, i < j, (N,21).
    lower
        Of n_i − √ν ≥ 0, (N,7).
    upper
        Of (n_i − √ν)(√(1−6ν) − n_i) ≥ 0, (N,7).
    constant
        The entry of 1·1 in the form of (1, q), of any sign, (N,).
    """

    equations: FloatArray
    shared: FloatArray
    products: FloatArray
    lower: FloatArray
    upper: FloatArray
    constant: FloatArray

    def packed(self) -> FloatArray:
        """Return all numbers of each cell in a row, (N,89)."""
        shared = self.shared.reshape(-1, 16)
        parts = (self.equations, shared, self.products, self.lower, self.upper)
        return np.concatenate([*parts, self.constant[:, None]], 1)

    @classmethod
    def unpacked(cls, rows: FloatArray) -> "Multipliers":
        """Return the multipliers that `packed` has put into rows (N,89)."""
        equations, shared, products, lower, upper, constant = np.split(rows, _ENDS, axis=1)
        shared = shared.reshape(-1, 4, 4)
        return cls(equations, shared, products, lower, upper, constant[:, 0])

    def admissible(self) -> BoolArray:
        """Whether no number is large, and those of inequalities are not negative, (N,)."""
        inequalities = np.concatenate([self.products, self.lower, self.upper], 1)
        with np.errstate(all="ignore"):
            length = np.linalg.norm(self.packed(), axis=1)
            return np.asarray((length < GREATEST_LENGTH) & (inequalities >= 0).all(1))


def ends(limit: float) -> tuple[float, float]:
    """Return √ν and √(1 − 6ν), between which all n_i are if no lever arm is above the limit.

    Raises
    ------
    InputError
        If the limit is not from 0 to below 1/3: then ν is not between 0 and 1/7.
    """
    if not 0 <= limit < 1 / 3:
        raise InputError("limit of lever arms", limit, "a number from 0 to below 1/3")
    nu = (1 - 3 * limit) / 7
    return float(np.sqrt(nu)), float(np.sqrt(1 - 6 * nu))


def polynomial(
    multipliers: Multipliers, limit: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return φ (N,7,7), c (N,7) and c₀ (N,): Σ multiplier·inequality = nᵀφn − c·n − c₀."""
    least, most = ends(limit)
    products, lower, upper = multipliers.products, multipliers.lower, multipliers.upper
    every = np.arange(7)
    phi = np.zeros((len(products), 7, 7))
    phi[:, PAIR_I, PAIR_J] = phi[:, PAIR_J, PAIR_I] = products / 2
    c = 2 * least * phi.sum(2) - lower - (least + most) * upper
    phi[:, every, every] = -upper
    c0 = -(least**2) * products.sum(1) + least * lower.sum(1) + least * most * upper.sum(1)
    return phi, c, c0
