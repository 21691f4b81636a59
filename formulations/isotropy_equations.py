"""The isotropy equations JJᵀ = (T/m)I, row by row (Section 4, eqs. 22–43, and the Appendix).

For unit revolute joints, α_i, β_i, γ_i as in eq. (21), the Appendix expands the distinct
entries of JJᵀ − (n/3)I in closed form. Three remarks on the print:

- f_17 repeats f_18, −Σ sinβ cosβ cosγ. By eq. (39) it is v_zᵀω_y = −Σ sinα cos²β cosγ.
- f_1 … f_6 are n/3 − v_xᵀv_x and so on, the negatives of eqs. (23)–(28).
- Their 7/3 is n/3 for the paper's n = 7; here it is n/3.
"""

import casadi as ca
import numpy as np

from lockedjoint.formulations.joints.joint import ColumnModel
from lockedjoint.formulations.joints.models import is_unit_revolute
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError

#: Sign of the Appendix's f_k as printed relative to eqs. (23)–(43), k = 1 … 21.
SIGNS = (-1,) * 6 + (1,) * 15
#: The printed number of the misprinted equation.
MISPRINTED = 17
# A row is redundant when what is left of it, relative to its size, is below this.
_RANK_TOLERANCE = 1e-9


def pairs(task_dimension: int) -> list[tuple[int, int]]:
    """Entries (i, j) of JJᵀ in the order of f_1 … f_21: the diagonal, then row by row."""
    m = task_dimension
    return [(i, i) for i in range(m)] + [(i, j) for i in range(m) for j in range(i + 1, m)]


def mean_eigenvalue(arm: ColumnModel, variables: ca.SX) -> ca.SX:
    """T/m, what every eigenvalue of JJᵀ must be: a constant where the joints fix T."""
    m, _ = arm.shape
    if arm.fixed_trace is not None:
        return ca.SX(arm.fixed_trace / m)
    return ca.sumsqr(arm.matrix(variables)) / m


def residuals(arm: ColumnModel, variables: ca.SX) -> ca.SX:
    """The m(m + 1)/2 distinct entries of JJᵀ − (T/m)I, shape (m(m + 1)/2, 1)."""
    matrix = arm.matrix(variables)
    deviation = matrix @ matrix.T - mean_eigenvalue(arm, variables) * ca.SX.eye(arm.shape[0])
    return ca.vertcat(*(deviation[i, j] for i, j in pairs(arm.shape[0])))


def independent_rows(arm: ColumnModel) -> list[int]:
    """Rows of `residuals` that are linearly independent as functions on the arm's Jacobians.

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


def sampled(arm: ColumnModel, variables: ca.SX, expressions: ca.SX) -> FloatArray:
    """Values of expressions at more random configurations than there are expressions.

    Shape (configurations, expressions), the same at every call.
    """
    function = ca.Function("sampled", [variables], [expressions])
    rng = np.random.default_rng(1995)
    count = 3 * expressions.numel() + 10
    return np.array([np.array(function(arm.sample(rng))).ravel() for _ in range(count)])


def constants_where_isotropic(
    arm: ColumnModel, variables: ca.SX, expressions: ca.SX
) -> FloatArray:
    """Values that expressions, a column, have at every isotropic Jacobian of the arm.

    NaN where one is no combination of `residuals` and a constant.
    """
    equations = residuals(arm, variables)
    columns = sampled(arm, variables, ca.vertcat(equations, expressions))
    parts = np.split(columns, [equations.numel()], axis=1)
    design, targets = np.insert(parts[0], 0, 1.0, axis=1), parts[1]
    weights, *_ = np.linalg.lstsq(design, targets, rcond=_RANK_TOLERANCE)
    errors = np.linalg.norm(design @ weights - targets, axis=0)
    known = errors <= 1e-8 * (1 + np.linalg.norm(targets, axis=0))
    return np.where(known, weights[0], np.nan)


def closed_forms(variables: ca.SX, as_printed: bool = False) -> ca.SX:
    """f_1 … f_21 with the Appendix's signs.

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


def appendix_residuals(arm: ColumnModel, variables: ca.SX) -> ca.SX:
    """f_1 … f_21 with the signs of eqs. (23)–(43), f_17 corrected, shape (21, 1).

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
    """One joint's share in the sums of f_1 … f_6 and of f_7 … f_21."""
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
