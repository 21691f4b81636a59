"""Closed forms that bound entries of the atlas, decided in rational arithmetic.

But for `proves_ratio` and `excludes_eigenvalue`, no function here shares code with
`lockedjoint.formulations.bounds`, which finds these numbers. The theorems are in
docs/several_failures.md, docs/bounds.md and docs/atlas_names.md; each function states its own.

J is a Jacobian of shape (m, n), one column per joint; F is any set of k joints that lock, and
A_F = J_F̄J_F̄ᵀ without their columns. T = ‖J‖_F². What is bounded is the entry's measure: the
worst case σ = √t, t the least eigenvalue of all A_F; or the least relative manipulability,
√(det A_F/det JJᵀ); or the least reciprocal condition number of J_F̄. `square` is the square of a
stated bound. A function ``…_prove`` or ``…_proves`` says whether it is proved that no squared
measure is above it; False says that *this* argument does not prove it. Numbers are fractions
without a unit. Roots are rounded down, and sines up, so that nothing is claimed that is false.
"""

from fractions import Fraction
from math import comb, factorial

from lockedjoint.formulations import condition, isotropy
from lockedjoint.formulations.atlas.entry import Entry
from lockedjoint.formulations.bounds.rational_roots import root_below
from lockedjoint.formulations.bounds.several_failures import proves_ratio
from lockedjoint.formulations.bounds.two_sliders import excludes_eigenvalue, has_two_sliders
from lockedjoint.formulations.joints.kinds import LeverRevolute, Prismatic

# A rational number above π by less than 1e-21.
_ABOVE_PI = Fraction(3141592653589793238463, 10**21)
# Number of terms of the sine's power series at this number over 2 or more. The last one is
# positive, so that their sum is above the sine; with fewer terms it would be farther above.
_SINE_TERMS = 9


def closed_form_proves(asked: Entry, square: Fraction) -> bool:
    """Whether a closed form proves that an entry's squared measure is at most `square`."""
    m, n, k = asked.task_dimension, asked.joints, asked.failures
    # Each measure has closed forms of its own.
    if asked.relative:
        return _minors_prove(m, n, k, square)
    if asked.formulation == condition.NAME:
        return _determinants_prove(m, n, k, square)
    if has_two_sliders(asked.arm) and excludes_eigenvalue(square):
        return True
    joints = asked.arm.joints
    norms = [Fraction(joint.largest_norm_squared) for joint in joints]
    if several_failures_prove(m, n, k, square / sum(norms)):
        return True
    if asked.model == "free" and asked.formulation == isotropy.NAME:
        return _unit_columns_prove(m, n, k, square)
    if asked.model.startswith("free"):
        return False
    # The rotational rows alone have the r revolute joints, with T = r at most; the linear rows
    # have all joints, and what is left of T. Each bounds J: the least singular value of some of
    # its rows is at least that of all.
    r = Fraction(sum(not isinstance(joint, Prismatic) for joint in joints))
    linear = sum(norms) - r
    by_rows = several_failures_prove(3, int(r), k, square / r) or several_failures_prove(
        3, n, k, square / linear
    )
    if by_rows or asked.formulation != isotropy.NAME:
        return by_rows
    # Isotropic: JJᵀ = (T/m)I, and after the loss of column j its least eigenvalue is T/m −
    # |j|². The three rotational rows have r, so that T = 2r, and some column has at least the
    # mean of the squared norm that fixed ones leave.
    fixed = [
        norm
        for norm, joint in zip(norms, joints, strict=True)
        if not isinstance(joint, LeverRevolute)
    ]
    largest = max([*fixed, (2 * r - sum(fixed)) / max(n - len(fixed), 1)])
    return square >= 2 * r / m - largest


def several_failures_prove(m: int, n: int, k: int, share: Fraction) -> bool:
    """Whether t/T ≤ `share` is proved, t the squared worst case of n columns, T = ‖J‖_F².

    The closed forms are derived in docs/several_failures.md, with s = sin(π/2n): for n = m + 2
    and k = 2, T/t ≥ n − 2 + ½(1/s² − 2)²; for m = 2 and k = n − 2, t ≤ 2Ts²/n; for
    n = m + 3 and k = 2 what `proves_ratio` decides; and always the mean over failures.
    """
    # Fewer columns than rows are left: t = 0.
    if k > n - m:
        return share >= 0
    # What holds after fewer failures holds after k. Without its longest column J keeps at most
    # (n − 1)/n of T, and k − 1 of the others may lock.
    if k > 1 and several_failures_prove(m, n, k - 1, share):
        return True
    if k > 1 and several_failures_prove(m, n - 1, k - 1, share * n / (n - 1)):
        return True
    s_squared = _sine_above(2 * n) ** 2
    if k == 2 and n == m + 2 and share * (n - 2 + (1 / s_squared - 2) ** 2 / 2) >= 1:
        return True
    if k == 2 and n == m + 3 > 6 and share > 0 and proves_ratio(m, 1 / share):
        return True
    if m == 2 and k == n - 2 and share >= 2 * s_squared / n:
        return True
    # The mean is largest for isotropic J, with T = m where JJᵀ = I.
    return _mean_proves(m, n, k, m * share)


def _mean_proves(m: int, n: int, k: int, y: Fraction) -> bool:
    """Whether the mean of det(xI − A_F) over F changes its sign in [0, y], for JJᵀ = I.

    Its least root is then at most y, and some A_F has no larger least eigenvalue. The mean
    starts with p = (x − 1)^m; after the loss of one of N columns it is p + (xp′ − mp)/N, so
    that the coefficient of x^i is multiplied by 1 + (i − m)/N. The list `p` has the
    coefficients, that of x⁰ first.
    """
    p = [Fraction((-1) ** (m - i) * comb(m, i)) for i in range(m + 1)]
    for columns in range(n, n - k, -1):
        p = [c * (1 + Fraction(i - m, columns)) for i, c in enumerate(p)]
    value = sum(c * y**i for i, c in enumerate(p))
    return value == 0 or (value > 0) != (p[0] > 0)


def _minors_prove(m: int, n: int, k: int, square: Fraction) -> bool:
    """Whether no least squared relative manipulability is above `square`.

    The squares of all k-failures have the mean C(n − k, m)/C(n, m) (Cauchy and Binet). For
    n = m + 2 and k = 2, and for m = 2 and k = n − 2, no least square is above (2 sin(π/n)/n)².
    For k = 2 and 2n > r(r + 1), r = n − m, none is above r²(r − 1)/((r + 2)nm). The failure of
    some one joint leaves a square of (n − m)/n at most, and k − 1 of the others may lock
    (docs/several_failures.md).
    """
    if square >= Fraction(comb(n - k, m), comb(n, m)):
        return True
    if k == n - m > 1 and 2 in (m, k) and square >= (2 * _sine_above(n) / n) ** 2:
        return True
    r = n - m
    if k == 2 and 2 * n > r * (r + 1) and square * (r + 2) * n * m >= r**2 * (r - 1):
        return True
    return k > 1 and _minors_prove(m, n - 1, k - 1, square * n / (n - m))


def _unit_columns_prove(m: int, n: int, k: int, square: Fraction) -> bool:
    """Whether t ≤ `square` is proved of isotropic columns of length 1: by cosines of lines.

    T = n, so that JJᵀ = (n/m)I, and the loss of the columns J_F leaves n/m less the largest
    eigenvalue of J_FJ_Fᵀ: for two columns 1 + |cosine|. Of n lines in m dimensions some two
    have |cosine| ≥ `largest`: Welch's √((n − m)/(m(n − 1))), 1/√m where 2n > m(m + 1), and in
    space L. Fejes Tóth's for the 2n ends of the lines, 1/(2 sin²(nπ/(6(n − 1)))) − 1. In the
    plane some k columns that are neighbours have a larger eigenvalue (docs/atlas_names.md).
    """
    largest = root_below(Fraction(n - m, m * (n - 1)))
    if 2 * n > m * (m + 1):
        largest = max(largest, root_below(Fraction(1, m)))
    if m == 3:
        largest = max(largest, 1 / (2 * _sine_above(Fraction(6 * (n - 1), n)) ** 2) - 1)
    longest = [1 + largest if k > 1 else Fraction(1)]
    for few in range(2, min(k, n // 2 + 1) + 1) if m == 2 else ():
        # a columns at one end of an arc of φ = 2π(few − 1)/n and b at the other, at twice their
        # angles: |a + b exp(iφ)|² = (a + b)² − 4ab sin²(φ/2). Half of few and this length is
        # the eigenvalue.
        turned = 4 * (few // 2) * (few - few // 2) * _sine_above(Fraction(n, few - 1)) ** 2
        longest.append((few + root_below(few**2 - turned)) / 2)
    return square >= Fraction(n, m) - max(longest)


def _determinants_prove(m: int, n: int, k: int, square: Fraction) -> bool:
    """Whether no least λ_min/λ_max of A_F, over all sets F of k joints, is above `square`.

    An A_F of trace τ and at least this ratio ρ has at least the determinant c τ^m, with
    c = min_p ρ^p/(pρ + m − p)^m over the number p of small eigenvalues. The mean of the
    determinants is known, and c is at most `limit`. Two lines that are left in the plane, of n,
    have ρ ≤ tan²(π/2n). What m − 1 rows of n − 1 columns cannot have, or n − 1 columns with
    k − 1 failures, m of n with k cannot (docs/atlas_names.md).
    """
    limit = Fraction(comb(n - m, k), comb(n, k)) * Fraction(n, (n - k) * m) ** m
    rho = square
    if k > n - m or all(rho**p >= limit * (p * rho + m - p) ** m for p in range(1, m)):
        return True
    sine_squared = _sine_above(2 * n) ** 2
    if m == 2 and k == n - 2 and rho >= sine_squared / (1 - sine_squared):
        return True
    if (m, n, k) == (3, 5, 2) and _pentagon_proves(square):
        return True
    if m > 2 and _determinants_prove(m - 1, n - 1, k, square):
        return True
    return k > 1 and _determinants_prove(m, n - 1, k - 1, square)


def _pentagon_proves(square: Fraction) -> bool:
    """Whether κ ≥ tan(θ/2), sin θ = (√5 − 1)/2, for κ² = `square` below 1.

    Of five columns in space, any three of which have to remain, no least σ_min/σ_max is above
    tan(θ/2) (docs/several_failures.md). sin²θ = (3 − √5)/2 is to be at most the squared sine of
    2 arctan κ, 4κ²/(1 + κ²)²; `rest` is 3 less twice this square, to be at most √5.
    """
    rest = 3 - 8 * square / (1 + square) ** 2
    return square >= 1 or rest <= 0 or rest**2 <= 5


def _sine_above(parts: int | Fraction) -> Fraction:
    """Return a number above sin(π/parts), by less than 1e-13, for at least two parts."""
    x = _ABOVE_PI / parts
    terms = ((-1) ** i * x ** (2 * i + 1) / factorial(2 * i + 1) for i in range(_SINE_TERMS))
    return sum(terms, Fraction(0))
