"""A smooth lower bound of the worst case after one failure, for controllers and optimisers.

J is a Jacobian, shape (m, n), and σ its worst case: the smallest singular value that any single
failure leaves (eq. 5). At a maximum of σ several failures, and several singular values of one,
are equally bad, and σ has a kink. Let failure f leave the singular values σ_fi, i = 1 … m, and
let w be a width, in the unit of J. Then

    s = −w log Σ_fi exp(−σ_fi/w)          σ − w log(mn) ≤ s ≤ σ,

has no kink: a symmetric function of singular values is as smooth as it is in them (Lewis,
1996). The exception is where a singular value is 0 that has a share in the sum. The *share* of
a term is exp(−σ_fi/w) over the sum of all; the gradient ∂s/∂J is the sum of share · u vᵀ over
all terms, u and v the singular vectors.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations.measures.worst_failure import FAR_FROM_SINGULAR, checked_stack
from lockedjoint.nlp.arrays import FloatArray, real_number

# Limits of the width: beyond them s or its slope is lost in rounding.
_LEAST_WIDTH = 1e-6
_LARGEST_WIDTH = 1e6


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
    """Return a smooth lower bound of the worst case over single failures of many Jacobians.

    Parameters
    ----------
    jacobians
        Shape (N, m, n), n > m.
    width
        w > 0, in the unit of J: singular values that are closer count together. A larger one
        makes s smoother, and lower.

    Raises
    ------
    InputError
        If the shape is another, an entry is not finite or too large, or the width is not
        above 0.
    """
    return smooth_of_stack(checked_stack(jacobians), width)


def smooth_of_stack(stack: FloatArray, width: float) -> SmoothWorstCases:
    """Return what `smooth_worst_case_batch` does, without its checks of the Jacobians."""
    width = checked_width(width)
    m, n = stack.shape[1:]
    error = width * float(np.log(m * n))
    columns = stack.transpose(0, 2, 1)
    # Eigenvalues of JJᵀ − jjᵀ for every failure, shape (N, n, m), and their vectors u.
    values, left = np.linalg.eigh(
        (stack @ columns)[:, None] - columns[:, :, :, None] * columns[:, :, None, :]
    )
    far = values[:, :, 0].min(axis=1) > FAR_FROM_SINGULAR * values[:, :, -1].max(axis=1)
    sigmas = np.sqrt(np.maximum(values, np.finfo(float).tiny))
    value, shares = _soft_minimum(sigmas, width)
    # The weighted sum of u vᵀ, v = J_Fᵀu/σ, is that of A_f J_F with A_f = U diag(share/σ) Uᵀ.
    each = (left * (shares / sigmas)[:, :, None, :]) @ left.transpose(0, 1, 3, 2)
    own = (each @ columns[:, :, :, None])[:, :, :, 0]
    gradient = each.sum(axis=1) @ stack - own.transpose(0, 2, 1)
    near = np.flatnonzero(~far)
    if near.size:
        value[near], gradient[near] = smooth_near_singularity(stack[near], width)
    return SmoothWorstCases(value, gradient, error)


def smooth_near_singularity(stack: FloatArray, width: float) -> tuple[FloatArray, FloatArray]:
    """Return s, shape (N,), and ∂s/∂J, shape (N, m, n), from decompositions of J_F itself.

    It is for Jacobians of which JJᵀ − jjᵀ has lost the digits of the least eigenvalue.
    """
    # J with zeros in the locked column, for every failure: shape (N, n, m, n).
    without = stack[:, None] * (1.0 - np.eye(stack.shape[2]))[:, None, :]
    left, sigmas, right = np.linalg.svd(without, full_matrices=False)
    value, shares = _soft_minimum(sigmas, width)
    return value, np.sum((left * shares[:, :, None, :]) @ right, axis=1)


def checked_width(width: object) -> float:
    """Return a width as a float; InputError unless it is a number from 1e-6 to 1e6."""
    allowed = "a number from 1e-6 to 1e6"
    return real_number("width", width, allowed, _LEAST_WIDTH, _LARGEST_WIDTH)


def _soft_minimum(sigmas: FloatArray, width: float) -> tuple[FloatArray, FloatArray]:
    """Return −w log Σ exp(−σ/w) over the last two axes, and the share of each term.

    `sigmas` has shape (N, failures, singular values). The least one is taken off before, so
    that no exponential underflows in all terms.
    """
    least = sigmas.min(axis=(-2, -1))
    terms = np.exp((least[..., None, None] - sigmas) / width)
    total = terms.sum(axis=(-2, -1))
    return least - width * np.log(total), terms / total[..., None, None]
