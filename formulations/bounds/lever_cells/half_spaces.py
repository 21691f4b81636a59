"""Half spaces that exclude boxes: frames there are nearer to another centre than to the box's.

The nearness of a frame P to a centre P_i is tr P P_i; P_i is any image of a centre. If for
weights λ_i ≥ 0, which are not all 0, and any μ

    Σ λ_i (tr P P_i − tr P P_c) + μ (tr P P_c − level) > 0

for all tight frames P of a box, then in this box no frame with tr P P_c = level (with μ = 0: no
frame at all) is as near to the centre c as to all of the P_i. Weights come from linear programs
in a rough picture of the box (`weights.py`); `traces.trace_range` proves the inequality.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.boxes import Boxes
from lockedjoint.formulations.bounds.lever_cells.centres import (
    COLS,
    DIAGONAL,
    ROWS,
    HalfSpaces,
    upper,
)
from lockedjoint.formulations.bounds.lever_cells.corners import IntArray, swap
from lockedjoint.formulations.bounds.lever_cells.traces import trace_range
from lockedjoint.formulations.bounds.lever_cells.weights import combinations
from lockedjoint.nlp.arrays import FloatArray

#: Number of half spaces in each linear program.
CHOSEN = 24
#: Share of the mean second order of P over the corners that the point of a picture has.
SECOND_SHARE = 0.5


@dataclass(frozen=True)
class Pictures:
    """Boxes in a rough picture: P is about point + Σ τ_k along_k; (N,21) and (N,6,21).

    Upper triangles of 7×7 matrices: the diagonals of all P are the same. It serves to choose
    weights and proves nothing.
    """

    point: FloatArray
    along: FloatArray


def picture(c: Boxes, share: float = SECOND_SHARE) -> Pictures:
    """Return the first order of P in each box, and a point that heeds the mean second order."""
    N = len(c.W)
    G = c.G.reshape(N, 6, 3, 4)
    WGF = (swap(c.W)[:, None] @ G) @ c.F[:, None]
    mean = 2 * (c.w_middle[:, None, :] @ c.H).reshape(N, 3, 4)
    mean = mean - (G @ swap(c.K0)[:, None] @ G).sum(1)
    GF, GW = G @ c.F[:, None], swap(G) @ c.W[:, None]
    second = swap(c.W) @ mean @ c.F
    second = second + swap(second) + (swap(GF) @ GF).sum(1) - (swap(GW) @ GW).sum(1)
    return Pictures(upper(swap(c.W) @ c.W + share * second), upper(WGF + swap(WGF)))


def nearer(
    c: Boxes,
    half_spaces: HalfSpaces,
    centre: FloatArray,
    level: float | None = None,
    share: float = SECOND_SHARE,
    chosen: int = CHOSEN,
) -> tuple[FloatArray, FloatArray]:
    """Return lower bounds, over each box, of a combination of half spaces chosen for it.

    Where such a bound is above 0, the box is excluded in the sense of this module: by more than
    a margin for rounding, callers should ask.

    Parameters
    ----------
    c : N boxes around the centre.
    half_spaces : the half spaces of the centre.
    centre : its P_c, (7,7).
    level : the level of tr P P_c that is of interest; if None, μ = 0.
    share, chosen : how weights are chosen; see `SECOND_SHARE` and `CHOSEN`.

    Returns
    -------
    The bounds, and estimates of them from the linear programs; (N,) each.
    """
    about = picture(c, share)
    best = _highest(about, half_spaces, chosen)
    X = upper(half_spaces.X[best])
    value = 2 * np.einsum("nij,nj->ni", X, about.point)
    slopes = 2 * X @ swap(about.along)
    own = upper(centre)
    if level is None:
        free, free_slope = np.zeros(len(value)), np.zeros((len(value), 6))
    else:
        free, free_slope = DIAGONAL + 2 * about.point @ own - level, 2 * about.along @ own
    lam, mu, estimate = combinations(value, slopes, free, free_slope)
    triangles = (lam[:, None, :] @ X)[:, 0] + mu[:, None] * own
    combined = _symmetric(triangles, mu[:, None] * centre.diagonal())
    bound = trace_range(c, combined)[0] - mu * (level or 0.0)
    return bound, estimate


def _highest(about: Pictures, half_spaces: HalfSpaces, chosen: int) -> IntArray:
    """Return the numbers of the half spaces that are highest in the points, in order, (N,n)."""
    value = about.point.astype(np.float32) @ half_spaces.rough
    n = min(chosen, value.shape[1])
    best = np.argpartition(value, -n, axis=1)[:, -n:]
    best.sort(1)
    return best


def _symmetric(triangles: FloatArray, diagonals: FloatArray) -> FloatArray:
    """Return symmetric (N,7,7) with these upper triangles (N,21) and diagonals (N,7)."""
    matrices = np.zeros((len(triangles), 7, 7))
    matrices[:, ROWS, COLS] = triangles
    matrices += swap(matrices)
    matrices[:, np.arange(7), np.arange(7)] = diagonals
    return matrices
