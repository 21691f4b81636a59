"""The isotropy equations JJᵀ = (T/m)I, row by row (Section 4, eqs. 22–43)."""

import casadi as ca
import numpy as np

from formulations.joints.joint import ColumnModel
from nlp.arrays import FloatArray

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
    basis: list[FloatArray] = []
    rows = []
    for k in range(values.shape[1]):
        rest = _remainder(values[:, k], basis)
        if np.linalg.norm(rest) > _RANK_TOLERANCE * np.linalg.norm(values[:, k]):
            basis.append(rest / np.linalg.norm(rest))
            rows.append(k)
    return rows


def sampled(arm: ColumnModel, variables: ca.SX, expressions: ca.SX) -> FloatArray:
    """Values of expressions at random configurations, more than there are expressions.

    Returns
    -------
    numpy.ndarray
        Shape (configurations, expressions), the same at every call.
    """
    function = ca.Function("sampled", [variables], [expressions])
    rng = np.random.default_rng(1995)
    count = 3 * expressions.numel() + 10
    return np.array([np.array(function(arm.sample(rng))).ravel() for _ in range(count)])


def constant_where_isotropic(
    arm: ColumnModel, variables: ca.SX, expression: ca.SX
) -> float | None:
    """The value that a scalar has at every isotropic Jacobian of the arm, if it is a
    combination of `residuals` and a constant; None otherwise.
    """  # noqa: D205
    columns = sampled(arm, variables, ca.vertcat(residuals(arm, variables), expression))
    design = np.column_stack([np.ones(columns.shape[0]), columns[:, :-1]])
    target = columns[:, -1]
    weights, *_ = np.linalg.lstsq(design, target, rcond=_RANK_TOLERANCE)
    error = np.linalg.norm(design @ weights - target)
    return float(weights[0]) if error <= 1e-8 * (1 + np.linalg.norm(target)) else None


def _remainder(vector: FloatArray, basis: list[FloatArray]) -> FloatArray:
    for _ in range(2):  # twice is enough for orthogonality to rounding
        for direction in basis:
            vector = vector - (direction @ vector) * direction
    return vector
