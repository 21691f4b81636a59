"""Fifth statement: the condition number that any failure leaves.

J is the Jacobian, shape (m, n), one column per joint; J_F̄ is J without the columns of a set F
of k joints that lock, and u_F a number near the largest eigenvalue of J_F̄J_F̄ᵀ. ::

    maximise   t                                       over the joints' parameters, t and u_F
    subject to λ_min(J_F̄J_F̄ᵀ) ≥ t u_F ≥ t λ_max(J_F̄J_F̄ᵀ)   for every set F of k joints
               the joints' own constraints and bounds

√t is the least ratio of the smallest to the largest singular value, the reciprocal of the
largest condition number: of frames, the measure of numerical robustness to erasures of Fickus
and Mixon (2012). The eigenvalue constraints have a triangular factor for each set.
"""

from collections.abc import Mapping
from itertools import combinations
from math import comb, inf, nextafter, pi, sqrt, tan
from types import MappingProxyType

import casadi as ca
import numpy as np

from lockedjoint.formulations import measures
from lockedjoint.formulations.bounds.certified import Bound, least, planar_on_record
from lockedjoint.formulations.bounds.rational_roots import first_double
from lockedjoint.formulations.encodings.factors import factor_of, factor_start, triangular
from lockedjoint.formulations.joints.joint import ArmModel, check
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.options import OptionValue
from lockedjoint.nlp.problem import Constraint, Problem, Sense

NAME = "condition"
SENSE: Sense = "maximise"
SCORE = "least σ_min/σ_max after a failure"
SETTINGS: Mapping[str, object] = MappingProxyType({"failures": 1})
#: Options of Ipopt. It gives a start up after 500 iterations; a smaller tolerance gives more
#: digits of the score; and each barrier problem is solved well before the next.
OPTIONS: Mapping[str, OptionValue] = MappingProxyType(
    {"max_iter": 500, "tol": 1e-11, "barrier_tol_factor": 1.0}
)
# t starts at this share of what the start has: at 1 a factor would be singular.
_LEVEL_SHARE = 0.5
# Factor on a bound that is computed in doubles: its few operations cannot lose more, so that
# the product is not below the true bound.
_ROUNDED_UP = 1 + 2.0**-43

# m, n and k of five columns in space of which any three have to remain.
_PENTAGON = (3, 5, 2)


def build(arm: ArmModel, failures: int = 1) -> Problem:
    """State the problem for an arm of which `failures` joints lock at once.

    The output ``jacobian`` is J. The variables are those of the joints, t, all u_F, and the
    entries of two triangular factors for each F: L Lᵀ = J_F̄J_F̄ᵀ − t u_F I and u_F I −
    J_F̄J_F̄ᵀ.

    Raises
    ------
    InputError
        If so many joints cannot lock.
    """
    check(arm, failures)
    m, n = arm.shape
    variables, level = arm.symbols(), ca.SX.sym("t")
    jacobian = arm.matrix(variables)
    sets = combinations(range(n), failures)
    kept = [np.delete(np.arange(n), joints).tolist() for joints in sets]
    largest = ca.SX.sym("u", len(kept))
    unit = ca.SX.eye(m)
    unknowns, least = [variables, level, largest], []
    rows: list[Constraint] = []
    for place, left in enumerate(kept):
        gram = jacobian[:, left] @ jacobian[:, left].T
        for gap in (gram - level * largest[place] * unit, largest[place] * unit - gram):
            symbols, factor = triangular(f"L{len(rows)}", m)
            unknowns.append(symbols)
            rows.append(factor_of(f"factor {len(rows)}", gap, factor))
            least.append(np.where(np.eye(m), 0.0, -np.inf)[np.tril_indices(m)])
    lower, upper = arm.bounds
    lower = np.concatenate([lower, np.zeros(1 + len(kept)), *least])

    def complete_start(point: FloatArray) -> FloatArray:
        """Return all variables from those of the joints."""
        matrix = arm.jacobian(point)
        grams = [matrix[:, left] @ matrix[:, left].T for left in kept]
        high = np.array([np.linalg.eigvalsh(gram)[-1] for gram in grams])
        t = _LEVEL_SHARE * score(matrix, failures) ** 2
        gaps = [
            gap
            for gram, u in zip(grams, high, strict=True)
            for gap in (gram - t * u * np.eye(m), u * np.eye(m) - gram)
        ]
        return np.concatenate([point, [t], high, *map(factor_start, gaps)])

    return Problem(
        name=NAME,
        variables=ca.vertcat(*unknowns),
        objective=level,
        sense=SENSE,
        constraints=(*arm.constraints(variables), *rows),
        lower=lower,
        upper=np.append(upper, np.full(lower.size - upper.size, np.inf)),
        outputs={"jacobian": jacobian},
        options={"ipopt": OPTIONS},
        complete_start=complete_start,
    )


def score(jacobian: FloatArray, failures: int = 1) -> float:
    """Return what the statement maximises, √t from J: the least reciprocal condition number."""
    return float(np.min(measures.reciprocal_conditions(jacobian, failures)))


def bound(arm: ArmModel, failures: int = 1) -> Bound:
    """Return what no least reciprocal condition number is above (docs/atlas_names.md).

    The determinants of all J_F̄J_F̄ᵀ add up to C(n − m, k) det(JJᵀ), and each is at least what
    its trace and its condition number allow. In the plane the nearest two of n lines say more
    where two columns are left, and in space the angles at which each of five columns sees the
    others. A joint locked first leaves n − 1 with k − 1 to lock; seen along one column the
    others have one row less and no larger condition numbers. Of planar columns, what branch and
    bound proved is on record.
    """
    m, n = arm.shape
    planar = planar_on_record((2, n - m + 2), failures, NAME) if m > 1 else None
    return least(Bound(_limit(m, n, failures), "closed form"), planar)


def _limit(m: int, n: int, failures: int) -> float:
    """Return the least of the closed forms of `bound`, rounded up."""
    if failures > n - m:
        return 0.0
    # The mean of the determinants, over what the traces τ_F of all J_F̄J_F̄ᵀ allow at the
    # least.
    share = comb(n - m, failures) / comb(n, failures) * (n / ((n - failures) * m)) ** m

    def allowed(t: float) -> bool:
        """Whether t is at most the limit: p of m eigenvalues are the small ones."""
        return min((t**p / (p * t + m - p) ** m for p in range(1, m)), default=0.0) <= share

    limit = _ROUNDED_UP * sqrt(first_double(allowed, 1.0))
    if m == 2 and failures == n - 2:
        limit = min(limit, _ROUNDED_UP * tan(pi / (2 * n)))
    if (m, n, failures) == _PENTAGON:
        golden = (1 + sqrt(5)) / 2
        limit = min(limit, _ROUNDED_UP * (golden - sqrt(golden)))
    limit = nextafter(limit, inf)
    if failures > 1:
        limit = min(limit, _limit(m, n - 1, failures - 1))
    return min(limit, _limit(m - 1, n - 1, failures)) if m > 2 else limit
