"""A Jacobian as an array of floats, and its singular values (eqs. 3–4)."""

import numpy as np
import numpy.typing as npt

from nlp.arrays import FloatArray, as_floats
from nlp.errors import InputError

# The fourth powers of larger entries are too near the largest floating-point number.
LARGEST_ENTRY = 1e70


def as_jacobian(jacobian: npt.ArrayLike, name: str = "jacobian") -> FloatArray:
    """Return the array as a Jacobian of floats.

    Raises
    ------
    InputError
        If it is not two-dimensional, has NaN, infinity or entries beyond `LARGEST_ENTRY`, or
        no more columns than rows.
    """
    matrix = as_floats(name, jacobian)
    if matrix.ndim != 2 or 0 in matrix.shape:
        raise InputError(name, f"of shape {matrix.shape}", "a matrix, one column per joint")
    if not np.all(np.isfinite(matrix)):
        raise InputError(name, "a matrix with NaN or infinity", "finite numbers only")
    largest = float(np.max(np.abs(matrix)))
    if largest > LARGEST_ENTRY:
        allowed = f"entries of at most {LARGEST_ENTRY:g} in magnitude"
        raise InputError(name, f"a matrix with an entry of {largest:g}", allowed)
    m, n = matrix.shape
    if n <= m:
        allowed = "more columns (joints) than rows (task dimensions)"
        raise InputError(name, f"of shape {m}×{n}", allowed)
    return matrix


def trace(jacobian: npt.ArrayLike) -> float:
    """T = ‖J‖_F² = tr JJᵀ."""
    return float(np.sum(as_jacobian(jacobian) ** 2))


def singular_values(jacobian: npt.ArrayLike) -> FloatArray:
    """Singular values in descending order, shape (m,) (eqs. 3–4)."""
    return np.asarray(np.linalg.svd(as_jacobian(jacobian), compute_uv=False))


def condition_number(jacobian: npt.ArrayLike) -> float:
    """σ₁/σ_m; infinity for a singular Jacobian."""
    values = singular_values(jacobian)
    return float(values[0] / values[-1]) if values[-1] > 0 else float("inf")


def manipulability(jacobian: npt.ArrayLike) -> float:
    """√det(JJᵀ), the product of the singular values (Yoshikawa, 1985)."""
    with np.errstate(over="ignore"):  # infinity, where many of them are large
        return float(np.prod(singular_values(jacobian)))


def numerical_rank(values: FloatArray, matrix: FloatArray) -> int:
    """Return the number of singular values that are more than rounding."""
    return int(np.sum(values > values[0] * max(matrix.shape) * np.finfo(float).eps))
