"""Singular values that a proved residual of unit revolute joints excludes, for all lever arms.

Column j_i = (v_i; ω_i) of a revolute joint has |ω_i| = 1 and v_i ⊥ ω_i, n ≥ 7 joints; it is a
unit revolute joint if |v_i| = 1 as well. σ is the worst case, the least singular value of J,
shape (6, n), after one locked joint, and t = σ². ρ = ½‖JJᵀ − (n/3)I‖_F² is the residual of a
unit revolute Jacobian J. With any |v_i|, J' has the columns (v_i/|v_i|; ω_i): it is a unit
revolute Jacobian, whose residual is at least a proved bound, `residual` in the code
(docs/bounds.md, section 5). Nothing has a unit: |v_i| is measured in lever arms of a unit
revolute joint. The matrix of J' has 3×3 blocks,

    J'J'ᵀ − (n/3)I = [E_v  E_x; E_xᵀ  E_w],   E_x = Σ (v_i/|v_i|) ω_iᵀ,

and the lever defect weighs them (`lever_conditions`).

What comes in: a proved residual or lever defect, and n. What goes out: a σ that no arm reaches
(`least_excluded`), or whether a σ is excluded; and `largest_residual`, the other way round, a
limit on ρ from t. Roots are found in double precision. What is claimed of them is checked in
rational arithmetic, of the very doubles that are returned.
"""

import math
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from typing import TypeAlias

from lockedjoint.formulations.bounds.rational_roots import (
    first_double,
    rational_root_above,
    root_below,
)
from lockedjoint.nlp.arrays import real_number

# Numbers with which a condition is first tried, and then proved.
Number: TypeAlias = float | Fraction

# Share of the mean eigenvalue by which the spread y is first raised above its double: above the
# rounding of the bisection. It is doubled until the proof succeeds. A larger one gives larger
# bounds, and a smaller one takes more steps.
_FIRST_RAISE = Fraction(1, 2**48)


def mean_residual(joints: int) -> float:
    """Return the mean of ρ over all configurations of n unit revolute joints, 5n/3.

    It is the unit in which blocks of moments are scaled (`moments.conditions`).
    """
    return 5 * joints / 3


def largest_residual(joints: int, t: float) -> float:
    """Return an upper bound on ρ_max(t), the largest ½ Σ (λ_k − n/3)² that t allows, n ≥ 7.

    The six eigenvalues λ_k of JJᵀ satisfy Σ λ_k = 2n and Σ 1/(λ_k − t) ≤ (n − 6)/t. At the
    largest ρ some p of them are (6 − p)y above their mean n/3 and the others py below, so that
    ρ = ½(p(6 − p)²y² + (6 − p)p²y²) = 3p(6 − p)y². It is proved in rational arithmetic
    (docs/bounds.md, section 4); −inf if no spectrum satisfies this for t.
    """
    mean = Fraction(joints, 3) - Fraction(
        real_number("t", t, "a positive finite number", least=math.ulp(0.0))
    )
    limit = Fraction(joints - 6) / Fraction(t)
    if mean <= 0 or 6 / mean > limit:
        return -math.inf
    largest = max(3 * p * (6 - p) * _largest_spread(p, mean, limit) ** 2 for p in range(1, 6))
    # The conversion rounds to the nearest double: the next one is above.
    return math.nextafter(float(largest), math.inf)


def _largest_spread(count: int, mean: Fraction, limit: Fraction) -> Fraction:
    """Return a y above all with p/(mean + (6−p)y) + (6−p)/(mean − py) ≤ limit, p = `count`.

    `mean` is n/3 − t, above 0, and `limit` is (n − 6)/t.
    """

    def allowed(y: Number, mean: Number, limit: Number) -> bool:
        """Whether y satisfies the condition, in the arithmetic of its arguments."""
        high, low = mean + (6 - count) * y, mean - count * y
        return bool(low > 0 and count / high + (6 - count) / low <= limit)

    # The bisection only suggests where to look: what is returned is checked exactly.
    top = float(mean)
    start = first_double(lambda y: allowed(y, top, float(limit)), top / count)
    step = mean * _FIRST_RAISE
    while allowed(candidate := Fraction(start) + step, mean, limit):
        step *= 2
    return candidate


#: A function of a proved residual, a σ and the number n of joints: whether σ is excluded.
Excludes: TypeAlias = Callable[[float, float, int], bool]


@cache
def least_excluded(excludes: Excludes, residual: float, joints: int = 7) -> float:
    """Return a σ that no worst case (5) reaches, from a proved residual.

    `residual` is what `excludes` takes first, a proved residual or lever defect. The σ is at
    most the double above √((n − 6)/3), which is eq. (6) for T = 2n.
    It is the least double that `excludes` accepts, found by bisection. The proof is the call of
    `excludes` for the double that is returned.
    """
    top = math.nextafter(math.sqrt((joints - 6) / 3), math.inf)
    return first_double(lambda sigma: not excludes(residual, sigma, joints), top)


#: Weight of ‖E_x + E_xᵀ‖² in the lever defect.
SYMMETRIC_WEIGHT = Fraction(7, 32)
#: Weight of ‖E_x − E_xᵀ‖² in the lever defect.
SKEW_WEIGHT = Fraction(3, 8)
#: Largest lever defect of isotropic arms for which the lower bound is proved.
LEVER_LIMIT = Fraction(17, 200)


def excludes_isotropic(residual: float, sigma: float, joints: int = 7) -> bool:
    """Whether a proved residual of unit revolute joints excludes an isotropic `sigma`.

    δ = n/3 − 2 − σ² is the largest |v_i|² − 1, and y = nδ/(1 + δ). Then y ≥ 1 or
    y²/3 + (1 − √(1 − y))² ≥ ρ, of revolute joints with any |v_i| (docs/bounds.md, theorem A).
    True is a proof, False says nothing.
    """
    delta = Fraction(joints - 6, 3) - Fraction(sigma) ** 2
    # Then σ is above eq. (6).
    if delta < 0:
        return True
    y = joints * delta / (1 + delta)
    return y < 1 and y**2 / 3 + (1 - root_below(1 - y)) ** 2 < Fraction(residual)


def excludes_isotropic_levers(defect: float, sigma: float, joints: int = 7) -> bool:
    """Whether a proved `lever_conditions.lever_defect` excludes an isotropic `sigma`.

    `defect` is a lower bound of the lever defect where that is at most `LEVER_LIMIT`. With
    δ = n/3 − 2 − σ² and y = nδ/(1 + δ), E_v of an isotropic arm adds at most y²/3 to it, and
    E_x, of norm at most 1 − √(1 − y), the rest (docs/bounds.md, theorem C, of any |v_i|).
    True is a proof, False says nothing.
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
    """Whether a proved residual excludes the worst case `sigma` where Σ|v_i|² ≤ n.

    It is theorem B of docs/bounds.md, section 5, line by line. True is a proof, False says
    nothing. Every name bounds a quantity of the proof from above, with E = JJᵀ − (n/3)I, t =
    σ², η = (n − 6)/3 − t, c = n/3 − t, u_i = |v_i|² − 1, w_i = ½ j_iᵀEj_i and
    r_i = 2w_i/c + η − u_i ≥ 0. p_i and s_i are the coefficients in step 4 of the proof. There
    κ, R, μ and H are `kappa`, `slack`, `levers` and `shift`. Nothing follows if c ≥ n/3, the
    spectrum is too wide, κ ≥ 8 or μ ≥ 1.
    """
    n, t = joints, Fraction(sigma) ** 2
    eta, c = Fraction(n - 6, 3) - t, Fraction(n, 3) - t
    # Eq. (6) alone excludes it.
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
