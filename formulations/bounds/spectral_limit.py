"""ρ ≤ α + β tr E³ where the worst case of seven unit revolute joints is σ² ≥ t: α, proved.

What comes in: t. What goes out: three numbers A, B and C, and the α that they prove. Nothing
here has a unit.

- J: a Jacobian of seven unit revolute joints, shape (6, 7), and σ its worst case after one
  locked joint; t, between 0 and 1/3, is a value that σ² is assumed to reach;
- E = JJᵀ − (7/3)I, of trace 0; e stands for any of its six eigenvalues;
- ρ = ½‖E‖_F² = ½ Σ e², the residual;
- c = 7/3 − t, so that c + e is an eigenvalue of JJᵀ less t, above 0. Where σ² ≥ t these satisfy
  Σ 1/(c + e) ≤ 1/t;
- β = `CUBIC`.

If C ≥ 0 and

    ½e² − βe³ ≤ A + Be + C/(c + e)   for every e that can be an eigenvalue of E,

then the sum over all six eigenvalues, with Σ e = 0, gives α = 6A + C/t. A linear program
suggests A, B and C, with doubles. What is claimed of them is proved in rational arithmetic
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
#: β, where the program of the worst case excludes most. A proof takes any β: α changes with it,
#: and certificates on record hold for this one only.
CUBIC = 0.2
# Number of values of e for which the linear program states the inequality. With fewer values
# A needs a larger addition, and α is larger.
_GRID_POINTS = 4001
# Distance of the grid from e = −c, where 1/(c + e) is infinite.
_POLE_DISTANCE = 1e-6
# Number that is first added to A, for the values of e between those of the grid.
_FIRST_ADDITION = 1e-8
# Factor by which this number grows until the inequality is proved.
_ADDITION_FACTOR = 4
# Number of halvings of the interval of e after which a proof gives up.
_MOST_HALVINGS = 40
# Denominator of the root that limits e: a larger one gives a slightly shorter interval.
_ROOT_DENOMINATOR = 10**12


def suggested_spectrum(t: float) -> Spectrum:
    """Return A, B and C that make α small, and that `spectral_limit` can prove.

    A linear program minimises α = 6A + C/t for the e of a grid. Then A grows until the
    inequality is proved for all e. That ends: the interval of e is bounded, so that some A is
    large enough.
    """
    c = 7 / 3 - t
    low, high = map(float, _eigenvalue_range(Fraction(t)))
    grid = np.linspace(max(low, -c + _POLE_DISTANCE), high, _GRID_POINTS)
    least = 0.5 * grid**2 - CUBIC * grid**3
    rows = np.stack([np.ones(_GRID_POINTS), grid, 1 / (c + grid)], axis=1)
    bounds = [(None, None), (None, None), (0, None)]
    constant, slope, pole = linprog([6, 0, 1 / t], A_ub=-rows, b_ub=-least, bounds=bounds).x
    addition = _FIRST_ADDITION
    while not _is_proved(t, found := (float(constant + addition), float(slope), float(pole))):
        addition *= _ADDITION_FACTOR
    return found


def spectral_limit(t: float, spectrum: Spectrum) -> float:
    """Return α, rounded up; InputError unless A, B and C are proved for this t, 0 < t < 1/3."""
    if not _is_proved(t, spectrum):
        allowed = "A, B and C with ½e² − βe³ ≤ A + Be + C/(c + e) for all eigenvalues e"
        raise InputError("spectrum", spectrum, allowed)
    constant, _, pole = map(Fraction, spectrum)
    return math.nextafter(float(6 * constant + pole / Fraction(t)), math.inf)


def _is_proved(t: float, spectrum: Spectrum) -> bool:
    """Whether (A + Be + βe³ − ½e²)(c + e) + C ≥ 0 wherever e can be, and C ≥ 0.

    This is the inequality of the header times c + e > 0, a polynomial of degree 4.
    """
    constant, slope, pole = map(Fraction, spectrum)
    c, zero = Fraction(7, 3) - Fraction(t), Fraction(0)
    low, high = _eigenvalue_range(Fraction(t))
    # Coefficients are in ascending powers of e: those of the bracket, then of its product with
    # c + e, where power k has c times its own coefficient and the one before.
    bracket = [constant, slope, Fraction(-1, 2), Fraction(CUBIC), zero]
    powers = [c * own + before for before, own in pairwise([zero, *bracket])]
    powers[0] += pole
    coefficients = _bernstein(powers, max(low, -c), high)
    return pole >= 0 and _is_nonnegative(coefficients, _MOST_HALVINGS)


def _eigenvalue_range(t: Fraction) -> tuple[Fraction, Fraction]:
    """Return numbers between which all eigenvalues of E are: a lower and an upper one.

    One eigenvalue e leaves the mean −e/5 to the five others. As 1/(c + e) is convex,
    1/(c + e) + 25/(5c − e) ≤ 1/t, that is e² − 2(2c − 12t)e + 30ct − 5c² ≤ 0. The numbers are
    the roots of this quadratic, with the square root rounded up.
    """
    c = Fraction(7, 3) - t
    middle = 2 * c - 12 * t
    square = middle**2 + 5 * c**2 - 30 * c * t
    root = rational_root_above(max(square, Fraction(0)), _ROOT_DENOMINATOR)
    return middle - root, middle + root


def _bernstein(powers: list[Fraction], low: Fraction, high: Fraction) -> list[Fraction]:
    """Return the Bernstein coefficients of Σ p_k e^k on [low, high], as many as `powers`.

    The least of them is a lower bound on the values, the first and the last are values at the
    ends. With e = low + width·x the polynomial is Σ q_i x^i; coefficient j is then
    Σ_i C(j, i)/C(degree, i) q_i, C the binomial coefficients.
    """
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
    """Whether Bernstein coefficients prove a polynomial ≥ 0, after at most `depth` halvings.

    False may mean that it is negative somewhere, or that more halvings are needed.
    """
    if min(coefficients) >= 0:
        return True
    if min(coefficients[0], coefficients[-1]) < 0 or depth == 0:
        return False
    # De Casteljau's averages: their first entries belong to the left half of the interval,
    # their last ones to the right half.
    left, right, row = coefficients[:0], coefficients[:0], coefficients
    while row:
        left.append(row[0])
        right.insert(0, row[-1])
        row = [(a + b) / 2 for a, b in pairwise(row)]
    return _is_nonnegative(left, depth - 1) and _is_nonnegative(right, depth - 1)
