"""Bounds on the worst case of revolute joints with free lever arms.

Divide every v_i by |v_i|: the result J' is a unit revolute Jacobian, so its residual is at
least a proved bound ρ. If the worst case of J is close to eq. (6), J is nearly isotropic and
every |v_i| is close to 1, so the residual of J' is small. Both cannot be if ρ > 0. The theorems
and their proofs are in docs/bounds.md, section 5. Whether a double is a bound is decided in
rational arithmetic; roots are rounded to the side on which the bound holds.
"""

from collections.abc import Callable
from fractions import Fraction
from functools import lru_cache
from math import nextafter, sqrt

from formulations.bounds.closed_form import first_double, rational_root_above, root_below


@lru_cache
def isotropic_limit(residual: float, joints: int = 7) -> float:
    """Return a singular value that no worst case (5) of an isotropic Jacobian reaches.

    Parameters
    ----------
    residual
        A proved lower bound on ½‖JJᵀ − (n/3)I‖_F² of all unit revolute Jacobians.
    joints
        Number n of revolute joints, at least 7.

    Returns
    -------
    float
        Below eq. (6), √((n − 6)/3), if `residual` is positive; else that, rounded up.
    """
    return _least(excludes_isotropic, residual, joints)


@lru_cache
def max_min_limit(residual: float, joints: int = 7) -> float:
    """Return a singular value that no worst case (5) of Jacobians with Σ|v_i|² ≤ n reaches.

    Parameters and result are those of `isotropic_limit`.
    """
    return _least(excludes_max_min, residual, joints)


def excludes_isotropic(residual: float, sigma: float, joints: int = 7) -> bool:
    """Return whether a bound on the residual excludes a worst case of isotropic Jacobians.

    True is a proof: if ½‖JJᵀ − (n/3)I‖_F² ≥ `residual` for all unit revolute Jacobians, then no
    isotropic Jacobian of n revolute joints reaches `sigma`. Both numbers stand for themselves,
    to the last bit. False says nothing.

    Notes
    -----
    With δ = (n − 6)/3 − σ², no |v_i|² is above 1 + δ, and the residual of J' is at most
    y²/3 + (1 − √(1 − y))² where y = nδ/(1 + δ).
    """
    delta = Fraction(joints - 6, 3) - Fraction(sigma) ** 2
    if delta < 0:
        return True
    y = joints * delta / (1 + delta)
    return y < 1 and y**2 / 3 + (1 - root_below(1 - y)) ** 2 < Fraction(residual)


def excludes_max_min(residual: float, sigma: float, joints: int = 7) -> bool:
    """Return whether a bound on the residual excludes a worst case where Σ|v_i|² ≤ n.

    The meaning is that of `excludes_isotropic`, without isotropy.

    Notes
    -----
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
    return (linear + rational_root_above(along**2 + 2 * across**2)) ** 2 < 2 * Fraction(
        residual
    )


def _least(
    excludes: Callable[[float, float, int], bool], residual: float, joints: int
) -> float:
    """Return the least singular value that bisection finds to be excluded."""
    top = nextafter(sqrt((joints - 6) / 3), 2.0 * joints)
    return first_double(lambda sigma: not excludes(residual, sigma, joints), 0.0, top)
