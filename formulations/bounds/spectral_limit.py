"""ρ ≤ α + β tr E³ where the worst case of seven unit revolute joints is σ² ≥ t: α, proved.

If ½e² − βe³ ≤ A + Be + C/(c + e), C ≥ 0, for every e that can be an eigenvalue of E = JJᵀ −
(7/3)I, c = 7/3 − t, then Σ e = 0 and Σ 1/(c + e) ≤ 1/t give α = 6A + C/t. A linear program
suggests A, B and C; what is claimed of them is proved in rational arithmetic
(docs/bounds.md, section 4).
"""

import math
from fractions import Fraction
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from scipy.optimize import linprog

from lockedjoint.formulations.bounds.rational_roots import rational_root_above
from lockedjoint.nlp.errors import InputError

#: A, B and C.
Spectrum: TypeAlias = tuple[float, float, float]
#: β.
CUBIC = 0.2
# Number of points of the grid of e for which A, B and C are found.
_GRID = 4001
# What is first added to A for the points between those of the grid.
_SLACK = 1e-8
# Halvings of the interval of e.
_DEPTH = 40


def suggested_spectrum(t: float) -> Spectrum:
    """Return A, B and C that make α small, and that `spectral_limit` can prove."""
    mean = 7 / 3 - t
    low, high = map(float, _eigenvalues(Fraction(t)))
    grid = np.linspace(max(low, -mean + 1e-6), high, _GRID)
    goal = 0.5 * grid**2 - CUBIC * grid**3
    rows = np.stack([np.ones(_GRID), grid, 1 / (mean + grid)], axis=1)
    bounds = [(None, None), (None, None), (0, None)]
    constant, slope, pole = linprog([6, 0, 1 / t], A_ub=-rows, b_ub=-goal, bounds=bounds).x
    slack = _SLACK
    while not _is_proved(t, found := (float(constant + slack), float(slope), float(pole))):
        slack *= 4
    return found


def spectral_limit(t: float, spectrum: Spectrum) -> float:
    """Return α, rounded up; InputError unless A, B and C are proved for this t, 0 < t < 1/3."""
    if not _is_proved(t, spectrum):
        allowed = "A, B and C with ½e² − βe³ ≤ A + Be + C/(c + e) for all eigenvalues e"
        raise InputError("spectrum", spectrum, allowed)
    constant, _, pole = map(Fraction, spectrum)
    return math.nextafter(float(6 * constant + pole / Fraction(t)), math.inf)


def _is_proved(t: float, spectrum: Spectrum) -> bool:
    """Whether (A + Be + βe³ − ½e²)(c + e) + C ≥ 0 wherever e can be, and C ≥ 0."""
    constant, slope, pole = map(Fraction, spectrum)
    mean, zero = Fraction(7, 3) - Fraction(t), Fraction(0)
    low, high = _eigenvalues(Fraction(t))
    # Coefficients are in ascending powers of e.
    bracket = [constant, slope, Fraction(-1, 2), Fraction(CUBIC), zero]
    powers = [mean * own + less for less, own in pairwise([zero, *bracket])]
    powers[0] += pole
    bounds = _bernstein(powers, max(low, -mean), high)
    return pole >= 0 and _is_nonnegative(bounds, _DEPTH)


def _eigenvalues(t: Fraction) -> tuple[Fraction, Fraction]:
    """Return between which numbers the eigenvalues of E are.

    One of them, e, leaves the mean −e/5 to the others: 1/(c + e) + 25/(5c − e) ≤ 1/t.
    """
    mean = Fraction(7, 3) - t
    middle = 2 * mean - 12 * t
    square = middle**2 + 5 * mean**2 - 30 * mean * t
    root = rational_root_above(max(square, Fraction(0)), 10**12)
    return middle - root, middle + root


def _bernstein(powers: list[Fraction], low: Fraction, high: Fraction) -> list[Fraction]:
    """Return the Bernstein coefficients of Σ p_k e^k on [low, high]: bounds on its values."""
    degree, width = len(powers) - 1, high - low
    moved = [
        sum(
            (
                powers[k] * math.comb(k, i) * low ** (k - i) * width**i
                for k in range(i, degree + 1)
            ),
            Fraction(0),
        )
        for i in range(degree + 1)
    ]
    return [
        sum(
            (Fraction(math.comb(j, i), math.comb(degree, i)) * moved[i] for i in range(j + 1)),
            Fraction(0),
        )
        for j in range(degree + 1)
    ]


def _is_nonnegative(coefficients: list[Fraction], depth: int) -> bool:
    """Whether a polynomial is proved to be ≥ 0 on its interval, which is halved so often."""
    if min(coefficients) >= 0:
        return True
    if min(coefficients[0], coefficients[-1]) < 0 or depth == 0:
        return False
    left, right, row = coefficients[:0], coefficients[:0], coefficients
    while row:
        left.append(row[0])
        right.insert(0, row[-1])
        row = [(a + b) / 2 for a, b in pairwise(row)]
    return _is_nonnegative(left, depth - 1) and _is_nonnegative(right, depth - 1)
