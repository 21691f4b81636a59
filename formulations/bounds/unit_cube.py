"""Prove that a polynomial is nowhere positive on the unit cube, with all rounding bounded.

What comes in: a polynomial in p, q and u, as a function of fractions, and its degrees. What
goes out: whether it is proved. A polynomial is not above its largest Bernstein coefficient on a
cube. The first coefficients follow from values at fractions, exactly; those of halves by
averages, with bounded rounding.

The Bernstein coefficients of a polynomial of degrees (a, b, c) in p, q and u are an array of
shape (a + 1, b + 1, c + 1). Those at the eight corners of the array are values of the
polynomial at the corners of the cube. `cubes` is an array of shape (cubes, a + 1, b + 1, c +
1).
"""

from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import lru_cache
from math import comb
from typing import Any

import numpy as np

from lockedjoint.nlp.arrays import FloatArray

# Number of halvings of a cube after which the proof gives up: 25 along each axis. These two
# limits only bound the time; more halvings count more rounding against the claim.
_MOST_HALVINGS = 75
# Number of cubes in all after which the proof gives up.
_MOST_CUBES = 500_000
# Number of cubes that are halved at once. More take more memory.
_CUBES_AT_ONCE = 4096
# Bound on the relative rounding of half the sum of two doubles: twice the unit roundoff.
_ROUNDING = 2.0**-52


def nowhere_positive(function: Callable[..., Fraction], degrees: tuple[int, ...]) -> bool:
    """Whether a polynomial of these degrees is proved not to be above 0 on the unit cube.

    `function` takes p, q and u as fractions, and `degrees` has its degree in each. A cube needs
    no more halving if none of its Bernstein coefficients is above 0, with rounding counted
    against the claim. Coefficients at the corners are values: one above 0 by more than rounding
    refutes it.
    """
    first = _bernstein(function, degrees)
    # A halving takes at most as many averages as the degree; none is above the largest.
    rounding = (_MOST_HALVINGS * max(degrees) + 2) * _ROUNDING * float(np.abs(first).max())
    # Cubes, with the number of halvings that made them.
    waiting = [(first[None], 0)]
    count = 0
    while waiting:
        cubes, depth = waiting.pop()
        count += len(cubes)
        cubes = cubes[cubes.max(axis=(1, 2, 3)) > -rounding]
        # A step of the degree takes the first coefficient and the last one of an axis.
        corners = cubes[:, :: max(degrees[0], 1), :: max(degrees[1], 1), :: max(degrees[2], 1)]
        if (
            depth == _MOST_HALVINGS
            or count > _MOST_CUBES
            or (corners.size and corners.max() > rounding)
        ):
            return False
        for half in _halves(cubes, 1 + depth % 3):
            starts = range(0, len(half), _CUBES_AT_ONCE)
            waiting.extend((half[i : i + _CUBES_AT_ONCE], depth + 1) for i in starts)
    return True


def _bernstein(function: Callable[..., Fraction], degrees: tuple[int, ...]) -> FloatArray:
    """Return the Bernstein coefficients on the unit cube, from values at fractions, as doubles.

    Values at degree + 1 equidistant nodes of each axis determine them: along one axis they are
    the solution of Σ_j C(k, j) x^j (1 − x)^(k−j) b_j = value at x, C the binomial coefficients.
    """
    axes = [_nodes(degree) for degree in degrees]
    values = np.array([function(p, q, u) for p in axes[0] for q in axes[1] for u in axes[2]])
    values = values.reshape([len(axis) for axis in axes])
    for place, degree in enumerate(degrees):
        solved = np.tensordot(_from_values(degree), values, (1, place))
        values = np.moveaxis(solved, 0, place)
    return np.asarray(values, dtype=np.float64)


def _nodes(degree: int) -> list[Fraction]:
    """Return degree + 1 equidistant fractions from 0 to 1."""
    return [Fraction(i, max(degree, 1)) for i in range(degree + 1)]


@lru_cache(maxsize=64)
def _from_values(degree: int) -> Any:
    """Return the matrix that makes Bernstein coefficients of values at the nodes, exact."""
    basis = [
        [comb(degree, j) * x**j * (1 - x) ** (degree - j) for j in range(degree + 1)]
        for x in _nodes(degree)
    ]
    return _inverse(np.array(basis, dtype=object))


def _inverse(matrix: Any) -> Any:
    """Return the inverse of a square matrix of fractions whose leading minors are not zero."""
    rows = np.hstack([matrix, np.eye(len(matrix), dtype=int).astype(object)])
    for k in range(len(rows)):
        rows[k] = rows[k] / rows[k, k]
        others = np.arange(len(rows)) != k
        rows[others] -= np.outer(rows[others, k], rows[k])
    return rows[:, len(rows) :]


def _halves(cubes: FloatArray, axis: int) -> Iterator[FloatArray]:
    """Yield the coefficients on both halves of cubes, cut across `axis`, 1 to 3, of the array.

    De Casteljau's averages of neighbours give them: the first entries of all rows of averages
    belong to the lower half, and the last ones to the upper half. Along an axis of degree 0
    both halves are the same, and one is enough.
    """
    rest = np.moveaxis(cubes, axis, 0)
    low, high = [rest[0]], [rest[-1]]
    while len(rest) > 1:
        rest = 0.5 * (rest[:-1] + rest[1:])
        low.append(rest[0])
        high.append(rest[-1])
    yield np.moveaxis(np.array(low), 0, axis)
    if len(low) > 1:
        yield np.moveaxis(np.array(high[::-1]), 0, axis)
