"""How far JJᵀ is from a multiple of the identity: E = mJJᵀ/tr(JJᵀ) − I, and its slopes by J.

J has the shape (m, n); it is isotropic where E = 0.
"""

import numpy as np

from lockedjoint.nlp.arrays import FloatArray


def unevenness(jacobian: FloatArray) -> FloatArray:
    """Return E, shape (m, m)."""
    gram = jacobian @ jacobian.T
    return np.asarray(len(gram) * gram / np.trace(gram) - np.eye(len(gram)))


def weighted_slopes(jacobian: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the gradient of ⟨weights, E⟩ by J, shape (m, n); weights (m, m), symmetric.

    It is 2m/T (W − ⟨W, JJᵀ⟩/T I) J with T = tr JJᵀ.
    """
    gram = jacobian @ jacobian.T
    size = np.trace(gram)
    mean = np.sum(weights * gram) / size
    return np.asarray(2 * len(gram) / size * (weights @ jacobian - mean * jacobian))


def entries(jacobian: FloatArray) -> FloatArray:
    """Return the lower triangle of E, row after row, shape (m(m + 1)/2,)."""
    return np.asarray(unevenness(jacobian)[np.tril_indices(len(jacobian))])


def entry_slopes(jacobian: FloatArray) -> FloatArray:
    """Return the slopes of `entries` by J, (m(m + 1)/2, m·n), column of J after column."""
    rows = []
    for row, column in zip(*np.tril_indices(len(jacobian)), strict=True):
        weights = np.zeros((len(jacobian),) * 2)
        weights[row, column] += 0.5
        weights[column, row] += 0.5
        rows.append(weighted_slopes(jacobian, weights).ravel(order="F"))
    return np.array(rows)
