"""Boxes of tangent coordinates in a chart, with bounds of all tight frames in them.

The bounds hold for the tight frames with |t_k − t0_k| ≤ h_k, |K| ≤ T, and what a box has from
the one it is a half of: that z lies within `near` of z + Σ τ_k tilt_k. A frame whose t is in
the box may have several z; the bounds hold for all of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.box_frames import Frames, middle_frames
from lockedjoint.formulations.bounds.lever_cells.charts import (
    DEVIATION,
    RESIDUAL,
    Chart,
    frobenius,
    middles,
)
from lockedjoint.formulations.bounds.lever_cells.corners import (
    HALF,
    BoolArray,
    IntArray,
    greatest_length,
    greatest_square,
    swap,
)
from lockedjoint.formulations.bounds.lever_cells.normal_part import (
    UP,
    normal_part,
    second_order,
)
from lockedjoint.nlp.arrays import FloatArray

#: Addition to T², as roots of small differences lose digits; also for the residual of a centre.
SLACK = 1e-12
#: Least singular value of the equations; in trees of seven vectors it was 0.22 or more.
LEAST_VALUE = 0.1
#: Greatest ‖Q‖; it was at most 9.2.
GREATEST_INVERSE = 30.0
#: Greatest |K0|; it was at most 0.4.
GREATEST_MIDDLE = 1.0
#: Greatest |G|, all edges of a box together; it was at most 0.7.
GREATEST_EDGES = 2.0
#: Greatest |K| in a box by lengths alone, before anything is known of w.
GREATEST_SIZE = 2.0


@dataclass(frozen=True)
class Boxes(Frames):
    """N boxes: the frames in their middles, and bounds of all tight frames in them.

    Bounds, of shape (N,), are those of `normal_part.NormalPart`. They hold where `ok`.

    Attributes
    ----------
    w2, w_middle : second order of w, (N,6,6,6), and its mean over the corners, (N,6).
    rw, w3, w_off : greatest |w|, |w − w2(τ,τ)| and |w − w_middle|.
    hw : greatest |Σ w_m H_m| over |w|.
    second, tail : greatest |K − D'| and |K − D' + D'K0ᵀD'|.
    op, size : greatest ‖K‖ and |K|.
    ok : whether the middle was found, the bounds are finite and rounding is small, (N,).
    """

    w2: FloatArray
    w_middle: FloatArray
    rw: FloatArray
    w3: FloatArray
    w_off: FloatArray
    hw: FloatArray
    second: FloatArray
    tail: FloatArray
    op: FloatArray
    size: FloatArray
    ok: BoolArray


def boxes(
    chart: Chart,
    t: FloatArray,
    h: FloatArray,
    z: FloatArray,
    tilt: FloatArray,
    near: FloatArray,
) -> Boxes:
    """Return boxes t ± h with the bounds of all tight frames in them.

    Parameters
    ----------
    chart : the chart.
    t, h : middles and half sides, (N,6).
    z, tilt, near : it is known that |z_frame − z − Σ τ_k tilt_k| ≤ near, τ = (t_frame − t)/h,
        for all tight frames in the box with |K| ≤ T; (N,6), (N,6,6) with a row for each k, and
        (N,), which may be infinite. Newton's method starts at z.
    """
    z0, residual = middles(chart, t, z)
    found = residual < RESIDUAL
    z0 = np.where(found[:, None], z0, 0.0)
    c = middle_frames(chart, t, h, z0)
    order = second_order(c)
    with np.errstate(all="ignore"):
        greatest_z = _greatest_z(chart, t, h)
        rw = np.minimum(
            UP * (near + _length(z0 - z) + greatest_length(tilt - c.slope)) + SLACK,
            UP * (greatest_z + _farthest(z0, c.slope)) + SLACK,
        )
        # |D'| ≤ |D|, and B and C are orthonormal
        length = UP * np.sqrt((h * h).sum(1) + (greatest_z + _length(z0)) ** 2)
        part = normal_part(c, order, rw, length)
    ok = found & np.isfinite(part.w_off) & np.isfinite(part.size)
    ok &= length < GREATEST_SIZE * (1 - c.k0 * length)
    ok &= (order.q_norm < GREATEST_INVERSE) & _sound(c)
    return Boxes(**vars(c), w2=order.w2, w_middle=order.w_middle, **vars(part), ok=ok)


def _sound(c: Frames) -> BoolArray:
    """Whether frames are of moderate size, and what was computed of them is what it should be.

    The bounds of rounding errors rest on this alone: the directions of an eigenvector basis are
    of no importance, that it is orthonormal and fulfils the equations is tested here.
    """
    N = len(c.W)
    both = np.concatenate([c.W, c.F], 1)
    A = (swap(c.W)[:, :, :, None] * swap(c.F)[:, :, None, :]).reshape(N, 7, 12)
    sound = (c.sg[:, 0] > LEAST_VALUE) & (frobenius(c.K0) < GREATEST_MIDDLE)
    sound &= frobenius(c.G) < GREATEST_EDGES
    for deviation in (
        both @ swap(both) - np.eye(7),
        c.C @ swap(c.C) - np.eye(6),
        swap(c.U) @ c.U - np.eye(6),
        (c.U * c.sg[:, None]) @ c.C - A,
        c.Ninv @ c.normal - np.eye(6),
        c.C @ swap(c.G),
    ):
        sound &= frobenius(deviation) < DEVIATION
    return sound


def _greatest_z(chart: Chart, t: FloatArray, h: FloatArray) -> FloatArray:
    """Return bounds of |z| in boxes t ± h, (N,).

    |t|² + |z|² = |K|² ≤ T²; and z = C K has components (UᵀE)_m/sg_m with
    2 E_i = |Kᵀw''_i|² − |K f_i|², so that |E| ≤ ½|K|² (see `normal_part`).
    """
    squared = chart.greatest**2 + SLACK
    inner = (np.maximum(np.abs(t) - h, 0) ** 2).sum(1)
    sphere = np.sqrt(np.maximum(squared - inner, 0))
    return np.asarray(np.minimum(sphere, squared / (2 * chart.least)))


def _farthest(z0: FloatArray, slope: FloatArray) -> FloatArray:
    """Return max |z0 + Σ τ_k slope_k|, at a corner as it is convex; (N,)."""
    ends = HALF @ slope
    above, below = ((z0[:, None] + sign * ends) ** 2 for sign in (1, -1))
    return np.asarray(np.sqrt(np.maximum(above.sum(2).max(1), below.sum(2).max(1))))


def _length(vectors: FloatArray) -> FloatArray:
    """Return the lengths of vectors (N,6)."""
    return np.asarray(np.sqrt((vectors**2).sum(1)))


def children(
    c: Boxes, which: IntArray, axis: IntArray
) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
    """Return what is known of z in both halves of boxes.

    In the box z = z0 + Σ τ_k slope_k + w2(τ,τ) + at most w3. In its half τ = ±½ e + τ~, where e
    is the axis and τ~ has half of τ'_axis; so w2(τ,τ) = ¼ w2(e,e) ± w2(e,τ~) + w2(τ~,τ~).

    Parameters
    ----------
    c : the boxes.
    which : the numbers of those that are halved, (M,).
    axis : along which coordinate, (M,).

    Returns
    -------
    z (M,6), tilt (M,6,6) and near (M,), as `boxes` takes them, for the lower and the upper
    half. Where a box is not `ok`, nothing is known: near is infinite.
    """
    rows = np.arange(len(which))
    ok, z0, w2, slope = c.ok[which], c.z0[which], c.w2[which], c.slope[which]
    own, along = w2[rows, axis, axis], w2[rows, axis]
    rest = w2.copy()
    rest[rows, axis] *= 0.5
    rest[rows, :, axis] *= 0.5
    near = np.where(ok, UP * (greatest_square(rest) + c.w3[which]) + SLACK, np.inf)
    halves = []
    for sign in (-1, 1):
        z = z0 + sign * 0.5 * slope[rows, axis] + 0.25 * own
        tilt = slope + sign * along
        tilt[rows, axis] *= 0.5
        known = np.where(ok[:, None], z, z0), np.where(ok[:, None, None], tilt, 0.0), near
        halves.append(known)
    return halves
