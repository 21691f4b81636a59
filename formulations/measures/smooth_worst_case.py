"""A smooth lower bound of the worst case, for solvers and control loops that need slopes.

At a maximum of σ several failures, and several singular values of one, are equally bad, and
the worst case has a kink. With all singular values σ_fi that single failures f leave,

    s = −w log Σ_fi exp(−σ_fi/w)          σ − w log(mn) ≤ s ≤ σ,

has none: a symmetric function of singular values is as smooth as it is in them (Lewis, 1996),
but where one of weight is 0.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from formulations.measures.many_failures import FAR_FROM_SINGULAR, checked_stack
from nlp.arrays import FloatArray, real_number


@dataclass(frozen=True, eq=False)
class SmoothWorstCases:
    """The smooth worst case of each of N Jacobians.

    Attributes
    ----------
    value
        s, shape (N,): at most the worst case (eq. 5).
    gradient
        ∂s/∂J, shape (N, m, n).
    error
        w log(mn): s is at most so far below the worst case.
    """

    value: FloatArray
    gradient: FloatArray
    error: float


def smooth_worst_case_batch(jacobians: npt.ArrayLike, width: float = 0.01) -> SmoothWorstCases:
    """Smooth lower bound of the worst case over single failures, of many Jacobians at once.

    Parameters
    ----------
    jacobians
        Shape (N, m, n), n > m.
    width
        w > 0, in the unit of J: singular values that are closer count together.

    Raises
    ------
    InputError
        If the shape is another, an entry is not finite or too large, or the width is not
        above 0.
    """
    stack = checked_stack(jacobians)
    width = real_number("width", width, "a number from 1e-6 to 1e6", 1e-6, 1e6)
    count, m, n = stack.shape
    error = width * float(np.log(m * n))
    if not count:
        return SmoothWorstCases(np.zeros(0), np.zeros(stack.shape), error)
    columns = stack.transpose(0, 2, 1)
    values, left = np.linalg.eigh(
        (stack @ columns)[:, None] - columns[:, :, :, None] * columns[:, :, None, :]
    )
    left = left.transpose(0, 1, 3, 2)
    far = values[:, :, 0].min(axis=1) > FAR_FROM_SINGULAR * values[:, :, -1].max(axis=1)
    sigmas = np.sqrt(np.maximum(values, np.finfo(float).tiny))
    value, shares = _soft_minimum(sigmas, width)
    # v_fi = J_Fᵀu_fi/σ_fi
    rows = left @ stack[:, None]
    rows[:, range(n), :, range(n)] = 0.0
    weighted = (shares / sigmas)[:, :, :, None] * left
    gradient = np.sum(weighted.transpose(0, 1, 3, 2) @ rows, axis=1)
    for k in np.flatnonzero(~far):  # JJᵀ has lost the digits of what is left
        value[k], gradient[k] = _from_singular_values(stack[k], width)
    return SmoothWorstCases(value, gradient, error)


def _soft_minimum(sigmas: FloatArray, width: float) -> tuple[FloatArray, FloatArray]:
    """Return −w log Σ exp(−σ/w) over the last two axes, and the share of each term."""
    least = sigmas.min(axis=(-2, -1))
    terms = np.exp((least[..., None, None] - sigmas) / width)
    total = terms.sum(axis=(-2, -1))
    return least - width * np.log(total), terms / total[..., None, None]


def _from_singular_values(matrix: FloatArray, width: float) -> tuple[FloatArray, FloatArray]:
    n = matrix.shape[1]
    left, sigmas, right = np.linalg.svd(
        matrix * (1.0 - np.eye(n))[:, None, :], full_matrices=False
    )
    value, shares = _soft_minimum(sigmas, width)
    return value, np.sum((left * shares[:, None, :]) @ right, axis=0)
