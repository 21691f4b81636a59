"""The residuals of unit revolute joints and their derivatives in NumPy, for peers.

Eq. (21) and the isotropy equations as one would write them by hand, with analytic
derivatives. Their sum of squares is ½ ‖JJᵀ − (n/3) I‖_F²: diagonal entries are weighted by √½.
"""

from __future__ import annotations

import numpy as np

from nlp.arrays import FloatArray

_ROWS, _COLUMNS = np.triu_indices(6)
_WEIGHTS = np.where(_ROWS == _COLUMNS, np.sqrt(0.5), 1.0)


def jacobian(angles: FloatArray) -> FloatArray:
    """Return J, shape (6, n), for angles (α_1, β_1, γ_1, α_2, …)."""
    return _columns(angles)[0]


def residuals(angles: FloatArray) -> FloatArray:
    """Return the 21 weighted isotropy equations."""
    matrix = jacobian(angles)
    gap = matrix @ matrix.T - matrix.shape[1] / 3 * np.eye(6)
    return np.asarray(_WEIGHTS * gap[_ROWS, _COLUMNS])


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


def _columns(angles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """J and its derivatives in each joint's own angles, shape (6, n, 3)."""
    alpha, beta, gamma = angles.reshape(-1, 3).T
    (sa, sb, sc), (ca, cb, cc) = np.sin([alpha, beta, gamma]), np.cos([alpha, beta, gamma])
    zero = np.zeros_like(sa)
    first, second = np.array([ca * sb, sa * sb, -cb]), np.array([sa, -ca, zero])
    matrix = np.vstack([cc * first + sc * second, [ca * cb, sa * cb, sb]])
    by_alpha = np.vstack(
        [
            cc * np.array([-sa * sb, ca * sb, zero]) + sc * np.array([ca, sa, zero]),
            [-sa * cb, ca * cb, zero],
        ]
    )
    by_beta = np.vstack([cc * matrix[3:], [-ca * sb, -sa * sb, cb]])
    by_gamma = np.vstack([cc * second - sc * first, np.zeros((3, len(alpha)))])
    return matrix, np.stack([by_alpha, by_beta, by_gamma], axis=2)
