"""The residuals of unit revolute joints and their derivatives in NumPy, for peers.

Eq. (21) and the isotropy equations as one would write them by hand, with analytic
derivatives. Their sum of squares is ½ ‖JJᵀ − (n/3) I‖_F²: diagonal entries are weighted by √½.
"""

from typing import Any, TypeAlias

import numpy as np

from nlp.arrays import FloatArray

_ROWS, _COLUMNS = np.triu_indices(6)
_WEIGHTS = np.where(_ROWS == _COLUMNS, np.sqrt(0.5), 1.0)


# A vector of NumPy; or of JAX where the library is jax.numpy.
_Array: TypeAlias = Any


def jacobian(angles: _Array, library: Any = np) -> _Array:
    """Return J, shape (6, n), for angles (α_1, β_1, γ_1, α_2, …)."""
    return _columns(angles, library)[0]


def residuals(angles: _Array, library: Any = np) -> _Array:
    """Return the 21 weighted isotropy equations."""
    matrix = jacobian(angles, library)
    gap = matrix @ matrix.T - matrix.shape[1] / 3 * np.eye(6)
    return _WEIGHTS * gap[_ROWS, _COLUMNS]


def derivatives(angles: FloatArray) -> FloatArray:
    """Return the derivatives of `residuals`, shape (21, 3n)."""
    matrix, turned = _columns(angles)
    matrix = matrix[:, :, None]
    both = turned[_ROWS] * matrix[_COLUMNS] + matrix[_ROWS] * turned[_COLUMNS]
    return np.asarray((_WEIGHTS[:, None, None] * both).reshape(21, -1))


def chain(angles: FloatArray, slope: FloatArray) -> FloatArray:
    """Return the gradient in the angles of a function with this gradient in J."""
    return np.asarray(np.einsum("an,ank->nk", slope, _columns(angles)[1])).ravel()


def locked_eigenvalues(angles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Eigenvalues of JJᵀ − j_f j_fᵀ for each joint f, and their derivatives by eigenvectors.

    Returns
    -------
    values
        Shape (6n,), those of one failure after the other, each in ascending order.
    slopes
        Shape (6n, 3n). Where eigenvalues meet they are those of one choice of eigenvectors.
    """
    matrix, turned = _columns(angles)
    n = matrix.shape[1]
    gram = matrix @ matrix.T
    values, vectors = np.linalg.eigh(gram - np.einsum("an,bn->nab", matrix, matrix))
    along = np.einsum("fak,ai->fki", vectors, matrix)
    along[np.arange(n), :, np.arange(n)] = 0.0  # a locked joint moves nothing
    slopes = 2 * along[..., None] * np.einsum("fak,aic->fkic", vectors, turned)
    return values.ravel(), np.asarray(slopes.reshape(6 * n, 3 * n))


def _columns(angles: _Array, library: Any = np) -> tuple[_Array, _Array]:
    """J and its derivatives in each joint's own angles, shape (6, n, 3)."""
    array, vstack = library.array, library.vstack
    alpha, beta, gamma = angles.reshape(-1, 3).T
    turns = array([alpha, beta, gamma])
    (sa, sb, sc), (ca, cb, cc) = library.sin(turns), library.cos(turns)
    zero = library.zeros_like(sa)
    first, second = array([ca * sb, sa * sb, -cb]), array([sa, -ca, zero])
    matrix = vstack([cc * first + sc * second, array([ca * cb, sa * cb, sb])])
    first_by_alpha, second_by_alpha = array([-sa * sb, ca * sb, zero]), array([ca, sa, zero])
    moving = cc * first_by_alpha + sc * second_by_alpha
    by_alpha = vstack([moving, array([-sa * cb, ca * cb, zero])])
    by_beta = vstack([cc * matrix[3:], array([-ca * sb, -sa * sb, cb])])
    by_gamma = vstack([cc * second - sc * first, array([zero, zero, zero])])
    return matrix, library.stack([by_alpha, by_beta, by_gamma], axis=2)
