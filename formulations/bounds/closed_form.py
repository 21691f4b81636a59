"""The best worst case after locked joints, in closed form: eq. (6) and what generalises it.

Let M = JJᵀ and t = min_f λ_min(M − j_f j_fᵀ), the square of the measure (5). If t > 0, each of
the n conditions M − j_f j_fᵀ ⪰ tI says j_fᵀ(M − tI)⁻¹j_f ≤ 1, and their sum is

    t · tr((M − tI)⁻¹) ≤ n − m.

Only M occurs, so whatever is known of the trace of M, or of the traces of its diagonal blocks,
bounds t. By convexity the largest t is met where each block is a multiple of the identity.

**Several locked joints.** Let T = tr M and let t be the minimum of λ_min(M − J_F J_Fᵀ) over
all sets F of k joints.

For the spectrum of M: if x < t then det(xI − M + J_F J_Fᵀ) has the sign (−1)^m for every F,
hence so has its mean over all F, and no real root of the mean polynomial lies below t. By
Cauchy–Binet each coefficient, a sum of squared minors, loses the same share on average,

    p_k(x) = Σ_r (−1)^r e_r(M) C(n−r, k)/C(n, k) x^{m−r},

with e_r the elementary symmetric functions of the eigenvalues of M. Up to a constant this is

    x^{k−(n−m)} (d/dx)^k [x^{n−m} det(xI − M)],

the k-th derivative of the characteristic polynomial of JᵀJ, so by Rolle's theorem all m roots
are real: t is at most the least of them, μ_k(M).

For the trace: Π_i (x − λ_i) · x^{n−m} is hyperbolic in (x, λ) in the direction x; so is its
k-th derivative in that direction, and so is any factor of that, in particular p_k(x; λ). The
least root of a hyperbolic polynomial is concave in λ (Gårding, 1959). It is symmetric in λ
besides, so it is largest where all λ_i are equal:

    t ≤ (T/m) y,   y the least root of y^{k−(n−m)} (d/dy)^k [y^{n−m} (y − 1)^m],

by Rodrigues' formula the least zero of the Jacobi polynomial P_d^{(α, β)}(2y − 1) with
d = min(k, m), α = |m − k|, β = n − m − k. For k = 1 that is (n − m)/n, eq. (6). For k = 2 it
is 1 − m/n − √(m(n−m)/(n−1))/n, which equiangular tight frames attain, the optimal frames for
two erasures (Holmes and Paulsen, 2004): three rows and the six diagonals of the icosahedron,
six rows and sixteen columns.

Where only the trace is known the bound is `formulations.measures.eigenvalue_bound`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

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
        The root t of Σ_B m_B/(T_B/m_B − t) = (n − m)/t below every T_B/m_B.

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
    low, high = 0.0, min(means)
    # f(t) = t Σ m_B/(mean_B − t) rises from 0 to infinity, so bisection cannot miss the root.
    while low < (middle := 0.5 * (low + high)) < high:
        shares = (size / (mean - middle) for size, mean in zip(sizes, means, strict=True))
        spent = middle * sum(shares)
        low, high = (middle, high) if spent < redundancy else (low, middle)
    return high


def positive(argument: str, value: float) -> float:
    """Return a number as a float; raise InputError unless it is positive and finite."""
    if not (math.isfinite(value) and value > 0):
        raise InputError(argument, value, "a positive finite number")
    return float(value)
