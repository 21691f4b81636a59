"""The isotropy equations JJᵀ = (T/m)I, row by row (Section 4, eqs. 22–43, and the Appendix).

J is the Jacobian, shape (m, n), one column per joint; T = tr JJᵀ. With m = 6 a column is (v_i;
ω_i), and v_x is the first row of J, of all joints. An *equation* is here its left side, an
expression in the arm's variables, which is zero where it holds.

For unit revolute joints, with the angles α_i, β_i, γ_i of eq. (21) in radians as variables, the
Appendix expands the distinct entries of JJᵀ − (n/3)I in closed form. Three remarks on the
print:

- f_17 repeats f_18, −Σ sinβ cosβ cosγ. By eq. (39) it is v_zᵀω_y = −Σ sinα cos²β cosγ.
- f_1 … f_6 are n/3 − v_xᵀv_x and so on, the negatives of eqs. (23)–(28).
- Their 7/3 is n/3 for the paper's n = 7; here it is n/3.
"""

import casadi as ca
import numpy as np

from lockedjoint.formulations.joints.joint import ArmModel
from lockedjoint.formulations.joints.models import is_unit_revolute
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError

#: Sign of the Appendix's f_k as printed relative to eqs. (23)–(43), k = 1 … 21.
SIGNS = (-1,) * 6 + (1,) * 15
#: The printed number of the misprinted equation.
MISPRINTED = 17
# A row is redundant when what is left of it, relative to its size, is below this. Rounding
# leaves about 1e-14, a row that is independent about 1.
_RANK_TOLERANCE = 1e-9
# An expression is a combination of others if their difference, relative to its size, is below
# this.
_COMBINATION_TOLERANCE = 1e-8
# Seed of the random configurations at which expressions are sampled: ranks must not change from
# call to call.
_SEED = 1995
# Configurations per expression. Any number above 1 is enough for the rank; more even out
# chance.
_SAMPLES_PER_EXPRESSION = 3
# Configurations beside these, for a single expression or two.
_MORE_SAMPLES = 10


def pairs(task_dimension: int) -> list[tuple[int, int]]:
    """Return the entries (i, j) of JJᵀ, counted from 0, in the order of f_1 … f_21.

    The diagonal comes first, then what is above it row by row.
    """
    m = task_dimension
    return [(i, i) for i in range(m)] + [(i, j) for i in range(m) for j in range(i + 1, m)]


def mean_eigenvalue(arm: ArmModel, variables: ca.SX) -> ca.SX:
    """Return T/m, what every eigenvalue of JJᵀ must be: a constant where the joints fix T."""
    m, _ = arm.shape
    if arm.fixed_trace is not None:
        return ca.SX(arm.fixed_trace / m)
    return ca.sumsqr(arm.matrix(variables)) / m


def residuals(arm: ArmModel, variables: ca.SX) -> ca.SX:
    """Return the m(m + 1)/2 distinct entries of JJᵀ − (T/m)I, shape (m(m + 1)/2, 1)."""
    matrix = arm.matrix(variables)
    deviation = matrix @ matrix.T - mean_eigenvalue(arm, variables) * ca.SX.eye(arm.shape[0])
    return ca.vertcat(*(deviation[i, j] for i, j in pairs(arm.shape[0])))


def independent_rows(arm: ArmModel) -> list[int]:
    """Return the rows of `residuals` that are independent as functions on the arm's Jacobians.

    The others follow from them whatever the joints' parameters are: 21 rows leave 18 for
    unit revolute joints (Section 4), 19 with free lever arms. Equality constraints that
    repeat one another have no unique multipliers, and cost Ipopt its convergence. A row that
    contradicts the others is no repetition, and stays: an impossible arm must look it.
    """
    variables = arm.symbols()
    values = sampled(arm, variables, residuals(arm, variables))
    rows: list[int] = []
    for k, column in enumerate(values.T):
        others = values[:, rows]
        rest = column - others @ np.linalg.lstsq(others, column, rcond=None)[0]
        if np.linalg.norm(rest) > _RANK_TOLERANCE * np.linalg.norm(column):
            rows.append(k)
    return rows


def sampled(arm: ArmModel, variables: ca.SX, expressions: ca.SX) -> FloatArray:
    """Return values of expressions at more random configurations than there are expressions.

    Shape (configurations, expressions), the same at every call.
    """
    function = ca.Function("sampled", [variables], [expressions])
    rng = np.random.default_rng(_SEED)
    count = _SAMPLES_PER_EXPRESSION * expressions.numel() + _MORE_SAMPLES
    return np.array([np.array(function(arm.sample(rng))).ravel() for _ in range(count)])


def constants_where_isotropic(
    arm: ArmModel, variables: ca.SX, expressions: ca.SX
) -> FloatArray:
    """Return the values that expressions have at every isotropic Jacobian of the arm.

    `expressions` is a column, what is returned has shape (expressions,). A combination of
    `residuals` and a constant has this constant, since `residuals` are zero there; NaN where an
    expression is no such combination.
    """
    equations = residuals(arm, variables)
    columns = sampled(arm, variables, ca.vertcat(equations, expressions))
    parts = np.split(columns, [equations.numel()], axis=1)
    design, targets = np.insert(parts[0], 0, 1.0, axis=1), parts[1]
    weights, *_ = np.linalg.lstsq(design, targets, rcond=_RANK_TOLERANCE)
    errors = np.linalg.norm(design @ weights - targets, axis=0)
    known = errors <= _COMBINATION_TOLERANCE * (1 + np.linalg.norm(targets, axis=0))
    return np.where(known, weights[0], np.nan)


def closed_forms(variables: ca.SX, as_printed: bool = False) -> ca.SX:
    """Return f_1 … f_21 with the Appendix's signs.

    Parameters
    ----------
    variables
        α_1, β_1, γ_1, α_2, …, in radians, shape (3n, 1).
    as_printed
        Whether to keep the misprint in f_17.

    Returns
    -------
    casadi.SX
        Shape (21, 1).

    Raises
    ------
    InputError
        If there are not three angles for every joint.
    """
    if not variables.is_column() or variables.numel() % 3 or not variables.numel():
        allowed = "a column of three angles per joint"
        raise InputError("variables", f"of shape {variables.shape}", allowed)
    n = variables.numel() // 3
    joints = [_summands(*ca.vertsplit(variables[3 * i : 3 * i + 3])) for i in range(n)]
    norms = [n / 3 - sum(joint[0][k] for joint in joints) for k in range(6)]
    products = [sum(joint[1][k] for joint in joints) for k in range(15)]
    forms = ca.vertcat(*norms, *products)
    if as_printed:
        forms[MISPRINTED - 1] = forms[MISPRINTED]
    return forms


def appendix_residuals(arm: ArmModel, variables: ca.SX) -> ca.SX:
    """Return f_1 … f_21 with the signs of eqs. (23)–(43), f_17 corrected, shape (21, 1).

    The same functions as `residuals`, written as in the Appendix.

    Raises
    ------
    InputError
        If a joint of the arm is not a unit revolute one.
    """
    if not is_unit_revolute(arm):
        raise InputError("arm", f"of {arm.description}", "unit revolute joints only")
    return closed_forms(variables) * ca.DM(SIGNS)


def _summands(alpha: ca.SX, beta: ca.SX, gamma: ca.SX) -> tuple[list[ca.SX], list[ca.SX]]:
    """Return one joint's terms in the sums of f_1 … f_6 and of f_7 … f_21, from its angles.

    They are the products of entries of its column (v; ω), v_x² to ω_z² and then v_x v_y to
    ω_y ω_z, multiplied out as the Appendix prints them.
    """
    s_a, c_a, s_b, c_b = ca.sin(alpha), ca.cos(alpha), ca.sin(beta), ca.cos(beta)
    s_g, c_g = ca.sin(gamma), ca.cos(gamma)
    mixed = 2 * s_a * c_a * s_b * s_g * c_g
    norms = [
        c_a**2 * s_b**2 * c_g**2 + mixed + s_a**2 * s_g**2,
        s_a**2 * s_b**2 * c_g**2 - mixed + c_a**2 * s_g**2,
        c_b**2 * c_g**2,
        c_a**2 * c_b**2,
        s_a**2 * c_b**2,
        s_b**2,
    ]
    products = [
        s_a * c_a * s_b**2 * c_g**2
        - c_a**2 * s_b * s_g * c_g
        + s_a**2 * s_b * s_g * c_g
        - s_a * c_a * s_g**2,
        -c_a * s_b * c_b * c_g**2 - s_a * c_b * s_g * c_g,
        c_a**2 * s_b * c_b * c_g + s_a * c_a * c_b * s_g,
        s_a * c_a * s_b * c_b * c_g + s_a**2 * c_b * s_g,
        c_a * s_b**2 * c_g + s_a * s_b * s_g,
        -s_a * s_b * c_b * c_g**2 + c_a * c_b * s_g * c_g,
        s_a * c_a * s_b * c_b * c_g - c_a**2 * c_b * s_g,
        s_a**2 * s_b * c_b * c_g - s_a * c_a * c_b * s_g,
        s_a * s_b**2 * c_g - c_a * s_b * s_g,
        -c_a * c_b**2 * c_g,
        -s_a * c_b**2 * c_g,
        -s_b * c_b * c_g,
        s_a * c_a * c_b**2,
        c_a * s_b * c_b,
        s_a * s_b * c_b,
    ]
    return norms, products
