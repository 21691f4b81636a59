"""Two locked joints of m + 3: a bound from lines in the null space, of dimension 3.

More than six lines of space cannot all meet at large angles, which the mean over failures does
not see. With ε the eigenvalues t/(λ − t), β = Σ ε, p = 1 − β/3 and ρ the sum of the m − 3 least
ε, docs/several_failures.md shows for every J of which two joints lock that

    3p ≥ 1/p + (3√p − 1/√p + ρ)²/5 + ρ²/(m − 3),   T/t = m + Σ 1/ε

where 5/√p ≥ (3√p − 1/√p + ρ)(3p + 1).
"""

import math
from fractions import Fraction
from functools import cache
from itertools import pairwise
from typing import Any

# Parts of the range of the mean of the least ε, and the width at which a bisection ends.
_PARTS, _WIDTH = 400, 2e-14
# Roots are rounded to whole numbers over this.
_SCALE = 10**20


@cache
def least_ratio(task_dimension: int) -> float:
    """Return what T/t is proved not to be below with m + 3 joints, two locked, m ≥ 4."""
    m = task_dimension
    low, high = float(m), float(m**2 * (m + 3))
    while high - low > _WIDTH * low:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _proves(m, middle) else (low, middle)
    # So far in double precision.
    while not proves_ratio(m, Fraction(low)):
        low *= 1 - _WIDTH
    return low


def proves_ratio(task_dimension: int, ratio: Fraction) -> bool:
    """Whether T/t is proved not to be below a number, in rational arithmetic."""
    return ratio <= task_dimension or _proves(task_dimension, ratio)


def _proves(m: int, ratio: Any) -> bool:
    # What Σ 1/ε is below, and the mean of the m − 3 least ε therefore above.
    few, limit = m - 3, ratio - m
    first, last = few / limit, m / limit
    means = [first + (last - first) * i / _PARTS for i in range(_PARTS + 1)]
    # The three other ε have at least the mean 3/(limit − few/mean).
    parts = [(few * a, few * a + 9 / (limit - few / b)) for a, b in pairwise(means)]
    return all(_is_excluded(few, *part) for part in [*parts, (few * last, m * last)])


def _is_excluded(few: int, rho: Any, beta: Any) -> bool:
    """Whether the condition is wrong for all ρ and β that are not below these."""
    p = 1 - beta / 3
    if p <= 0 or 3 * p**2 < 1:
        return True
    below: Any = math.sqrt(p)
    above = below
    if isinstance(p, Fraction):
        below = Fraction(math.isqrt(math.floor(p * _SCALE**2)), _SCALE)
        above = below + Fraction(1, _SCALE)
    least, most = (3 * root - 1 / root + rho for root in (below, above))
    steep = 5 / above >= most * (3 * p + 1)
    return bool(steep and 1 / p + least**2 / 5 + rho**2 / few > 3 * p)
