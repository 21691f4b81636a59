"""Max-min by Schur complements: no auxiliary variables, and two stages.

J is the Jacobian, shape (m, n), with columns j_f, a function of the joints' parameters x, N of
them; t is a number, in squared units of J. ::

    maximise   log t                       over the joints' parameters x and t
    subject to j_fᵀ (JJᵀ − tI)⁻¹ j_f ≤ 1   for every joint f
               the joints' own constraints and bounds

Where JJᵀ ≻ tI that is λ_min(JJᵀ − j_f j_fᵀ) ≥ t. The inverse is by LDLᵀ, unrolled, and NaN
where JJᵀ − tI is not positive definite: the solver then shortens its step. Derivatives are
written out, see `encodings.columns`.

From random starts that is no faster than the shared factor. From a point of small residual,
where JJᵀ is nearly (n/m)I, it takes a few iterations: so *two stages*, a few Gauss–Newton steps
on the residual first. Where these attain the bound of eq. (6), they are the answer.

It is stated for one joint at a time, all equally likely to fail. For k > 1 the condition is
J_Fᵀ (JJᵀ − tI)⁻¹ J_F ⪯ I, a matrix inequality, which is not smooth without factors of its own.
Where a joint never fails, JJᵀ − tI may be singular at the optimum.
"""

from collections.abc import Mapping
from types import MappingProxyType

import casadi as ca
import numpy as np

from lockedjoint.formulations.encodings.columns import Columns, inverse, second
from lockedjoint.formulations.joints.joint import ArmModel
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.options import OptionValue
from lockedjoint.nlp.problem import Constraint, Derivatives, Evaluation, Problem, Stage

# t starts where eq. (6) bounds it, or at this share of λ_min(JJᵀ) if that is less: at 1 the
# matrix JJᵀ − tI would be singular.
_LEVEL_SHARE = 0.9
# Squared norms of columns that differ by less are equal.
_SAME_NORM = 1e-9
# What is added to the diagonal of the Hessian for Fatrop: the frame's directions have no
# curvature.
_SHIFT = 1e-4
#: Options of Fatrop. With a smaller tolerance some starts never meet it. The value that is
#: found with this one is 2e-8 below the optimum.
FATROP_OPTIONS: Mapping[str, OptionValue] = MappingProxyType({"tol": 1e-6})


def build(arm: ArmModel, first: Stage | None, options: Mapping[str, OptionValue]) -> Problem:
    """State the problem for an arm, with the output ``jacobian``.

    `first` is the stage that makes the residual small, None for a single stage; `options` are
    those of Ipopt. The variables are x and then t.
    """
    variables, t = arm.symbols(), ca.SX.sym("t")
    matrix, constraints = arm.matrix(variables), arm.constraints(variables)
    m, n = arm.shape
    inverted = inverse(matrix @ matrix.T - t * ca.SX.eye(m))
    rows = ca.sum1(matrix * (inverted @ matrix)).T  # j_fᵀ (JJᵀ − tI)⁻¹ j_f for each f
    lower, upper = arm.bounds
    gram = Evaluation(variables, [matrix @ matrix.T])
    norms = Evaluation(variables, [ca.sum1(matrix**2)])(arm.sample(np.random.default_rng(0)))[0]
    # Fatrop does not converge where joints have equations of their own. From random starts, or
    # with columns of several lengths, its restoration phase may add to the Hessian forever,
    # where neither iterations nor time are limited.
    shift = _SHIFT if first and not constraints and np.ptp(norms) < _SAME_NORM else None

    def complete_start(point: FloatArray) -> FloatArray:
        """Return x and t to start from; (n − m)T/(nm), T = tr JJᵀ, is the bound of eq. (6)."""
        squares = np.linalg.eigvalsh(gram(point)[0])
        bound = (n - m) / n * squares.sum() / m
        return np.append(point, min(_LEVEL_SHARE * squares[0], bound))

    return Problem(
        name="max-min",
        variables=ca.vertcat(variables, t),
        objective=ca.log(t),
        sense="maximise",
        constraints=(*constraints, Constraint("deleted column", rows, -np.inf, 1.0)),
        lower=np.append(lower, -np.inf),
        upper=np.append(upper, np.inf),
        outputs={"jacobian": matrix},
        complete_start=complete_start,
        options={"ipopt": options, "fatrop": FATROP_OPTIONS},
        derivatives=_derivatives(variables, matrix, constraints, shift),
        first=first,
    )


def _derivatives(
    variables: ca.SX, matrix: ca.SX, constraints: tuple[Constraint, ...], shift: float | None
) -> Derivatives:
    """Return the derivatives of the problem in z = (x, t), as a solver asks for them.

    The Hessian, shape (N + 1, N + 1), is that of the Lagrangian: σ times the objective, which
    is minimised as −log t, plus multipliers times constraints, the joints' own ones first.
    """
    own = ca.vertcat(*(constraint.expression for constraint in constraints))
    columns = Columns.of(variables, matrix)
    size, count = variables.numel(), own.numel()
    z, sigma = ca.MX.sym("z", size + 1), ca.MX.sym("sigma")
    multipliers = ca.MX.sym("lambda", count + matrix.shape[1])
    x, t = z[:size], z[size]
    slopes = _slopes(columns, x, t)
    hessian = _second(columns, x, t, multipliers[count:])
    hessian[size, size] -= sigma / t**2
    if count:
        plain = ca.Function("plain", [variables], [ca.jacobian(own, variables)])
        slopes = ca.vertcat(ca.horzcat(plain(x), ca.MX(count, 1)), slopes)
        hessian[:size, :size] += second(variables, own)(x, multipliers[:count])
    return Derivatives(
        ca.Function("hessian", [z, sigma, multipliers], [hessian]),
        ca.Function("slopes", [z], [slopes]),
        shift,
    )


def _slopes(columns: Columns, x: ca.MX, t: ca.MX) -> ca.MX:
    """Return ∂g/∂(x, t), shape (n, N + 1): 2 (I − K)[:, k] ∘ R and ‖w_f‖², see `_second`."""
    jacobian, directions = columns.matrix(x)
    m, n = jacobian.shape
    solved = _inverse(m)(jacobian @ jacobian.T, t) @ jacobian
    apart = (ca.MX.eye(n) - jacobian.T @ solved)[:, list(columns.owner)]
    own = 2 * apart * (solved.T @ directions)
    return ca.horzcat(columns.slopes(x, own), ca.sum1(solved**2).T)


def _second(columns: Columns, x: ca.MX, t: ca.MX, multipliers: ca.MX) -> ca.MX:
    """Return second derivatives of Σ λ_f g_f in (x, t), g_f = j_fᵀ (JJᵀ − tI)⁻¹ j_f.

    Shape (N + 1, N + 1). D, k and the subscript ₓ are those of `encodings.columns`, λ are the
    multipliers. With P = (JJᵀ − tI)⁻¹, W = PJ, columns w_f, K = JᵀW, R = WᵀD, Λ = diag λ,
    C = WΛWᵀ, Q = JᵀCJ, and the gradient in J, 2 (WΛ − CJ)::

        xx  2 [T + Tᵀ + DᵀCD ∘ (K − I)ₓ + DᵀPD ∘ (Q − λ1ᵀ∘K − 1λᵀ∘K + Λ)ₓ
               − (λ1ᵀ + 1λᵀ)ₓ ∘ Rᵀ[:, k] ∘ R[k, :]],   T = (DᵀCJ)[:, k] ∘ R[k, :]
        xt  2 d_pᵀ (λ P w − P C j − C w),  λ, w and j those of joint k(p)
        tt  2 tr(PC)
    """
    k = list(columns.owner)
    jacobian, directions = columns.matrix(x)  # J and D
    m, n = jacobian.shape
    inverted = _inverse(m)(jacobian @ jacobian.T, t)  # P
    solved = inverted @ jacobian  # W
    gram, across = jacobian.T @ solved, (solved.T @ directions)[k, :]  # K and R[k, :]
    weighted = solved @ ca.diag(multipliers)  # WΛ
    middle = weighted @ solved.T  # C
    bent = middle @ jacobian  # CJ
    pairs = ca.repmat(multipliers, 1, n) + ca.repmat(multipliers.T, n, 1)  # λ1ᵀ + 1λᵀ
    rest = jacobian.T @ bent - pairs * gram + ca.diag(multipliers)
    turned = (directions.T @ bent)[:, k] * across  # T
    own = turned + turned.T - pairs[k, k] * across.T * across
    own += (directions.T @ (middle @ directions)) * (gram - ca.MX.eye(n))[k, k]
    own += (directions.T @ (inverted @ directions)) * rest[k, k]
    gradient = 2 * (weighted - bent)
    mixed = inverted @ (weighted - bent) - middle @ solved
    by_level = 2 * ca.sum1(directions * mixed[:, k])
    corner = 2 * ca.dot(inverted, middle)
    edge = columns.slopes(x, by_level).T
    return ca.blockcat([[columns.second(x, 2 * own, gradient), edge], [edge.T, corner]])


def _inverse(size: int) -> ca.Function:
    """Return the function of M and t that is (M − tI)⁻¹, for M of shape (size, size)."""
    gram, level = ca.SX.sym("M", size, size), ca.SX.sym("t")
    return ca.Function("inverse", [gram, level], [inverse(gram - level * ca.SX.eye(size))])
