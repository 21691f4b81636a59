"""A bound on the worst case of five revolute and two prismatic joints, in closed form.

J, shape (6, 7), has the columns j: (v; ω) with |ω| = 1, |v| ≤ 1 and v·ω = 0 of a revolute
joint, (v; 0) with |v| = 1 of a prismatic one. The worst case is that after one locked joint.

With A = JJᵀ − tI and t at most the square of the worst case, jᵀA⁻¹j ≤ 1 for each column. So
the five columns of revolute joints take at most 5 of tr A⁻¹JJᵀ = 6 + t tr A⁻¹, and the two
prismatic ones must take 1 + t tr A⁻¹ of it. They can only do so if JJᵀ is small along them,
and there A⁻¹ is large. With a − 1 the |cosine| of the angle between the two, some a of
[1, 2 − t) must satisfy (docs/several_failures.md)

    (1 − t/(a − t)) (1 − t/(2 − a)) ≥ t/(6 − 3t − a(2 − a)) + 9t/(5 − 3t)

Lever arms are at most 1 long, the prismatic joints have the speed 1. Nothing here has a unit.
"""

from fractions import Fraction
from functools import cache
from itertools import pairwise
from typing import Any

from lockedjoint.formulations.bounds.rational_roots import first_double, root_above
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import LeverRevolute, Prismatic, UnitRevolute

#: Number of revolute joints.
REVOLUTE = 5
#: Number of prismatic joints.
PRISMATIC = 2
# Number of intervals that the range of a is cut into. More make the bound a little sharper.
_PARTS = 400
# Relative step by which t grows until it is proved in rational arithmetic: above the rounding
# of doubles, and far below the digits that count.
_STEP = 1e-14
# A t that is proved to be excluded: the bisection begins below it.
_EXCLUDED_T = 0.5


def has_two_sliders(arm: Arm) -> bool:
    """Whether the bound holds for an arm: five revolute joints, two prismatic, of size 1."""
    revolute = sum(map(_is_short_revolute, arm.joints))
    prismatic = sum(one == Prismatic(1.0) for one in arm.joints)
    return (revolute, prismatic, len(arm.joints)) == (REVOLUTE, PRISMATIC, REVOLUTE + PRISMATIC)


def _is_short_revolute(joint: object) -> bool:
    """Whether |v| ≤ 1 and v·ω = 0 for every column of a joint."""
    if isinstance(joint, LeverRevolute):
        return joint.budget == "each" and joint.length <= 1 and not joint.pitch
    return type(joint) is UnitRevolute


@cache
def two_sliders_bound() -> float:
    """Return what no worst case of such an arm is above, proved in rational arithmetic."""
    # The bisection is in double precision. What is returned is proved in fractions.
    t = first_double(lambda t: not excludes_eigenvalue(t), _EXCLUDED_T)
    while not excludes_eigenvalue(Fraction(t)):
        t *= 1 + _STEP
    return root_above(Fraction(t))


def excludes_eigenvalue(t: Any) -> bool:
    """Whether no squared worst case is `t` or more; proved, if `t` is a fraction.

    It is if the inequality of the header is wrong for every a from 1 to 2 − t. On an interval
    of a, its left side is bounded from above and its right side from below at the two ends.
    That excludes larger t as well, because the left side falls with t and the right side grows.
    The first factor on the left grows with a, the second one falls, and so does a(2 − a).
    """
    # No worst case is as large as t = 1/2. No t ≤ 0 is excluded.
    if not 0 < 2 * t < 1:
        return bool(t > 0)
    width = (1 - t) / _PARTS
    ends = [1 + i * width for i in range(_PARTS + 1)]
    rotational = 9 * t / (5 - 3 * t)
    for low, high in pairwise(ends):
        left = (1 - t / (high - t)) * (1 - t / (2 - low))
        if left >= t / (6 - 3 * t - high * (2 - high)) + rotational:
            return False
    return True
