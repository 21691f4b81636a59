"""Bounds on the worst case in closed form: several failures, equal norms, free lever arms.

They say what the relaxation of one failure does not. Of free lever arms: with every v_i divided
by its length J is a unit revolute Jacobian, whose residual is at least a proved bound
(docs/bounds.md, section 5).

Of m + 3 joints, two locked, lines in the null space, of dimension 3, say more: more than six
lines of space cannot all meet at large angles, which the mean over failures does not see. With
ε the eigenvalues t/(λ − t), β = Σ ε, p = 1 − β/3 and ρ the sum of the m − 3 least ε,
docs/several_failures.md shows for every J that

    3p ≥ 1/p + (3√p − 1/√p + ρ)²/5 + ρ²/(m − 3),   T/t = m + Σ 1/ε

where 5/√p ≥ (3√p − 1/√p + ρ)(3p + 1).

Roots are found in double precision. What is claimed of them is checked in rational arithmetic,
of the very doubles that are returned.
"""

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cache
from itertools import pairwise
from typing import Any, TypeAlias

from lockedjoint.formulations.measures import eigenvalue_bound
from lockedjoint.nlp.arrays import real_number

# Number of parts of the range of the mean of the least ε.
_PARTS = 400
# Width of the interval of T/t, relative to it, at which the bisection ends.
_WIDTH = 2e-14
# Number of binary digits of a root before it becomes a double.
_ROOT_BITS = 64


def several_locked_bound(
    task_dimension: int, joints: int, trace: float, failures: int
) -> float:
    """Return what t cannot be above, in closed form, whatever the n columns are.

    The least of the mean over failures, `lockedjoint.formulations.measures.eigenvalue_bound`,
    of two formulas that are sharp for k = 2 of m + 2 joints and for m = 2, k = n − 2, and of
    what holds for one joint and one locked less, and for k = 2 of m + 3 `least_ratio`
    (docs/several_failures.md). The arguments are those of that function.
    """
    bounds = [eigenvalue_bound(task_dimension, joints, trace, failures)]
    if not 1 < failures <= joints - task_dimension:
        return bounds[0]
    # What is no mean is rounded up by more than a few operations can lose.
    up, square = 1 + 2.0**-46, math.sin(math.pi / (2 * joints)) ** 2
    if failures == 2 and joints == task_dimension + 2:
        bounds.append(up * trace / (joints - 2 + 0.5 * (1 / square - 2) ** 2))
    if failures == 2 and joints == task_dimension + 3 and task_dimension > 3:
        bounds.append(up * trace / least_ratio(task_dimension))
    if task_dimension == 2 and failures == joints - 2:
        bounds.append(up * trace * 2 * square / joints)
    rest = trace * (joints - 1) / joints
    bounds.append(up * several_locked_bound(task_dimension, joints - 1, rest, failures - 1))
    return min(bounds)


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
        below, above = root_below(p), rational_root_above(p)
    least, most = (3 * root - 1 / root + rho for root in (below, above))
    steep = 5 / above >= most * (3 * p + 1)
    return bool(steep and 1 / p + least**2 / 5 + rho**2 / few > 3 * p)


def with_one_more_locked(task_dimension: int, joints: int, limit: float) -> float:
    """Return an upper limit of tr G of n joints of which k lock, from one for n − 1 and k − 1.

    With tr G = m + s it is (n − m − s)(`limit` − m − s) ≥ s + s²/m (docs/several_failures.md).
    """
    m, more, rest = task_dimension, joints - task_dimension, limit - task_dimension
    middle = more + rest + 1
    root = math.sqrt(middle**2 - 4 * (1 - 1 / m) * more * rest)
    return m + 2 * more * rest / (middle + root)


def isotropic_eigenvalue_bound(
    task_dimension: int, trace: float, fixed: Sequence[float], joints: int
) -> float:
    """Return the largest t of isotropic Jacobians some of whose columns have a fixed norm.

    t = T/m − max_f ‖j_f‖² (Section 2), T = `trace`; `fixed` holds squared norms, and the other
    columns share what they leave of T. It is rounded up; 0 if no such J keeps its rank.
    """
    rest = Fraction(_positive("trace", trace)) - sum(map(Fraction, fixed), Fraction(0))
    largest = max(map(Fraction, fixed), default=Fraction(0))
    if joints > len(fixed):
        largest = max(largest, rest / (joints - len(fixed)))
    exact = max(Fraction(trace) / task_dimension - largest, Fraction(0))
    found = float(exact)
    return found if found >= exact else math.nextafter(found, math.inf)


def isotropic_unit_bound(task_dimension: int, joints: int, failures: int) -> float:
    """Return the largest t of isotropic Jacobians with columns of length 1, of which k lock.

    t = n/m − max_F λ_max(J_FᵀJ_F), and of two lines λ_max = 1 + |cos|. Some two of n lines
    have |cos| of at least Welch's bound; 1/√m if n > m(m + 1)/2; and for m = 3 what
    L. Fejes Tóth (1943) showed of 2n points of a sphere. In the plane any k ≤ n/2 + 1 lines
    count, some k of which are within an angle π(k − 1)/n (docs/atlas_names.md).
    """
    m, n = task_dimension, joints
    cosines = [math.sqrt((n - m) / (m * (n - 1)))]
    if 2 * n > m * (m + 1):
        cosines.append(math.sqrt(1 / m))
    if m == 3:
        cosines.append(0.5 / math.sin(math.pi * n / (6 * (n - 1))) ** 2 - 1)
    longest = [1.0, 1 + max(cosines)][:failures]
    for k in range(2, failures + 1) if m == 2 else ():
        if 2 * (k - 1) <= n:
            one, rest = k // 2, k - k // 2
            turned = math.cos(2 * math.pi * (k - 1) / n)
            longest.append((k + math.sqrt(one**2 + rest**2 + 2 * one * rest * turned)) / 2)
    return max((1 + 2.0**-46) * (n / m - max(longest)), 0.0)


def mean_residual(joints: int) -> float:
    """Return the mean of ρ over all configurations, the unit in which blocks are scaled."""
    return 5 * joints / 3


def largest_residual(joints: int, t: float) -> float:
    """Return an upper bound on ρ_max(t), the largest ½ Σ (λ_k − n/3)² that t allows, n ≥ 7.

    It is proved in rational arithmetic (docs/bounds.md, section 4); −inf if there is no
    spectrum.
    """
    mean = Fraction(joints, 3) - Fraction(_positive("t", t))
    limit = Fraction(joints - 6) / Fraction(t)
    if mean <= 0 or 6 / mean > limit:
        return -math.inf
    largest = max(3 * p * (6 - p) * _largest_spread(p, mean, limit) ** 2 for p in range(1, 6))
    # The conversion is correctly rounded.
    return math.nextafter(float(largest), math.inf)


def _largest_spread(count: int, mean: Fraction, limit: Fraction) -> Fraction:
    """Return a y above all with p/(mean + (6−p)y) + (6−p)/(mean − py) ≤ limit."""

    def allowed(y: Any, mean: Any, limit: Any) -> bool:
        high, low = mean + (6 - count) * y, mean - count * y
        return bool(low > 0 and count / high + (6 - count) / low <= limit)

    # The bisection only suggests where to look: what is returned is checked exactly.
    top = float(mean)
    start = first_double(lambda y: allowed(y, top, float(limit)), top / count)
    step = mean / 2**48
    while allowed(candidate := Fraction(start) + step, mean, limit):
        step *= 2
    return candidate


Excludes: TypeAlias = Callable[[float, float, int], bool]


@cache
def least_excluded(excludes: Excludes, residual: float, joints: int = 7) -> float:
    """Return a singular value that no worst case (5) reaches, from a proved residual."""
    top = math.nextafter(math.sqrt((joints - 6) / 3), math.inf)
    return first_double(lambda sigma: not excludes(residual, sigma, joints), top)


#: Weight of ‖E_x + E_xᵀ‖² in what is bounded from below of isotropic lever arms.
SYMMETRIC_WEIGHT = Fraction(7, 32)
#: Weight of ‖E_x − E_xᵀ‖² there.
SKEW_WEIGHT = Fraction(3, 8)
#: Largest size of it that isotropic arms have whose worst case is looked at.
LEVER_LIMIT = Fraction(17, 200)


def excludes_isotropic(residual: float, sigma: float, joints: int = 7) -> bool:
    """Whether a proved residual of unit revolute joints excludes an isotropic `sigma`.

    True is a proof, False says nothing; of revolute joints with any |v_i| (docs/bounds.md, A).
    """
    delta = Fraction(joints - 6, 3) - Fraction(sigma) ** 2
    if delta < 0:
        return True
    y = joints * delta / (1 + delta)
    return y < 1 and y**2 / 3 + (1 - root_below(1 - y)) ** 2 < Fraction(residual)


def excludes_isotropic_levers(defect: float, sigma: float, joints: int = 7) -> bool:
    """Whether a proved `lever_conditions.lever_defect` excludes an isotropic `sigma`.

    The defect is a lower bound of it where it is at most `LEVER_LIMIT`.
    True is a proof, False says nothing; of revolute joints with any |v_i| (docs/bounds.md, C).
    """
    delta = Fraction(joints - 6, 3) - Fraction(sigma) ** 2
    if delta < 0:
        return True
    y = joints * delta / (1 + delta)
    if y >= 1:
        return False
    beside = 2 * (SYMMETRIC_WEIGHT + SKEW_WEIGHT) * (1 - root_below(1 - y)) ** 2
    return y**2 / 3 + beside < min(Fraction(defect), LEVER_LIMIT)


def excludes_max_min(residual: float, sigma: float, joints: int = 7) -> bool:
    """Whether it excludes a worst case where Σ|v_i|² ≤ n (docs/bounds.md, theorem B).

    Every name bounds a quantity of the proof from above, with E = JJᵀ − (n/3)I, t = σ²,
    u_i = |v_i|² − 1, w_i = ½ j_iᵀEj_i and r_i = 2w_i/c + η − u_i ≥ 0.
    """
    n, t = joints, Fraction(sigma) ** 2
    eta, c = Fraction(n - 6, 3) - t, Fraction(n, 3) - t
    if eta < 0:
        return True
    half = n * eta / (n - 6)
    eigenvalue = 2 * half + rational_root_above(4 * half**2 + 5 * c * half)  # λ_max(E)
    lever = eta + eigenvalue  # u_i
    stretch = rational_root_above(1 + lever)  # |v_i|
    size = rational_root_above(Fraction(6, 5)) * eigenvalue  # ‖E‖_F
    kappa = (2 + lever) * (Fraction(n, 3) + eigenvalue)
    weights = rational_root_above(kappa) / 2 * size  # ‖w‖
    slack = n * eta + size**2 / c  # Σ r_i
    levers = 2 * weights / c + rational_root_above(Fraction(n)) * eta + slack  # ‖u‖
    if 3 * c >= n or eigenvalue >= 5 * c or kappa >= 8 or levers >= 1:
        return False
    shift = slack + n * eta + rational_root_above(Fraction(n)) * weights * eta / c
    along = levers**2 + stretch**2 * shift  # Σ|p_i|
    curvature = (3 - levers) / (2 - levers) ** 2
    across = (curvature * levers**2 + stretch * shift) / 2  # Σ|s_i|
    linear = rational_root_above(8 / (8 - kappa)) * size
    whole = linear + rational_root_above(along**2 + 2 * across**2)
    return whole**2 < 2 * Fraction(residual)


def first_double(is_below: Callable[[float], bool], high: float) -> float:
    """Return where a condition that holds at 0 ends, by bisection; at most `high`."""
    low = 0.0
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if is_below(middle) else (low, middle)
    return high


def root_below(square: Fraction, scale: int = 10**20) -> Fraction:
    """Return a rational number not above the square root, and close to it."""
    root = math.isqrt(square.numerator * scale**2 // square.denominator)
    return Fraction(root, scale)


def rational_root_above(square: Fraction, scale: int = 10**20) -> Fraction:
    """Return a rational number above the square root, and close to it."""
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


def _positive(argument: str, value: float) -> float:
    return real_number(argument, value, "a positive finite number", least=math.ulp(0.0))
