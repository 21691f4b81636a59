"""Third statement: the best worst case among exactly isotropic Jacobians (Section 2).

::

    maximise   t                        over the joints' parameters and t
    subject to JJᵀ = (T/m) I                   the independent rows only,  T = ‖J‖_F²
               t ≤ T/m − ‖j_f‖²                for every joint f
               the joints' own bounds

For isotropic J the smallest singular value without joint f has the square T/m − ‖j_f‖², so
the second line is eq. (5) without any eigenvalue. Where all columns have one fixed norm, t
is fixed too and only the question whether the equations can be met remains.
"""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import casadi as ca
import numpy as np

from formulations import measures
from formulations.bounds.certified import (
    NONE_EXISTS,
    Bound,
    has_no_isotropic,
    largest_isotropic_worst_case,
)
from formulations.isotropy_equations import (
    constant_where_isotropic,
    independent_rows,
    mean_eigenvalue,
    residuals,
)
from formulations.joints.arm import Arm
from formulations.joints.joint import ColumnModel
from nlp.arrays import FloatArray
from nlp.options import OptionValue
from nlp.problem import Constraint, Problem, Sense

NAME = "isotropy"
SENSE: Sense = "maximise"
SETTINGS: Mapping[str, object] = MappingProxyType({})
# Solving each barrier problem well follows the central path, which smooths the maximum over
# joints: 99 instead of 93 of 100 starts reach the best isotropic 7R with free lever arms. The
# tolerance makes equal optima equal enough to be counted as one.
OPTIONS: Mapping[str, OptionValue] = MappingProxyType({"barrier_tol_factor": 1.0, "tol": 1e-9})
# An isotropy defect, relative to (T/m)², up to which a Jacobian counts as isotropic.
TOLERANCE = 1e-10


def build(arm: ColumnModel) -> Problem:
    """State the problem for an arm."""
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
    fixed = [constant_where_isotropic(arm, variables, remaining[f]) for f in range(n)]
    known = [value for value in fixed if value is not None]
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
    if len(known) == n:
        return feasibility

    level = ca.SX.sym("t")

    def complete_start(point: FloatArray) -> FloatArray:
        matrix = arm.jacobian(point)
        squares = np.sum(matrix**2, axis=0)
        return np.append(point, squares.sum() / m - squares.max())

    epigraph = Constraint("worst case", remaining - level, 0.0, np.inf)
    return replace(
        feasibility,
        variables=ca.vertcat(variables, level),
        objective=level,
        constraints=(*constraints, epigraph),
        complete_start=complete_start,
        lower=np.append(lower, -np.inf),
        upper=np.append(upper, np.inf),
    )


def score(jacobian: FloatArray, locked: int = 1) -> float:
    """What the statement maximises, √t from J alone; −∞ if J is not isotropic."""
    m, _ = jacobian.shape
    scale = measures.trace(jacobian) / m
    if measures.isotropy_defect(jacobian) > TOLERANCE * scale**2:
        return -np.inf
    return measures.worst_case_sigma(jacobian, locked)


def bound(arm: ColumnModel, locked: int = 1, certified: bool = True) -> Bound | None:
    """Return what no worst case of an isotropic Jacobian is above; see `Formulation`.

    `NONE_EXISTS` where it is proved that there is no isotropic one.
    """
    if not isinstance(arm, Arm):
        return None
    if has_no_isotropic(arm):
        return NONE_EXISTS if certified else None
    return largest_isotropic_worst_case(arm, locked, certified)


def _not_implied(arm: ColumnModel, variables: ca.SX) -> tuple[Constraint, ...]:
    """Return the joints' own constraints, less the bounds that isotropy alone meets.

    Isotropy fixes some of them outright (the mean of |v|² is 1 for revolute joints); stated,
    such a row repeats the equations and leaves Ipopt without a strict interior.
    """
    needed = []
    for constraint in arm.constraints(variables):
        low, high = np.asarray(constraint.lower), np.asarray(constraint.upper)
        rows = []
        for k in range(low.size):
            inequality = low[k] < high[k]
            value = constant_where_isotropic(arm, variables, constraint.expression[k])
            met = value is not None and low[k] - 1e-9 <= value <= high[k] + 1e-9
            if not (inequality and met):
                rows.append(k)
        if rows:
            expression = constraint.expression[rows]
            needed.append(Constraint(constraint.name, expression, low[rows], high[rows]))
    return tuple(needed)
