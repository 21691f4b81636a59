"""The best worst case after one locked joint, in closed form: eq. (6) by blocks of rows.

Let M = JJᵀ and t = min_f λ_min(M − j_f j_fᵀ), the square of the measure (5). If t > 0, each of
the n conditions M − j_f j_fᵀ ⪰ tI says j_fᵀ(M − tI)⁻¹j_f ≤ 1, and their sum is

    t · tr((M − tI)⁻¹) ≤ n − m.

Only M occurs, so whatever is known of the trace of M, or of the traces of its diagonal blocks,
bounds t. By convexity the largest t is met where each block is a multiple of the identity.

Where only the trace is known the bound is `formulations.measures.eigenvalue_bound`, which has
it for several locked joints too; `several_locked_bound` is sharper there where few joints are
left over. docs/several_failures.md derives both.

Roots are found in double precision. What is claimed of them is checked in rational arithmetic,
in which there is no rounding, of the very doubles that are returned.
"""

import math
from collections.abc import Callable, Sequence
from fractions import Fraction

from formulations.measures import eigenvalue_bound
from nlp.arrays import whole_number
from nlp.errors import InputError


def block_trace_bound(joints: int, sizes: Sequence[int], traces: Sequence[float]) -> float:
    """Return the largest possible t when traces of the diagonal blocks of JJᵀ are limited.

    Parameters
    ----------
    joints
        Number n of columns of J.
    sizes
        Numbers of rows m_B of the blocks, adding up to m < n.
    traces
        Upper limit T_B of the trace of each block, in the squared units of its rows.

    Returns
    -------
    float
        The root t of Σ_B m_B/(T_B/m_B − t) = (n − m)/t below every T_B/m_B, rounded up: a
        double that is not below the root.

    Raises
    ------
    InputError
        Unless sizes are positive, as many as the traces, add up to less than n, and the traces
        are positive and finite.
    """
    if len(sizes) != len(traces) or not sizes or min(sizes) < 1:
        raise InputError("sizes", list(sizes), "one positive size for each trace")
    redundancy = whole_number("joints", joints, sum(sizes) + 1) - sum(sizes)
    means = [
        positive("traces", trace) / size for trace, size in zip(traces, sizes, strict=True)
    ]

    def is_below(t: float) -> bool:
        shares = (size / (mean - t) for size, mean in zip(sizes, means, strict=True))
        return t * sum(shares) < redundancy

    # f(t) = t Σ m_B/(mean_B − t) rises from 0 to infinity, so bisection cannot miss the root.
    high = first_double(is_below, 0.0, min(means))
    exact = [(Fraction(trace) / size, size) for size, trace in zip(sizes, traces, strict=True)]
    while _spent(exact, Fraction(high)) < redundancy:
        high = math.nextafter(high, math.inf)
    return high


def several_locked_bound(task_dimension: int, joints: int, trace: float, locked: int) -> float:
    """Return what t cannot be above, in closed form, whatever the n columns are.

    The least of these (docs/several_failures.md):

    - the mean over failures, `formulations.measures.eigenvalue_bound`;
    - n = m + 2, k = 2: T/t ≥ n − 2 + ½(1/s² − 2)², s = sin(π/2n), attained for every m;
    - m = 2, k = n − 2: T/t ≥ n/(2s²), attained by n lines at equal angles;
    - (n − 1)/n times the same for n − 1 joints of which k − 1 lock, because J without its
      longest column keeps at most that share of T.

    Parameters
    ----------
    task_dimension, joints, trace, locked
        As of `formulations.measures.eigenvalue_bound`.

    Raises
    ------
    InputError
        If a number is out of range.
    """
    bounds = [eigenvalue_bound(task_dimension, joints, trace, locked)]
    if not 1 < locked <= joints - task_dimension:
        return bounds[0]
    # What is no mean is rounded up by more than a few operations can lose.
    up, square = 1 + 2.0**-46, math.sin(math.pi / (2 * joints)) ** 2
    if locked == 2 and joints == task_dimension + 2:
        bounds.append(up * trace / (joints - 2 + 0.5 * (1 / square - 2) ** 2))
    if task_dimension == 2 and locked == joints - 2:
        bounds.append(up * trace * 2 * square / joints)
    rest = trace * (joints - 1) / joints
    bounds.append(up * several_locked_bound(task_dimension, joints - 1, rest, locked - 1))
    return min(bounds)


def with_one_more_locked(task_dimension: int, joints: int, limit: float) -> float:
    """Return an upper limit of tr G of n joints of which k lock, from one for n − 1 and k − 1.

    G = Jᵀ(M − tI)⁻¹J, and tr G = m + s with t ≤ (T/m)(1 − m/tr G). Without any one column the
    trace is at most `limit`, above m; weighted by 1 − G_ff, these n conditions add up to
    (n − m − s)(`limit` − m − s) ≥ s + s²/m (docs/several_failures.md).
    """
    m, more, rest = task_dimension, joints - task_dimension, limit - task_dimension
    middle = more + rest + 1
    root = math.sqrt(middle**2 - 4 * (1 - 1 / m) * more * rest)
    return m + 2 * more * rest / (middle + root)


def isotropic_eigenvalue_bound(
    task_dimension: int, trace: float, fixed: Sequence[float], joints: int
) -> float:
    """Return the largest t of isotropic Jacobians some of whose columns have a fixed norm.

    For isotropic J the measure (5) has the square t = T/m − max_f ‖j_f‖² (Section 2), and the
    columns of any norm share what the others leave of T: the largest of them has at least its
    mean.

    T = ‖J‖_F² is the same for every isotropic J of the arm; `fixed` holds the squared norms of
    the columns that have a fixed one. The bound is rounded up; 0 if no such J keeps its rank.
    """
    rest = Fraction(positive("trace", trace)) - sum(map(Fraction, fixed), Fraction(0))
    largest = max(map(Fraction, fixed), default=Fraction(0))
    if joints > len(fixed):
        largest = max(largest, rest / (joints - len(fixed)))
    exact = max(Fraction(trace) / task_dimension - largest, Fraction(0))
    found = float(exact)
    return found if Fraction(found) >= exact else math.nextafter(found, math.inf)


def mean_residual(joints: int) -> float:
    """Return the mean of ρ over all configurations, the unit in which blocks are scaled."""
    return 5 * joints / 3


def largest_residual(joints: int, t: float) -> float:
    """Return an upper bound on ρ_max(t), the largest ½ Σ (λ_k − n/3)² that t allows.

    It is proved in rational arithmetic, and above ρ_max(t) by less than 1e-9 of it, as long as
    ρ_max(t) is not tiny. It is −inf if t, a positive lower bound on the squared worst case of n
    ≥ 7 unit revolute joints, allows no spectrum at all.

    Notes
    -----
    With d = λ − t > 0 the conditions are Σ d_k = 6c, c = n/3 − t, and Σ 1/d_k ≤ (n − 6)/t: a
    compact set. If all d_k = c, ρ = 0. Any other maximum of ½ Σ (d_k − c)² has the second
    condition active, since the function is convex, and the gradients of both are independent.
    So d³ − a d² + ν = 0 for all six d and some a and ν ≥ 0: at most two positive roots.
    Hence p eigenvalues are (6−p)y above the mean and the others py below it, 1 ≤ p ≤ 5, and
    ρ = 3p(6−p)y². There p/(c + (6−p)y) + (6−p)/(c − py) grows with y ≥ 0, as it is convex and
    has slope 0 at y = 0. So any y at which it exceeds (n − 6)/t is above all that are allowed.
    """
    mean = Fraction(joints, 3) - Fraction(positive("t", t))
    limit = Fraction(joints - 6) / Fraction(t)
    if mean <= 0 or 6 / mean > limit:
        return -math.inf
    largest = max(3 * p * (6 - p) * _largest_spread(p, mean, limit) ** 2 for p in range(1, 6))
    # The conversion is correctly rounded.
    return math.nextafter(float(largest), math.inf)


def _largest_spread(count: int, mean: Fraction, limit: Fraction) -> Fraction:
    """Return a y above all with p/(mean + (6−p)y) + (6−p)/(mean − py) ≤ limit."""

    def allowed(y: Fraction) -> bool:
        high, low = mean + (6 - count) * y, mean - count * y
        return low > 0 and count / high + (6 - count) / low <= limit

    def seems_allowed(y: float) -> bool:
        high, low = float(mean) + (6 - count) * y, float(mean) - count * y
        return count / high + (6 - count) / low <= float(limit)

    # The bisection only suggests where to look: what is returned is checked exactly.
    start = Fraction(first_double(seems_allowed, 0.0, float(mean) / count))
    step = Fraction(mean) / 2**48
    while allowed(candidate := start + step):
        step *= 2
    return candidate


def first_double(is_below: Callable[[float], bool], low: float, high: float) -> float:
    """Return where a condition that holds at `low` ends, by bisection; at most `high`."""
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if is_below(middle) else (low, middle)
    return high


def _spent(spectrum: Sequence[tuple[Fraction, int]], t: Fraction) -> Fraction | float:
    """Return t Σ m/(λ − t) over eigenvalues λ with multiplicities m; infinite at λ ≤ t."""
    if any(value <= t for value, _ in spectrum):
        return math.inf
    return t * sum(Fraction(many) / (value - t) for value, many in spectrum)


def root_below(square: Fraction, scale: int = 10**20) -> Fraction:
    """Return a rational number not above the square root, and close to it."""
    root = math.isqrt(square.numerator * scale**2 // square.denominator)
    return Fraction(root, scale)


def rational_root_above(square: Fraction, scale: int = 10**20) -> Fraction:
    """Return a rational number above the square root, and close to it."""
    return root_below(square, scale) + Fraction(1, scale)


def root_above(square: Fraction) -> float:
    """Return a double that is not below the square root, and close to it."""
    root = math.sqrt(square)
    while Fraction(root) ** 2 < square:
        root = math.nextafter(root, math.inf)
    return root


def positive(argument: str, value: float) -> float:
    """Return a number as a float; raise InputError unless it is positive and finite."""
    if not (math.isfinite(value) and value > 0):
        raise InputError(argument, value, "a positive finite number")
    return float(value)
