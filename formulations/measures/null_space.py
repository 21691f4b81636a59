"""Each joint's share in the range of Jᵀ and in its complement (eqs. 9–11)."""

import numpy as np
import numpy.typing as npt

from formulations.measures.jacobian import as_jacobian, numerical_rank
from nlp.arrays import FloatArray


def range_contributions(jacobian: npt.ArrayLike) -> FloatArray:
    """R_i, each joint's share in the range of Jᵀ, shape (n,) (eq. 9)."""
    matrix = as_jacobian(jacobian)
    _, values, rows = np.linalg.svd(matrix, full_matrices=False)
    return np.asarray(np.sum(rows[: numerical_rank(values, matrix)] ** 2, axis=0))


def null_space_contributions(jacobian: npt.ArrayLike) -> FloatArray:
    """N_i = 1 − R_i, each joint's share in the null space, shape (n,) (eqs. 10–11)."""
    return 1.0 - range_contributions(jacobian)
