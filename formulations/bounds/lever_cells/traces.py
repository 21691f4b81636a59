"""Bounds of traces tr(P X), P = WᵀW, over all tight frames of a box.

Tight frames have P_ii = 3/7, so tr(P X) = tr(P(X + diag η)) − (3/7) Σ η_i for every η:
multipliers. They are chosen so that the normal coordinates w have no first order. With Y the
matrix X + diag η in the basis (W; F) of the middle and S = KKᵀ,

    tr(P (X + diag η)) = tr (I+S)^-1 (Y11 + K Y12ᵀ + Y12 Kᵀ + K Y22 Kᵀ)
                       = tr Y11 + 2 K·Y12 + K·V(K) + rest,   V(K) = K Y22 − Y11 K,

    rest = tr S²(I+S)^-1 Y11 − 2 tr S(I+S)^-1 K Y12ᵀ − tr S(I+S)^-1 K Y22 Kᵀ,
    |rest| ≤ 2‖K‖²|K||Y12| + ‖K‖²|K|² (‖Y11‖ + ‖Y22‖).
"""

from __future__ import annotations

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.boxes import Boxes
from lockedjoint.formulations.bounds.lever_cells.charts import COLUMN2, frobenius
from lockedjoint.formulations.bounds.lever_cells.corners import (
    HALF,
    PRODUCTS,
    UPPER_K,
    UPPER_L,
    BoolArray,
    greatest_length,
    high,
    high3,
    swap,
)
from lockedjoint.nlp.arrays import FloatArray

#: Greatest |X| + |η|, so that rounding is small; it was at most 4 in trees of arms.
GREATEST_MATRIX = 100.0
_DIAGONAL = np.arange(6)


def trace_range(c: Boxes, X: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return bounds, below and above, of tr(P X) over the tight frames of each box.

    D' = Σ τ_k G_k + Σ w_m H_m. To second order the trace is a form in τ and w. It is bounded at
    the corners of |τ_k| ≤ 1, as it is affine in each τ_k but for its squares, which lie between
    0 and 1; with w = w_middle in the products of τ and w, up to `w_off`; and with |w| ≤ rw.

    Parameters
    ----------
    c : N boxes.
    X : symmetric matrices, (N,7,7).

    Returns
    -------
    The lower and upper bounds, infinite where the box is not `ok` or X too large, and how much
    of each is due to what is not computed but bounded by norms; (N,) each.
    """
    N = len(X)
    middle, Y11, Y12, Y22, sound = _in_own_basis(c, X)
    GH = np.concatenate([c.G, c.H], 1).reshape(N, 12, 3, 4)
    V = GH @ Y22[:, None] - Y11[:, None] @ GH
    # K = D' − D'K0ᵀD' + …: the second term in 2 K·Y12
    bent = (c.K0[:, None] @ swap(GH)) @ Y12[:, None] + Y12[:, None] @ (swap(GH) @ c.K0[:, None])
    form = (V - bent).reshape(N, 12, 12) @ swap(GH.reshape(N, 12, 12))
    tangent, cross = form[:, :6, :6], 2 * form[:, :6, 6:]
    linear = 2 * (c.G @ Y12.reshape(N, 12, 1))[..., 0] + (cross @ c.w_middle[..., None])[..., 0]
    odd = np.abs(linear @ HALF.T)
    even = tangent[:, UPPER_K, UPPER_L] @ PRODUCTS.T
    squares = tangent[:, _DIAGONAL, _DIAGONAL]
    normal = np.linalg.eigvalsh(form[:, 6:, 6:])
    with np.errstate(all="ignore"):
        rest = greatest_length(cross) * c.w_off + _beyond(c, V[:, :6], Y11, Y12, Y22)
        # the first order in w, which is 0 but for rounding
        rest += 2 * np.sqrt(((c.H @ Y12.reshape(N, 12, 1))[..., 0] ** 2).sum(1)) * c.rw
        below = middle + (even - odd).min(1) + np.minimum(squares, 0).sum(1) - rest
        above = middle + (even + odd).max(1) + np.maximum(squares, 0).sum(1) + rest
        below += np.minimum(normal[:, 0], 0) * c.rw**2
        above += np.maximum(normal[:, -1], 0) * c.rw**2
    ok = c.ok & sound
    return np.where(ok, below, -np.inf), np.where(ok, above, np.inf), rest


def _in_own_basis(
    c: Boxes, X: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, BoolArray]:
    """Return the value in the middle (N,), and Y11, Y12, Y22 less a multiple of I.

    The multiple changes the trace by a constant: it makes norms smaller. Last is whether X and
    η are not too large, (N,).
    """
    Y12 = c.W @ X @ swap(c.F)
    # H·(Y12 + W diag(η) Fᵀ) = 0, where W diag(η) Fᵀ = Cᵀ diag(sg) Uᵀ η
    zeta = -(swap(c.Ninv) @ (c.H @ Y12.reshape(-1, 12, 1)))[..., 0] / c.sg
    eta = (c.U @ zeta[..., None])[..., 0]
    W_eta, F_eta = c.W * eta[:, None, :], c.F * eta[:, None, :]
    Y12 = Y12 + W_eta @ swap(c.F)
    Y11, Y22 = (c.W @ X + W_eta) @ swap(c.W), (c.F @ X + F_eta) @ swap(c.F)
    trace3, trace4 = np.trace(Y11, axis1=1, axis2=2), np.trace(Y22, axis1=1, axis2=2)
    shift = (trace3 / 6 + trace4 / 8)[:, None, None]
    middle = trace3 - COLUMN2 * eta.sum(1)
    sound = frobenius(X) + np.sqrt((eta * eta).sum(1)) < GREATEST_MATRIX
    return middle, Y11 - shift * np.eye(3), Y12, Y22 - shift * np.eye(4), sound


def _beyond(
    c: Boxes, V: FloatArray, Y11: FloatArray, Y12: FloatArray, Y22: FloatArray
) -> FloatArray:
    """Return bounds (N,) of the trace beyond its second order in D'.

    With E = K − D', |E| ≤ second, these are 2 E·V(D') + E·V(E), for |V(D')| at most `slope`,
    2 Y12·tail, and the rest that the module states.
    """
    size12 = np.sqrt(np.einsum("nij,nij->n", Y12, Y12))
    norms = high3(Y11) + high(Y22)
    slope = greatest_length(V.reshape(-1, 6, 12)) + norms * c.hw * c.rw
    return np.asarray(
        2 * size12 * c.tail
        + 2 * c.op**2 * c.size * size12
        + c.op**2 * c.size**2 * norms
        + 2 * slope * c.second
        + norms * c.second**2
    )
