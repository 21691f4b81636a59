"""What a worst case σ² ≥ t demands of the eigenvalues of JJᵀ, and the bound that follows.

If M − j_f j_fᵀ ⪰ tI for every joint f, then t Σ_k 1/(λ_k − t) ≤ n − 6 for the eigenvalues λ of
M = JJᵀ (see `closed_form`), and Σ λ_k = 2n for unit revolute columns. Hence
ρ = ½ Σ (λ_k − n/3)² is at most some ρ_max(t), which falls as t grows. So if no Jacobian has ρ
below a bound, none has a t for which ρ_max(t) is below that bound.
"""

from __future__ import annotations

from math import inf, isfinite, nextafter, sqrt

from nlp.errors import InputError


def largest_residual(joints: int, t: float) -> float:
    """Return ρ_max(t), the largest ½ Σ (λ_k − n/3)² that t allows; −inf if it allows none.

    Parameters
    ----------
    joints
        Number n of unit revolute joints, at least 7.
    t
        A positive lower bound on the squared worst case.

    Notes
    -----
    With d = λ − t, a maximum has d³ − a d² + ν = 0 for all six d and some a and ν ≥ 0, which
    has at most two positive roots. So p eigenvalues are (6−p)y above the mean and the others
    py below it, p = 1 … 5, and y is where the condition holds with equality.
    """
    if not (isfinite(t) and t > 0):
        raise InputError("t", t, "a positive finite number")
    mean, limit = joints / 3 - t, (joints - 6) / t
    if mean <= 0 or 6 / mean > limit:
        return -inf
    return max(3 * p * (6 - p) * _largest_spread(p, mean, limit) ** 2 for p in range(1, 6))


def worst_case_limit(joints: int, residual: float) -> float:
    """Return an upper bound on the worst case σ from a lower bound on the residual ρ.

    Parameters
    ----------
    joints
        Number n of unit revolute joints, at least 7.
    residual
        A lower bound on ½‖JJᵀ − (n/3)I‖_F² of all of them.

    Raises
    ------
    InputError
        If there are fewer than 7 joints or the bound is negative or not finite.
    """
    if joints < 7:
        raise InputError("joints", joints, "an integer of at least 7")
    if not (isfinite(residual) and residual >= 0):
        raise InputError("residual", residual, "a finite number, not negative")
    low, high = 0.0, (joints - 6) / 3
    while low < (middle := 0.5 * (low + high)) < high:
        if largest_residual(joints, middle) < residual:
            high = middle
        else:
            low = middle
    return sqrt(high)


def _largest_spread(count: int, mean: float, limit: float) -> float:
    """Return the largest y with p/(mean + (6−p)y) + (6−p)/(mean − py) ≤ limit, rounded up."""
    low, high = 0.0, mean / count
    while low < (middle := 0.5 * (low + high)) < high:
        spent = count / (mean + (6 - count) * middle) + (6 - count) / (mean - count * middle)
        low, high = (middle, high) if spent <= limit else (low, middle)
    return nextafter(high, inf)
