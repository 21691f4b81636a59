"""A Jacobian before a failure: singular values, joints' shares, isotropy (eqs. 3–4, 9–11)."""

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


def range_contributions(jacobian: npt.ArrayLike) -> FloatArray:
    """R_i, each joint's share in the range of Jᵀ, shape (n,) (eq. 9)."""
    matrix = as_jacobian(jacobian)
    _, values, rows = np.linalg.svd(matrix, full_matrices=False)
    return np.asarray(np.sum(rows[: numerical_rank(values, matrix)] ** 2, axis=0))


def null_space_contributions(jacobian: npt.ArrayLike) -> FloatArray:
    """N_i = 1 − R_i, each joint's share in the null space, shape (n,) (eqs. 10–11)."""
    return 1.0 - range_contributions(jacobian)


def isotropy_defect(jacobian: npt.ArrayLike) -> float:
    """½‖JJᵀ − (T/m)I‖_F², zero exactly for isotropic J; the same in every frame."""
    return 0.5 * float(np.sum(_deviation(as_jacobian(jacobian)) ** 2))


def residual_sum_of_squares(jacobian: npt.ArrayLike) -> float:
    """fᵀf: squares of the m(m + 1)/2 distinct entries of JJᵀ − (T/m)I (eqs. 23–43).

    Each off-diagonal counts once, so the value depends on the frame; its minimum over
    frames is `isotropy_defect`.
    """
    deviation = _deviation(as_jacobian(jacobian))
    return float(np.sum(deviation[np.triu_indices(deviation.shape[0])] ** 2))


def is_optimally_failure_tolerant(jacobian: npt.ArrayLike, tolerance: float = 1e-6) -> bool:
    """Whether J is isotropic with columns of equal norm, to a relative tolerance (Section 2).

    Both JJᵀ = (T/m)I and ‖j_i‖² = T/n may be off by at most `tolerance`·T/m in any entry.
    """
    matrix = as_jacobian(jacobian)
    m, n = matrix.shape
    size = trace(matrix)
    norms = np.sum(matrix**2, axis=0)
    error = max(np.max(np.abs(_deviation(matrix))), np.max(np.abs(norms - size / n)))
    return bool(size > 0 and error <= tolerance * size / m)


def _deviation(matrix: FloatArray) -> FloatArray:
    gram = matrix @ matrix.T
    return np.asarray(gram - np.trace(gram) / gram.shape[0] * np.eye(gram.shape[0]))
