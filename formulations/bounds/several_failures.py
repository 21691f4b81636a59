"""The best worst case after k locked joints, bounded for every Jacobian: eq. (6) for k > 1.

Let M = JJᵀ, T = tr M and t = min over all sets F of k joints of λ_min(M − J_F J_Fᵀ).

**For the spectrum of M.** If x < t then det(xI − M + J_F J_Fᵀ) has the sign (−1)^m for every F,
hence so has its mean over all F, and no real root of the mean polynomial lies below t. By
Cauchy–Binet each coefficient, a sum of squared minors, loses the same share on average,

    p_k(x) = Σ_r (−1)^r e_r(M) C(n−r, k)/C(n, k) x^{m−r},

with e_r the elementary symmetric functions of the eigenvalues of M. Up to a constant this is

    x^{k−(n−m)} (d/dx)^k [x^{n−m} det(xI − M)],

the k-th derivative of the characteristic polynomial of JᵀJ, so by Rolle's theorem all m roots
are real: t is at most the least of them, μ_k(M).

**For the trace.** Π_i (x − λ_i) · x^{n−m} is hyperbolic in (x, λ) in the direction x; so is its
k-th derivative in that direction, and so is any factor of that, in particular p_k(x; λ). The
least root of a hyperbolic polynomial is concave in λ (Gårding, 1959). It is symmetric in λ
besides, so it is largest where all λ_i are equal:

    t ≤ (T/m) y,   y the least root of y^{k−(n−m)} (d/dy)^k [y^{n−m} (y − 1)^m],

by Rodrigues' formula the least zero of the Jacobi polynomial P_d^{(α, β)}(2y − 1) with
d = min(k, m), α = |m − k|, β = n − m − k. For k = 1 that is (n − m)/n, eq. (6). For k = 2 it
is 1 − m/n − √(m(n−m)/(n−1))/n, which equiangular tight frames attain, the optimal frames for
two erasures (Holmes and Paulsen, 2004): three rows and the six diagonals of the icosahedron,
six rows and sixteen columns.
"""

from __future__ import annotations

import numpy.typing as npt
from scipy.special import roots_jacobi

from formulations import measures
from formulations.bounds.closed_form import check_dimensions, check_trace
from nlp.arrays import whole_number
from nlp.errors import InputError


def largest_eigenvalue_bound(
    joints: int, task_dimension: int, locked: int, *, trace: float | None = None
) -> float:
    """Return the largest t that any m×n Jacobian can keep after k joints lock.

    Computed as a zero of a Jacobi polynomial; `measures.sigma_bound` has its square root by
    another way.

    Parameters
    ----------
    joints
        Number n of columns of J.
    task_dimension
        Number m of rows of J, less than n.
    locked
        How many joints lock at once, k, at most n − m.
    trace
        tr JJᵀ, in the squared units of J. By default m, which is σ = 1 for an isotropic J.

    Raises
    ------
    InputError
        Unless 1 ≤ m < n, 1 ≤ k ≤ n − m and the trace is positive and finite.
    """
    n, m = joints, task_dimension
    check_dimensions(n, m)
    k = whole_number("locked", locked, 1)
    if k > n - m:
        raise InputError("locked", k, f"at most the degree of redundancy, {n - m}")
    total = check_trace("trace", m if trace is None else trace)
    zeros, _ = roots_jacobi(min(k, m), abs(m - k), n - m - k)
    return float(total / m * (1.0 + zeros[0]) / 2.0)


def spectrum_bound(jacobian: npt.ArrayLike, locked: int = 1) -> float:
    """Return μ_k(JJᵀ): no J with these singular values keeps more after k joints lock.

    A bound on t, the square of the measure (5); never above `largest_eigenvalue_bound` at the
    trace of J.

    Raises
    ------
    InputError
        If the array is no Jacobian or k is not in 1 … n − m.
    """
    squares = measures.singular_values(jacobian) ** 2
    joints = measures.as_jacobian(jacobian).shape[1]
    return float(measures.averaged_spectrum(squares, joints, locked)[0])
