"""Third statement: the best worst case among exactly isotropic Jacobians (Section 2).

J is the Jacobian, shape (m, n), with columns j_f, one per joint, and t a number: the square of
the smallest singular value after the worst failure. ::

    maximise   t                        over the joints' parameters and t
    subject to JJᵀ = (T/m) I                   the independent rows only,  T = ‖J‖_F²
               t ≤ T/m − ‖j_f‖²                for every joint f
               the joints' own bounds

For isotropic J the smallest singular value without joint f has the square T/m − ‖j_f‖², so
the second line is eq. (5) without any eigenvalue. Where all columns have one fixed norm, t
is fixed too and only the question whether the equations can be met remains. Where k joints
lock, the second line is (T/m − t) I ⪰ J_FᵀJ_F for every set F of k, by principal minors.

The equations, row by row, are in `lockedjoint.formulations.isotropy_equations`.
"""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import casadi as ca
import numpy as np

from lockedjoint.formulations import measures
from lockedjoint.formulations.bounds import certified
from lockedjoint.formulations.bounds.certified import NONE_EXISTS, Bound
from lockedjoint.formulations.encodings.factors import leading_minors
from lockedjoint.formulations.isotropy_equations import (
    constants_where_isotropic,
    independent_rows,
    mean_eigenvalue,
    residuals,
)
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.joint import ArmModel, check
from lockedjoint.formulations.measures.jacobian import locked_sets
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.options import OptionValue
from lockedjoint.nlp.problem import Constraint, Problem, Sense

NAME = "isotropy"
SENSE: Sense = "maximise"
SCORE = "worst-case σ of an isotropic J"
SETTINGS: Mapping[str, object] = MappingProxyType({"failures": 1})
# Solving each barrier problem well follows the central path, which smooths the maximum over
# joints: 99 instead of 93 of 100 starts reach the best isotropic 7R with free lever arms. The
# tolerance makes equal optima equal enough to be counted as one.
OPTIONS: Mapping[str, OptionValue] = MappingProxyType({"barrier_tol_factor": 1.0, "tol": 1e-9})
# Options where several joints lock, and the second line is stated by principal minors: a
# smaller tolerance.
_SEVERAL_OPTIONS: Mapping[str, OptionValue] = MappingProxyType({**OPTIONS, "tol": 1e-12})
#: The isotropy defect, relative to (T/m)², up to which a Jacobian counts as isotropic.
TOLERANCE = 1e-10
# A value counts as within bounds if it is outside by at most this: rounding of a fit.
_BOUND_TOLERANCE = 1e-9


def build(arm: ArmModel, failures: int = 1) -> Problem:
    """State the problem for an arm of which `failures` joints lock at once.

    Its output ``jacobian`` is J. Where all T/m − ‖j_f‖² are constants and one joint locks,
    there is no t: the objective is a constant, and the problem is only to meet the equations.
    """
    check(arm, failures)
    variables = arm.symbols()
    m, n = arm.shape
    lower, upper = arm.bounds
    jacobian = arm.matrix(variables)
    isotropic = Constraint(
        "isotropy", residuals(arm, variables)[independent_rows(arm)], 0.0, 0.0
    )
    norms = ca.vertcat(*(ca.sumsqr(jacobian[:, f]) for f in range(n)))
    remaining = mean_eigenvalue(arm, variables) - norms
    constraints = (isotropic, *_not_implied(arm, variables))
    fixed = constants_where_isotropic(arm, variables, remaining)
    known = fixed[~np.isnan(fixed)].tolist()
    feasibility = Problem(
        name=NAME,
        variables=variables,
        objective=ca.SX(min(known, default=0.0)),
        sense=SENSE,
        constraints=constraints,
        lower=lower,
        upper=upper,
        outputs={"jacobian": jacobian},
        options={"ipopt": OPTIONS},
    )
    if len(known) == n and failures == 1:
        return feasibility

    level = ca.SX.sym("t")
    rows = remaining - level
    if failures > 1:
        gap = (mean_eigenvalue(arm, variables) - level) * ca.SX.eye(n) - jacobian.T @ jacobian
        rows = leading_minors(gap, locked_sets(np.zeros((m, n)), failures))

    def complete_start(point: FloatArray) -> FloatArray:
        """Return the joints' variables and T/m − max ‖J_F‖², the t that they allow."""
        matrix = arm.jacobian(point)
        sets = locked_sets(matrix, failures)
        largest = max(np.linalg.norm(matrix[:, list(joints)], 2) ** 2 for joints in sets)
        return np.append(point, measures.trace(matrix) / m - largest)

    epigraph = Constraint("worst case", rows, 0.0, np.inf)
    return replace(
        feasibility,
        variables=ca.vertcat(variables, level),
        objective=level,
        constraints=(*constraints, epigraph),
        complete_start=complete_start,
        lower=np.append(lower, -np.inf),
        upper=np.append(upper, np.inf),
        options={"ipopt": OPTIONS if failures == 1 else _SEVERAL_OPTIONS},
    )


def score(jacobian: FloatArray, failures: int = 1) -> float:
    """Return what the statement maximises, √t from J alone; −∞ if J is not isotropic."""
    m, _ = jacobian.shape
    scale = measures.trace(jacobian) / m
    if measures.isotropy_defect(jacobian) > TOLERANCE * scale**2:
        return -np.inf
    return measures.worst_case_sigma(jacobian, failures)


def bound(arm: ArmModel, failures: int = 1) -> Bound | None:
    """Return what no worst case of an isotropic Jacobian is above; see `Formulation`.

    `NONE_EXISTS` where it is proved that there is no isotropic one.
    """
    if not isinstance(arm, Arm):
        return None
    if certified.has_no_isotropic(arm):
        return NONE_EXISTS
    return certified.largest_isotropic_worst_case(arm, failures)


def _not_implied(arm: ArmModel, variables: ca.SX) -> tuple[Constraint, ...]:
    """Return the joints' own constraints, less the bounds that isotropy alone meets.

    Isotropy fixes some of them outright (the mean of |v|² is 1 for revolute joints); stated,
    such a row repeats the equations and leaves Ipopt without a strict interior.
    """
    needed = []
    for constraint in arm.constraints(variables):
        low, high = np.asarray(constraint.lower), np.asarray(constraint.upper)
        values = constants_where_isotropic(arm, variables, constraint.expression)
        above, below = low - _BOUND_TOLERANCE <= values, values <= high + _BOUND_TOLERANCE
        met = (low < high) & above & below
        if rows := np.flatnonzero(~met).tolist():
            expression = constraint.expression[rows]
            needed.append(Constraint(constraint.name, expression, low[rows], high[rows]))
    return tuple(needed)
