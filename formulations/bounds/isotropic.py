"""Bounds on the worst case of isotropic Jacobians, in closed form.

J has m rows and n columns j_f, and JJᵀ = (T/m)I with T = ‖J‖_F². J_F holds the k columns of the
joints F that lock, and t is the square of the worst case over all F:

    t = T/m − max_F λ_max(J_FᵀJ_F),

for one locked joint t = T/m − max_f |j_f|². A bound on t is a lower bound on that maximum. T
and t have the unit of squared columns; the worst case σ is √t.
"""

import math
from collections.abc import Sequence
from fractions import Fraction

from lockedjoint.nlp.arrays import real_number

# Factor by which a bound is raised: more than its few operations in double precision lose.
_ROUNDED_UP = 1 + 2.0**-46


def isotropic_eigenvalue_bound(
    task_dimension: int, trace: float, fixed: Sequence[float], joints: int
) -> float:
    """Bound t of isotropic Jacobians some of whose columns have a fixed norm, one joint locked.

    The largest column is at least as long as the longest fixed one, and as the mean of the
    others, which share what the fixed ones leave of T.

    Parameters
    ----------
    task_dimension
        m.
    trace
        T, above 0.
    fixed
        Squared norms of the columns that have a fixed one.
    joints
        n.

    Returns
    -------
    float
        The bound on t = T/m − max_f |j_f|² (Section 2), rounded up; 0 if no such J keeps its
        rank.
    """
    rest = Fraction(
        real_number("trace", trace, "a positive finite number", least=math.ulp(0.0))
    ) - sum(map(Fraction, fixed), Fraction(0))
    largest = max(map(Fraction, fixed), default=Fraction(0))
    if joints > len(fixed):
        largest = max(largest, rest / (joints - len(fixed)))
    exact = max(Fraction(trace) / task_dimension - largest, Fraction(0))
    found = float(exact)
    return found if found >= exact else math.nextafter(found, math.inf)


def isotropic_unit_bound(task_dimension: int, joints: int, failures: int) -> float:
    """Bound t of isotropic Jacobians with columns of length 1, of which k = `failures` lock.

    m is `task_dimension` and n is `joints`; T = n. The result is rounded up, or 0.

    t = n/m − max_F λ_max(J_FᵀJ_F), and of two lines λ_max = 1 + |cos|. Some two of n lines
    have |cos| of at least Welch's bound √((n − m)/(m(n − 1))); 1/√m if n > m(m + 1)/2; and for
    m = 3 what L. Fejes Tóth (1943) showed of 2n points of a sphere. In the plane any
    k ≤ n/2 + 1 lines count, some k of which are within an angle π(k − 1)/n
    (docs/atlas_names.md).
    """
    m, n = task_dimension, joints
    cosines = [math.sqrt((n - m) / (m * (n - 1)))]
    if 2 * n > m * (m + 1):
        cosines.append(math.sqrt(1 / m))
    if m == 3:
        cosines.append(0.5 / math.sin(math.pi * n / (6 * (n - 1))) ** 2 - 1)
    # Lower bounds on max_F λ_max(J_FᵀJ_F) for one column, two, and in the plane k of them.
    longest = [1.0, 1 + max(cosines)][:failures]
    for k in range(2, failures + 1) if m == 2 else ():
        if 2 * (k - 1) <= n:
            # The k lines within an angle have the least λ_max if they are two bundles, of k//2
            # and the rest, at its two ends. It is (k + |one + rest · e^{2i·angle}|)/2.
            one, rest = k // 2, k - k // 2
            turned = math.cos(2 * math.pi * (k - 1) / n)
            longest.append((k + math.sqrt(one**2 + rest**2 + 2 * one * rest * turned)) / 2)
    return max(_ROUNDED_UP * (n / m - max(longest)), 0.0)
