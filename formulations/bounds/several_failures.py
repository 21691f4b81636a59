"""Bounds on the worst case after several failures, in closed form.

J has m rows and n columns, and k joints lock. λ are the m eigenvalues of JJᵀ, and
T = tr JJᵀ = ‖J‖_F² is their sum. t = σ² is the square of the worst case: the least eigenvalue
that JJᵀ keeps without the columns of any k joints. T and t have the unit of squared columns.

Of m + 3 joints, two locked, the lines in the null space of J, of dimension 3, say more than the
mean over failures: more than six lines of space cannot all meet at large angles. With
ε = t/(λ − t) for each eigenvalue, β = Σ ε, p = 1 − β/3, and ρ the sum of the m − 3 least ε,
docs/several_failures.md shows for every J that

    3p ≥ 1/p + (3√p − 1/√p + ρ)²/5 + ρ²/(m − 3)       (1)
    T/t = m + Σ 1/ε                                   (2)

where

    5/√p ≥ (3√p − 1/√p + ρ)(3p + 1).                  (3)

Roots are found in double precision. What is claimed of them is checked in rational arithmetic,
of the very doubles that are returned.
"""

import math
from fractions import Fraction
from functools import cache
from itertools import pairwise
from typing import TypeAlias

from lockedjoint.formulations.bounds.rational_roots import rational_root_above, root_below
from lockedjoint.formulations.measures import eigenvalue_bound

Number: TypeAlias = float | Fraction

# Number of parts of the range of the mean of the least ε. More make the bound a little sharper,
# and the proof slower.
_PARTS = 400
# Width of the interval of T/t, relative to it, at which the bisection ends: above the rounding
# of doubles.
_WIDTH = 2e-14
# Factor by which a bound is raised: more than its few operations in double precision lose.
_ROUNDED_UP = 1 + 2.0**-46


def several_locked_bound(
    task_dimension: int, joints: int, trace: float, failures: int
) -> float:
    """Return what t cannot be above, in closed form, whatever the n columns are.

    It is the least of up to five bounds, all derived in docs/several_failures.md: the mean over
    failures, `lockedjoint.formulations.measures.eigenvalue_bound`; formulas that are sharp for
    k = 2 of m + 2 joints, and for m = 2 and k = n − 2; for k = 2 of m + 3 joints `least_ratio`;
    and the bound for one joint and one locked joint less, which has the trace T(n − 1)/n.

    Parameters
    ----------
    task_dimension
        m.
    joints
        n.
    trace
        T, or more.
    failures
        k, at least 1.
    """
    bounds = [eigenvalue_bound(task_dimension, joints, trace, failures)]
    if not 1 < failures <= joints - task_dimension:
        return bounds[0]
    square = math.sin(math.pi / (2 * joints)) ** 2
    if failures == 2 and joints == task_dimension + 2:
        bounds.append(_ROUNDED_UP * trace / (joints - 2 + 0.5 * (1 / square - 2) ** 2))
    if failures == 2 and joints == task_dimension + 3 and task_dimension > 3:
        bounds.append(_ROUNDED_UP * trace / least_ratio(task_dimension))
    if task_dimension == 2 and failures == joints - 2:
        bounds.append(_ROUNDED_UP * trace * 2 * square / joints)
    rest = trace * (joints - 1) / joints
    bounds.append(
        _ROUNDED_UP * several_locked_bound(task_dimension, joints - 1, rest, failures - 1)
    )
    return min(bounds)


@cache
def least_ratio(task_dimension: int) -> float:
    """Return what T/t is proved not to be below with m + 3 joints, two locked, m ≥ 4."""
    m = task_dimension
    # T/t is at least m. The upper end is far above what can be proved.
    low, high = float(m), float(m**2 * (m + 3))
    while high - low > _WIDTH * low:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _proves(m, middle) else (low, middle)
    # The bisection is in double precision. What is returned is proved in fractions.
    while not proves_ratio(m, Fraction(low)):
        low *= 1 - _WIDTH
    return low


def proves_ratio(task_dimension: int, ratio: Fraction) -> bool:
    """Whether T/t is proved not to be below a number, in rational arithmetic."""
    return ratio <= task_dimension or _proves(task_dimension, ratio)


def _proves(m: int, ratio: Number) -> bool:
    """Whether no J has a T/t below `ratio`, in the arithmetic of `ratio`.

    T/t < `ratio` says Σ 1/ε < `limit` = `ratio` − m. The mean of the m − 3 least ε is therefore
    above `first` = (m − 3)/`limit`. What lies between `first` and `last` is cut into `_PARTS`
    parts; one more part is all means from `last` on. ρ and β have a lower bound on each part.
    The proof holds if these exclude every part.
    """
    few = m - 3
    limit = ratio - m
    first = few / limit
    last = m / limit
    means = [first + (last - first) * i / _PARTS for i in range(_PARTS + 1)]
    # A mean in [a, b] leaves less than limit − few/b for Σ 1/ε of the three other ε, so that
    # their sum is above 9/(limit − few/b).
    parts = [(few * a, few * a + 9 / (limit - few / b)) for a, b in pairwise(means)]
    # The three other ε are not below the mean either, once it is `last` or more.
    parts.append((few * last, m * last))
    return all(_is_excluded(few, rho, beta) for rho, beta in parts)


def _is_excluded(few: int, rho: Number, beta: Number) -> bool:
    """Whether the inequality (1) of the header is wrong for all ρ and β from these on.

    `few` is m − 3. `below` and `above` enclose √p, and `least` and `most` 3√p − 1/√p + ρ.
    """
    p = 1 - beta / 3
    # No √p exists, or the right side, at least 1/p, is above 3p.
    if p <= 0 or 3 * p**2 < 1:
        return True
    below: Number = math.sqrt(p)
    above = below
    if isinstance(p, Fraction):
        below, above = root_below(p), rational_root_above(p)
    least, most = (3 * root - 1 / root + rho for root in (below, above))
    # Inequality (3): where it holds, larger ρ and β are excluded as well.
    steep = 5 / above >= most * (3 * p + 1)
    # Inequality (1) is wrong even with its least right side.
    wrong = 1 / p + least**2 / 5 + rho**2 / few > 3 * p
    return bool(steep and wrong)


def with_one_more_locked(task_dimension: int, joints: int, limit: float) -> float:
    """Return an upper limit of tr G of n joints of which k lock, from one for n − 1 and k − 1.

    G = Jᵀ(JJᵀ − tI)⁻¹J has the trace m + s, s = Σ ε, and s satisfies
    (n − m − s)(`limit` − m − s) ≥ s + s²/m (docs/several_failures.md). With a = n − m and
    b = `limit` − m this is (1 − 1/m)s² − (a + b + 1)s + ab ≥ 0: s is at most the smaller root.
    """
    m, a, b = task_dimension, joints - task_dimension, limit - task_dimension
    middle = a + b + 1
    root = math.sqrt(middle**2 - 4 * (1 - 1 / m) * a * b)
    # The smaller root without a difference of nearly equal numbers.
    return m + 2 * a * b / (middle + root)
