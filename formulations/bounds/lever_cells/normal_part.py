"""The normal coordinates w of tight frames in a box: their second order, bounds of the rest.

With S = KKᵀ and w'' = ρ(w + K f) the columns of the frame of K, |w''_i|² = 3/7 is, exactly,

    2 w_iᵀ K f_i = |Kᵀ w''_i|² − |K f_i|²
                 = |Kᵀ w_i|² − |K f_i|² + 2 w_iᵀ S K f_i + |Kᵀ K f_i|² − |S w''_i|².

Times ½ Q, Q = N^-1 diag(sg)^-1 Uᵀ and N = C Hᵀ, with D' and K as in `box_frames`, so that
C D' = N w, this is

    w = N^-1 C(D'K0ᵀD') − ½ Q q(K,K) − N^-1 C(tail) + N^-1 C(S K) + ½ Q r,

where q(K,L)_i = K f_i · L f_i − Kᵀ w_i · Lᵀ w_i, tail = K − D' + D'K0ᵀD' and
r_i = |Kᵀ K f_i|² − |S w''_i|². As |w_i|² + |f_i|² = 1, |q(K,K)| ≤ |K|² and |r| ≤ ‖K‖³|K|.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.box_frames import Frames
from lockedjoint.formulations.bounds.lever_cells.corners import (
    HALF,
    PRODUCTS,
    UPPER_K,
    UPPER_L,
    greatest,
    greatest_length,
    high,
    swap,
)
from lockedjoint.nlp.arrays import FloatArray

#: Rounds in which the bounds improve one another.
ROUNDS = 60
#: Greatest ‖K0‖‖D'‖ for which K is bounded by D'.
CLOSEST = 0.98
#: Greatest defect of the seven equations in the middle: √7 `charts.RESIDUAL` makes 3e-12, the
#: rest is for the deviations that `boxes` allows (results/bounds/lever_cells.md, "Rounding").
DEFECT = 2e-10
#: Addition to a length of D', for these deviations.
EDGE = 1e-11
#: Factor above rounding in a greatest singular value, and in a sum of positive terms.
UP = 1 + 1e-12
_DIAGONAL = np.arange(6)


@dataclass(frozen=True)
class SecondOrder:
    """What w is to second order, with norms that bound the rest; see `NormalPart`.

    Attributes
    ----------
    w2 : w is w2(τ,τ) to second order, (N,6,6,6), symmetric in the first two; last that of w.
    w_middle : mean of w2(τ,τ) over the corners of the box, (N,6).
    w2_off, w2_size : greatest |w2(τ,τ) − w_middle| and |w2(τ,τ)|, (N,).
    cross, square : bounds of the parts with τ w, over |w|, and w w, over |w|², (N,).
    turn_tau, turn_w : greatest ‖Q q(ΣτG, ·)‖, and ‖Q q(ΣwH, ·)‖ over |w|, (N,).
    q_norm, n_norm : ‖Q‖ and ‖N^-1‖, (N,).
    """

    w2: FloatArray
    w_middle: FloatArray
    w2_off: FloatArray
    w2_size: FloatArray
    cross: FloatArray
    square: FloatArray
    turn_tau: FloatArray
    turn_w: FloatArray
    q_norm: FloatArray
    n_norm: FloatArray


@dataclass(frozen=True)
class NormalPart:
    """Bounds, (N,) each, of all tight frames of a box for which the beginnings hold.

    Attributes
    ----------
    rw : greatest |w|.
    w3 : greatest |w − w2(τ,τ)|.
    w_off : greatest |w − w_middle|.
    hw : greatest |Σ w_m H_m| over |w|.
    second, tail : greatest |K − D'| and |K − D' + D'K0ᵀD'|.
    op, size : greatest ‖K‖ and |K|.
    """

    rw: FloatArray
    w3: FloatArray
    w_off: FloatArray
    hw: FloatArray
    second: FloatArray
    tail: FloatArray
    op: FloatArray
    size: FloatArray


def second_order(c: Frames) -> SecondOrder:
    """Return the second order of w in boxes with these middles."""
    N = len(c.W)
    Q = c.Ninv @ swap(c.U / c.sg[:, None, :])
    GH = np.concatenate([c.G, c.H], 1).reshape(N, 12, 3, 4)
    turns = _turns(c, GH, Q)
    # D ↦ N^-1 C(D K0ᵀ L + L K0ᵀ D)/2, as a form in L
    form = (c.Ninv @ c.C).reshape(N, 1, 6, 3, 4)
    left = (c.K0[:, None] @ swap(GH)).reshape(N, 12, 1, 3, 3)
    right = (swap(GH) @ c.K0[:, None]).reshape(N, 12, 1, 4, 4)
    psi = 0.5 * (left @ form + form @ right).reshape(N, 12, 6, 12) - 0.5 * turns
    products = psi @ swap(GH.reshape(N, 1, 12, 12))  # (N, x, m, y) with x, y of G and H
    w2 = products[:, :6, :, :6].transpose(0, 1, 3, 2)
    w2 = np.ascontiguousarray(0.5 * (w2 + w2.transpose(0, 2, 1, 3)))
    cross = np.ascontiguousarray(2 * products[:, :6, :, 6:])
    square = products[:, 6:, :, 6:]
    square = 0.5 * (square + square.transpose(0, 3, 2, 1))
    flat = square.transpose(0, 2, 1, 3).reshape(N, 6, 36)
    # squares τ_k² are ½ ± ½ at most; the rest is greatest at a corner
    squares = w2[:, _DIAGONAL, _DIAGONAL]
    w_middle = 0.5 * squares.sum(1)
    half = 0.5 * greatest_length(squares)
    off = PRODUCTS @ w2[:, UPPER_K, UPPER_L]
    return SecondOrder(
        w2=w2,
        w_middle=w_middle,
        w2_off=_longest(off) + half,
        w2_size=_longest(off + w_middle[:, None]) + half,
        cross=_greatest_closely(cross),
        square=np.minimum(norm(flat), norm(square.reshape(N, 6, 36))),
        turn_tau=_greatest_closely(np.ascontiguousarray(turns[:, :6])),
        turn_w=high(turns[:, 6:].transpose(0, 2, 1, 3).reshape(N, 6, 72)),
        q_norm=norm(Q),
        n_norm=norm(c.Ninv),
    )


def _turns(c: Frames, GH: FloatArray, Q: FloatArray) -> FloatArray:
    """Return the forms L ↦ Q q(x, L) for directions x = GH (N,12,3,4), as (N,12,6,12)."""
    xf = swap(GH @ c.F[:, None])[..., :, None] * swap(c.F)[:, None, :, None, :]
    xw = swap(c.W)[:, None, :, :, None] * swap(swap(GH) @ c.W[:, None])[..., None, :]
    return np.asarray(Q[:, None] @ (xf - xw).reshape(len(GH), 12, 7, 12))


def normal_part(
    c: Frames, order: SecondOrder, rw: FloatArray, length: FloatArray
) -> NormalPart:
    """Return bounds for all tight frames in the boxes with |w| ≤ rw and |D'| ≤ length.

    Every round takes bounds that hold and finds others: no fixed point is needed. Where
    ‖K0‖‖D'‖ may be as large as `CLOSEST`, they are infinite or nan.
    """
    tangent = greatest_length(c.G)
    edges = greatest(np.ascontiguousarray(c.G.reshape(-1, 6, 3, 4)))
    hw = np.minimum(norm(c.H), 1.0)  # ‖ρ0‖, ‖σ0‖ ≤ 1
    # Σ w_m H_m has the part C Hᵀ w along C, and one that adds to Σ τ_k G_k
    aside, along = norm(c.H - swap(c.normal) @ c.C), norm(c.normal)
    d = length
    for _ in range(ROUNDS):
        length = np.minimum(length, UP * np.hypot(tangent + aside * rw, along * rw) + EDGE)
        d = np.minimum(np.minimum(d, length), UP * (edges + hw * rw) + EDGE)
        grow = np.where(c.k0 * d < CLOSEST, UP / (1 - c.k0 * d), np.inf)
        op, size = d * grow, length * grow
        second, tail = c.k0 * d * length * grow, c.k0**2 * d * d * length * grow
        w3 = UP * (
            order.cross * rw
            + order.square * rw**2
            + (order.turn_tau + order.turn_w * rw) * second
            + 0.5 * order.q_norm * second**2
            + order.n_norm * (op * op * size + tail)
            + 0.5 * order.q_norm * op**3 * size
            + order.q_norm * DEFECT
        )
        rw = np.minimum(rw, UP * (order.w2_size + w3))
    w_off = UP * np.minimum(order.w2_off + w3, rw + np.sqrt((order.w_middle**2).sum(1)))
    w3 = np.minimum(w3, UP * (rw + order.w2_size))
    return NormalPart(rw, w3, w_off, hw, second, tail, op, size)


def norm(matrices: FloatArray) -> FloatArray:
    """Return the norms of matrices (N,a,b), a ≤ b, from all their singular values."""
    squares = np.linalg.eigvalsh(matrices @ swap(matrices))[:, -1]
    return np.asarray(np.sqrt(np.maximum(squares, 0)) * UP)


def _greatest_closely(P1: FloatArray) -> FloatArray:
    """Return bounds of max ‖Σ τ_k P_k‖ for P1 (N,6,a,b): Schatten norms with p = 16."""
    N, _, a, b = P1.shape
    M = (HALF @ P1.reshape(N, 6, a * b)).reshape(N, 32, a, b)
    M = swap(M) @ M if b <= a else M @ swap(M)
    M = M @ M
    M = M @ M
    return np.asarray((np.einsum("...ij,...ij->...", M, M) ** 0.0625).max(1))


def _longest(vectors: FloatArray) -> FloatArray:
    """Return the greatest length among vectors (N,m,a), for each of N."""
    return np.asarray(np.sqrt(np.einsum("nia,nia->ni", vectors, vectors).max(1)))
