"""Square roots with a proved side, in rational arithmetic, and where a condition ends.

`root_below` and `rational_root_above` return rational numbers on the side that their names
say, `root_above` returns the least double that is not below the root. `first_double` bisects in
double precision: what it returns is only a suggestion if its condition is not checked exactly.
Squares are fractions, at least 0.
"""

import math
from collections.abc import Callable
from fractions import Fraction

# Number of binary digits of a root before it becomes a double: some more than the 53 of a
# double.
_ROOT_BITS = 64
# Denominator of the rational roots: they are off by less than its inverse. A larger one makes
# the fractions that follow longer.
_DENOMINATOR = 10**20


def first_double(is_below: Callable[[float], bool], high: float) -> float:
    """Return where a condition that holds at 0 ends, by bisection; at most `high`.

    It is the first double at which `is_below` is false, if it is true below and false above.
    """
    low = 0.0
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if is_below(middle) else (low, middle)
    return high


def root_below(square: Fraction, scale: int = _DENOMINATOR) -> Fraction:
    """Return the largest multiple of 1/`scale` that is not above the square root."""
    root = math.isqrt(square.numerator * scale**2 // square.denominator)
    return Fraction(root, scale)


def rational_root_above(square: Fraction, scale: int = _DENOMINATOR) -> Fraction:
    """Return the least multiple of 1/`scale` that is above the square root."""
    return root_below(square, scale) + Fraction(1, scale)


def root_above(square: Fraction) -> float:
    """Return the least double that is not below the square root; infinity above all doubles."""
    if square <= 0:
        return 0.0
    # The root is found as a whole number of at least 60 bits, over a power of 2.
    bits = square.numerator.bit_length() - square.denominator.bit_length()
    shift = _ROOT_BITS - bits // 2
    scaled = square * Fraction(4) ** shift
    whole = scaled.numerator // scaled.denominator
    root = math.isqrt(whole)
    exact = Fraction(root + (scaled != root**2)) / Fraction(2) ** shift
    try:
        found = float(exact)
    except OverflowError:
        return math.inf
    return found if Fraction(found) >= exact else math.nextafter(found, math.inf)
