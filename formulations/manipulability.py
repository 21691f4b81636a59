"""Fourth statement: the manipulability that any failure leaves, over that before.

J is the Jacobian, shape (m, n), one column per joint; J_F has the columns of k joints that
lock, J_F̄ the others. ::

    maximise   t                                     over the joints' parameters and t
    subject to det(I − J_Fᵀ (JJᵀ)⁻¹ J_F) ≥ t         for every set F of k joints
               the joints' own constraints and bounds

The determinant is det(J_F̄J_F̄ᵀ)/det(JJᵀ), the square of the relative manipulability of Roberts
and Maciejewski (1996); Roberts, Yu and Maciejewski (2008) optimise it. It is a measure of the
null space alone: no change of coordinates of the task, and no scaling of single directions,
changes it. A Jacobian that attains its bound need not be near to isotropic.
"""

from collections.abc import Mapping
from itertools import combinations
from math import comb, inf, nextafter, pi, sin, sqrt
from types import MappingProxyType

import casadi as ca
import numpy as np

from lockedjoint.formulations import measures
from lockedjoint.formulations.bounds.certified import Bound, least, planar_on_record
from lockedjoint.formulations.encodings.columns import inverse
from lockedjoint.formulations.joints.joint import ArmModel, check
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.options import OptionValue
from lockedjoint.nlp.problem import Constraint, Problem, Sense

NAME = "manipulability"
SENSE: Sense = "maximise"
SCORE = "least relative manipulability after a failure"
SETTINGS: Mapping[str, object] = MappingProxyType({"failures": 1})
#: Options of Ipopt. It gives a start up after 500 iterations; a smaller tolerance gives more
#: digits of the score.
OPTIONS: Mapping[str, OptionValue] = MappingProxyType({"max_iter": 500, "tol": 1e-9})
# Factor on a bound that is computed in doubles: its few operations cannot lose more, so that
# the product is not below the true bound.
_ROUNDED_UP = 1 + 2.0**-46


def build(arm: ArmModel, failures: int = 1) -> Problem:
    """State the problem for an arm, as a nonlinear program with the output ``jacobian``.

    Parameters
    ----------
    arm
        The joints.
    failures
        How many joints lock at once, k.

    Raises
    ------
    InputError
        If k is out of range.
    """
    _, n = arm.shape
    check(arm, failures)
    variables, level = arm.symbols(), ca.SX.sym("t")
    jacobian = arm.matrix(variables)
    projection = ca.SX.eye(n) - jacobian.T @ (inverse(jacobian @ jacobian.T) @ jacobian)
    sets = [list(joints) for joints in combinations(range(n), failures)]
    rows = ca.vertcat(*(ca.det(projection[joints, joints]) for joints in sets))
    lower, upper = arm.bounds

    def complete_start(point: FloatArray) -> FloatArray:
        """Return the joints' variables, and the t that they have."""
        return np.append(point, score(arm.jacobian(point), failures) ** 2)

    return Problem(
        name=NAME,
        variables=ca.vertcat(variables, level),
        objective=level,
        sense=SENSE,
        constraints=(
            *arm.constraints(variables),
            Constraint("manipulability left", rows - level, 0.0, np.inf),
        ),
        lower=np.append(lower, -np.inf),
        upper=np.append(upper, np.inf),
        outputs={"jacobian": jacobian},
        options={"ipopt": OPTIONS},
        complete_start=complete_start,
    )


def score(jacobian: FloatArray, failures: int = 1) -> float:
    """Return what the statement maximises, √t: J's least relative manipulability."""
    return float(np.min(measures.relative_manipulability(jacobian, failures)))


def bound(arm: ArmModel, failures: int = 1) -> Bound:
    """Return what no relative manipulability of n columns of m rows is above.

    By Cauchy and Binet det(JJᵀ) is the sum of the squares of all minors of m columns, and each
    of these is left by C(n − m, k) of the C(n, k) sets F: the mean of the ratios is
    C(n − m, k)/C(n, k) = C(n − k, m)/C(n, m), whatever J is. Where n − m = k = 2, or two
    columns are left of planar ones, (2/n) sin(π/n) is sharper, and attained. So is
    r√((r − 1)/((r + 2)n(n − r))) for two failures if n is above r(r + 1)/2, r = n − m
    (docs/several_failures.md). A joint locked first leaves at most √((n − m)/n). Of planar
    columns, what branch and bound proved is on record.
    """
    m, n = arm.shape
    planar = planar_on_record((m, n), failures, NAME)
    return least(Bound(_limit(m, n, failures), "closed form"), planar)


def _limit(m: int, n: int, failures: int) -> float:
    """Return the least of the closed forms of `bound`, rounded up."""
    value = sqrt(comb(n - failures, m) / comb(n, m))
    limit = nextafter(value, inf) if value else 0.0
    if failures < 2 or not limit:
        return limit
    if failures == n - m and 2 in (m, n - m):
        limit = min(limit, _ROUNDED_UP * 2 / n * sin(pi / n))
    r = n - m
    if failures == 2 and 2 * n > r * (r + 1):
        limit = min(limit, _ROUNDED_UP * r * sqrt((r - 1) / ((r + 2) * n * m)))
    return min(limit, _ROUNDED_UP * sqrt((n - m) / n) * _limit(m, n - 1, failures - 1))
