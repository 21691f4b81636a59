"""Bounds of norms over the cube |τ_k| ≤ 1, k = 1 … 6, from its corners.

A sum Σ τ_k P_k has its greatest norm at a corner, as a norm is convex. In Σ τ_kτ_l P_kl a
square τ_k² is ½ + ½s with |s| ≤ 1; for fixed s the rest is affine in each τ_k, so that its norm
is greatest at a corner too. Where signs of all τ_k together do not change a norm, half of the
corners are enough.

Norms of matrices are greatest singular values, those of vectors Euclidean. Arrays hold N cases
along their first axis. Bounds hold up to rounding.
"""

import itertools
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from lockedjoint.nlp.arrays import FloatArray

#: An array of whole numbers, and one of truth values.
IntArray: TypeAlias = npt.NDArray[np.intp]
BoolArray: TypeAlias = npt.NDArray[np.bool_]
#: Which of the cases along the first axis: numbers or truth values of an array, or a slice.
Which: TypeAlias = npt.NDArray[Any] | slice
#: Number of coordinates τ_k.
SIDES = 6
#: Corners of the cube |τ_k| ≤ 1, 64×6.
CORNERS: FloatArray = np.array(list(itertools.product((-1.0, 1.0), repeat=SIDES)))
#: Half of the corners, 32×6: the other half are their negatives.
HALF = CORNERS[:32]
#: First members of the 15 pairs k < l.
UPPER_K = np.triu_indices(SIDES, 1)[0]
#: Their second members.
UPPER_L = np.triu_indices(SIDES, 1)[1]
#: First members of the 21 pairs k ≤ l.
FIRST = np.triu_indices(SIDES)[0]
#: Their second members.
SECOND = np.triu_indices(SIDES)[1]
#: Which of the pairs k ≤ l have k = l.
SQUARES = np.flatnonzero(FIRST == SECOND)
#: Which have k < l, in the order of `UPPER_K`.
MIXED = np.flatnonzero(FIRST != SECOND)
#: How often the symmetric part of a pair k ≤ l counts in Σ_{k,l}.
TWICE: FloatArray = np.where(FIRST == SECOND, 1.0, 2.0)
#: Products 2 τ_kτ_l, k < l, at half of the corners, 32×15.
PRODUCTS: FloatArray = 2.0 * HALF[:, UPPER_K] * HALF[:, UPPER_L]
#: Factor above the rounding of the closed form of a norm.
_UP = 1 + 1e-7
#: Addition to the square of a scale, which may be 0; its third power must not be.
_LEAST_SQUARE = 1e-60
#: Products 1, τ_k and τ_kτ_l, k < l, at all corners, 22×64.
MONOMIALS: FloatArray = np.vstack(
    [np.ones((1, 64)), CORNERS.T, (CORNERS[:, UPPER_K] * CORNERS[:, UPPER_L]).T]
)


def swap(matrices: FloatArray) -> FloatArray:
    """Return the transposes of matrices (…,a,b)."""
    return np.swapaxes(matrices, -1, -2)


def high(matrices: FloatArray) -> FloatArray:
    """Return upper bounds of the norms of matrices (…,a,b): Schatten norms with p = 8."""
    if matrices.shape[-1] == 1:
        return np.asarray(np.sqrt((matrices * matrices).sum((-1, -2))))
    wide = matrices.shape[-1] > matrices.shape[-2]
    squares = matrices @ swap(matrices) if wide else swap(matrices) @ matrices
    fourth = squares @ squares
    return np.asarray(np.einsum("...ij,...ij->...", fourth, fourth) ** 0.125)


def high3(matrices: FloatArray) -> FloatArray:
    """Return upper bounds of the norms of matrices (…,3,b), in closed form, hardly too large.

    They come from the eigenvalues of 3×3 matrices. Where two of these agree, the closed form
    has only half of the digits, so that it is rounded up by more than that.
    """
    A = matrices @ swap(matrices)
    mean = (A[..., 0, 0] + A[..., 1, 1] + A[..., 2, 2]) / 3
    x, y, z = A[..., 0, 0] - mean, A[..., 1, 1] - mean, A[..., 2, 2] - mean
    a, b, c = A[..., 0, 1], A[..., 0, 2], A[..., 1, 2]
    squares = x * x + y * y + z * z + 2 * (a * a + b * b + c * c)
    scale = np.sqrt(squares / 6 + _LEAST_SQUARE)
    determinant = x * y * z + 2 * a * b * c - x * c * c - y * b * b - z * a * a
    angle = np.arccos(np.clip(determinant / (2 * scale**3), -1.0, 1.0)) / 3
    return np.asarray(_UP * np.sqrt(np.maximum(mean + 2 * scale * np.cos(angle), 0.0)))


def inverse3(A: FloatArray) -> FloatArray:
    """Return the inverses of symmetric matrices (N,3,3)."""
    a, b, c = A[:, 0, 0], A[:, 0, 1], A[:, 0, 2]
    d, e, f = A[:, 1, 1], A[:, 1, 2], A[:, 2, 2]
    x, y, z = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * x + b * y + c * z
    yz = b * c - a * e
    adjugate = np.stack([x, y, z, y, a * f - c * c, yz, z, yz, a * d - b * b], 1)
    return np.asarray((adjugate / determinant[:, None]).reshape(-1, 3, 3))


def size(matrices: FloatArray) -> FloatArray:
    """Return the norms of matrices (N,a,b), from all their singular values."""
    wide = matrices.shape[-1] > matrices.shape[-2]
    squares = matrices @ swap(matrices) if wide else swap(matrices) @ matrices
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(squares)[..., -1], 0.0)))


def symmetric_size(matrices: FloatArray) -> FloatArray:
    """Return the norms of symmetric matrices (N,a,a)."""
    return np.asarray(np.abs(np.linalg.eigvalsh(matrices)).max(-1))


def trilinear_size(T: FloatArray) -> FloatArray:
    """Return upper bounds of max |T(x,y,z)| over unit vectors, for T (N,a,b,c).

    T(x,y,z) = xᵀ M (y⊗z) with |y⊗z| = 1 is at most the norm of the flattening M, a×bc; so it is
    for the other two flattenings.
    """
    N, a, b, c = T.shape
    flattenings = (
        T.reshape(N, a, b * c),
        T.transpose(0, 2, 1, 3).reshape(N, b, a * c),
        T.transpose(0, 3, 1, 2).reshape(N, c, a * b),
    )
    return np.asarray(np.min([size(M) for M in flattenings], axis=0))


def greatest(P1: FloatArray) -> FloatArray:
    """Return bounds of max ‖Σ τ_k P_k‖ for P1 (N,6,a,b)."""
    N, _, a, b = P1.shape
    at_corners = (HALF @ P1.reshape(N, SIDES, a * b)).reshape(N, 32, a, b)
    return np.asarray((high3(at_corners) if a == 3 else high(at_corners)).max(1))


def greatest_length(V: FloatArray) -> FloatArray:
    """Return max |Σ τ_k V_k| for V (N,6,a)."""
    return _longest(HALF @ V)


def greatest_square(V: FloatArray) -> FloatArray:
    """Return bounds of max |Σ_{k,l} τ_kτ_l V_kl| for V_kl = V_lk, (N,6,6,a)."""
    diagonal = np.arange(SIDES)
    squares = V[:, diagonal, diagonal]
    even = PRODUCTS @ V[:, UPPER_K, UPPER_L] + 0.5 * squares.sum(1)[:, None]
    return np.asarray(_longest(even) + 0.5 * greatest_length(squares))


def greatest_pairs(P2: FloatArray) -> FloatArray:
    """Return bounds of max ‖Σ_{k,l} τ_kτ_l P_kl‖ for P_kl = P_lk, k ≤ l: (N,21,a,b)."""
    N, _, a, b = P2.shape
    squares = P2[:, SQUARES]
    mixed = (PRODUCTS @ P2[:, MIXED].reshape(N, 15, a * b)).reshape(N, 32, a, b)
    even = mixed + 0.5 * squares.sum(1)[:, None]
    return np.asarray(high(even).max(1) + 0.5 * high(squares).sum(1))


def _longest(vectors: FloatArray) -> FloatArray:
    """Return the greatest length among vectors (N,m,a), for each of N."""
    return np.asarray(np.sqrt(np.einsum("nia,nia->ni", vectors, vectors).max(1)))
