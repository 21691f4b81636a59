"""First statement: residual minimisation (Section 4, eqs. 23–43).

::

    minimise  ½ ‖JJᵀ − (T/m) I‖_F²      over the joints' parameters,     T = ‖J‖_F²
    subject to the joints' own bounds

J is the Jacobian, shape (m, n), one column per joint. The sum has the squares of the m(m + 1)/2
isotropy equations, the distinct entries of JJᵀ − (T/m) I, those of the diagonal counted half:
so weighted, it is the same in every frame. The paper's fᵀf counts all alike; its value depends
on the frame, and its minimum over frames is the sum above. Both have the same minima, and the
invariant one needs fewer iterations.

For unit revolute joints the equations are there twice: derived from JJᵀ, and as the closed
forms of the Appendix. They are the same functions of the angles.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from types import MappingProxyType

import casadi as ca
import numpy as np

from lockedjoint.formulations import isotropy_equations as equations
from lockedjoint.formulations import measures
from lockedjoint.formulations.bounds.certified import Bound, least_residual
from lockedjoint.formulations.encodings.columns import Columns, gauss_newton, second
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.joint import ArmModel
from lockedjoint.formulations.joints.models import is_unit_revolute
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError, one_of
from lockedjoint.nlp.options import OptionValue
from lockedjoint.nlp.problem import Constraint, Derivatives, Evaluation, Problem, Sense, Stage
from lockedjoint.nlp.solver import Solver

NAME = "residual"
SENSE: Sense = "minimise"
SCORE = "½‖JJᵀ − (T/m)I‖²"
SETTINGS: Mapping[str, object] = MappingProxyType({})
# Multiple of the unit matrix that is first added to the Hessian where it is not convex. Columns
# have size 1 and so has curvature: with this start and small factors there are a seventh fewer
# iterations than with Ipopt's own values, 1e-4 and a factor of 100, which overshoot.
_FIRST_SHIFT = 1.0
# Factor by which the multiple grows until the Hessian is convex.
_SHIFT_GROWTH = 4.0
#: Options of Ipopt. What Ipopt and MUMPS do by default, to be safe on large or badly scaled
#: problems, takes a seventh of the time on these, and changes nothing in what is found.
OPTIONS: Mapping[str, OptionValue] = MappingProxyType(
    {
        "fast_step_computation": "yes",
        "first_hessian_perturbation": _FIRST_SHIFT,
        "mumps_permuting_scaling": 0,
        "mumps_pivot_order": 0,
        "mumps_scaling": 0,
        "nlp_scaling_method": "none",
        "perturb_inc_fact": _SHIFT_GROWTH,
        "perturb_inc_fact_first": _SHIFT_GROWTH,
    }
)
#: Options of Fatrop: the same shift.
FATROP_OPTIONS: Mapping[str, float] = MappingProxyType(
    {
        "delta_w0": _FIRST_SHIFT,
        "kappa_wplus": _SHIFT_GROWTH,
        "kappa_wplusem": _SHIFT_GROWTH,
    }
)
# The largest number of iterations as the first stage of max-min. At 7R the residual is not zero
# at its minimum, and Gauss–Newton steps would need many more to get there, for nothing.
_FIRST_STAGE_ITERATIONS = 12
# J attains eq. (6) if ‖JJᵀ − (T/m)I‖_F and all |‖j_i‖² − T/n| are at most this share of T.
_ISOTROPIC = 1e-8
# Number of unit revolute joints from which on the residual is zero at its minimum: the paper
# finds optimally failure-tolerant 8R Jacobians, and there are no 7R ones.
_JOINTS_WITH_ZERO_RESIDUAL = 8
# Weight of the squares of the diagonal in the sum, by weighting.
_DIAGONAL_WEIGHTS: Mapping[str, float] = MappingProxyType({"invariant": 0.5, "paper": 1.0})
#: Where the isotropy equations come from: a function of the arm and its variables that returns
#: the column of the m(m + 1)/2 equations, those of the diagonal first.
ROWS: Mapping[str, Callable[[ArmModel, ca.SX], ca.SX]] = MappingProxyType(
    {"derived": equations.residuals, "appendix": equations.appendix_residuals}
)


def build(
    arm: ArmModel,
    weighting: str = "invariant",
    rows: str = "derived",
    hessian: str | None = None,
) -> Problem:
    """State the problem for an arm, as a nonlinear program with the output ``jacobian``.

    Parameters
    ----------
    arm
        The joints.
    weighting
        ``"invariant"`` or ``"paper"``, see above.
    rows
        ``"derived"`` from JJᵀ, or ``"appendix"``: the Appendix's closed forms.
    hessian
        ``"exact"``; or ``"gauss-newton"``, see `encodings.columns.gauss_newton`: twice as fast
        where the residual is zero at the minimum, far slower where it is not. Of the invariant
        weighting. By default, where it is zero: for eight unit revolute joints or more.

    Raises
    ------
    InputError
        If the weighting, the rows or the Hessian are none of these, or the Appendix's closed
        forms are asked for and a joint is not a unit revolute one.
    """
    one_of("weighting", weighting, _DIAGONAL_WEIGHTS)
    one_of("rows", rows, ROWS)
    if hessian is None:
        enough = arm.shape[1] >= _JOINTS_WITH_ZERO_RESIDUAL
        vanishes = is_unit_revolute(arm) and enough and weighting == "invariant"
        hessian = "gauss-newton" if vanishes else "exact"
    one_of("hessian", hessian, ("exact", "gauss-newton"))
    if hessian != "exact" and weighting != "invariant":
        raise InputError("weighting", weighting, f"invariant for the {hessian} Hessian")
    variables = arm.symbols()
    matrix, constraints = arm.matrix(variables), arm.constraints(variables)
    written = None if hessian == "exact" else _derivatives(variables, matrix, constraints)
    equations = ROWS[rows](arm, variables)
    m, _ = arm.shape
    lower, upper = arm.bounds
    diagonal = _DIAGONAL_WEIGHTS[weighting] * ca.sumsqr(equations[:m])
    return Problem(
        name=NAME,
        variables=variables,
        objective=diagonal + ca.sumsqr(equations[m:]),
        sense=SENSE,
        constraints=constraints,
        lower=lower,
        upper=upper,
        outputs={"jacobian": matrix},
        options={"ipopt": OPTIONS, "fatrop": FATROP_OPTIONS},
        derivatives=written,
    )


def _derivatives(
    variables: ca.SX, matrix: ca.SX, constraints: Sequence[Constraint]
) -> Derivatives:
    """Return the Gauss–Newton Hessian of the Lagrangian, N × N for N variables.

    It is a function of the variables x, of σ, by which the objective is multiplied, and of the
    multipliers λ of the joints' own constraints, whose second derivatives are exact.
    """
    rows = ca.vertcat(*(constraint.expression for constraint in constraints))
    x, sigma = ca.MX.sym("x", variables.numel()), ca.MX.sym("sigma")
    multipliers = ca.MX.sym("lambda", rows.numel())
    own = gauss_newton(Columns.of(variables, matrix), x, sigma)
    own += second(variables, rows)(x, multipliers)
    return Derivatives(ca.Function("hessian", [x, sigma, multipliers], [own]), shift=0.0)


def score(jacobian: FloatArray) -> float:
    """Return what the statement minimises, ½‖JJᵀ − (T/m)I‖_F², from J alone, shape (m, n)."""
    return measures.isotropy_defect(jacobian)


def bound(arm: ArmModel, failures: int = 1) -> Bound | None:  # noqa: ARG001
    """Return what no residual of the arm is below; see `Formulation`."""
    return least_residual(arm) if isinstance(arm, Arm) else None


def minimum(arm: ArmModel, rng: np.random.Generator) -> FloatArray:
    """Return the vector of variables at the minimum reached from one drawn at random."""
    return _solver(arm).solve(arm.sample(rng)).variables


@lru_cache(maxsize=4)
def _solver(arm: ArmModel) -> Solver:
    """Return the solver of an arm's problem: building it takes longer than one solution."""
    return Solver(build(arm))


def first_stage(arm: ArmModel) -> Stage:
    """Return a few steps to the minimum, as the first stage of max-min.

    Where they end at an isotropic J with columns of equal norm, which attains eq. (6), they are
    its answer; but only if the joints fix T, so that no other J has a larger bound.
    """
    variables = arm.symbols()
    matrix = arm.matrix(variables)
    gram, norms = matrix @ matrix.T, ca.sum1(matrix**2)
    trace = ca.sum2(norms)
    defect = gram - trace / arm.shape[0] * ca.SX.eye(arm.shape[0])
    unlike = ca.mmax(ca.fabs(norms - trace / arm.shape[1]))
    evaluation = Evaluation(variables, [trace, ca.norm_fro(defect), unlike])
    fixed = arm.fixed_trace is not None

    def is_answer(point: FloatArray) -> bool:
        """Whether the variables of a point attain eq. (6)."""
        total, *gaps = (value[0, 0] for value in evaluation(point))
        return fixed and bool(max(gaps) <= _ISOTROPIC * total)

    stated = replace(build(arm, hessian="gauss-newton"), options={"ipopt": OPTIONS})
    free = not stated.constraints and not np.isfinite(arm.bounds).any()
    rows = equations.residuals(arm, stated.variables)
    rows[: arm.shape[0]] *= np.sqrt(_DIAGONAL_WEIGHTS["invariant"])
    return Stage(stated, _FIRST_STAGE_ITERATIONS, is_answer, rows if free else None)
