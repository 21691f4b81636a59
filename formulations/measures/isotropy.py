"""How far a Jacobian is from isotropic, and from optimally failure tolerant (Section 2)."""

import numpy as np
import numpy.typing as npt

from formulations.measures.jacobian import as_jacobian, trace
from nlp.arrays import FloatArray


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
