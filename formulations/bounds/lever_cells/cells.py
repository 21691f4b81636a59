"""Cells of unit tight frames: their second order in the place in a box, bounds of the rest.

A cell's own frame (W, F) belongs to the middle of its box. Any tight frame in the box has, but
for rotations, the parts w'_i = w_i + K f_i and f'_i = f_i − Kᵀ w_i with a 3×4 matrix K.
"""

from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.boxes import Boxes
from lockedjoint.formulations.bounds.lever_cells.cases import Cases
from lockedjoint.formulations.bounds.lever_cells.charts import DEVIATION, frobenius
from lockedjoint.formulations.bounds.lever_cells.corners import (
    FIRST,
    SECOND,
    BoolArray,
    greatest,
    greatest_length,
    swap,
    trilinear_size,
)
from lockedjoint.formulations.bounds.lever_cells.equations import ends
from lockedjoint.formulations.bounds.lever_cells.normal_part import EDGE
from lockedjoint.nlp.arrays import FloatArray

#: Steps towards a plane between 0 and the cell's images of null vectors.
_STEPS = 12


@dataclass(frozen=True)
class Cells(Cases):
    """N cells; all frames in one have K = K₁ + K₂ + K₃ with K₁ = Σ τ_k g_k, |τ_k| ≤ 1.

    A matrix K is the 12 numbers of its rows, or 12 coordinates in the directions (B, C). |·| is
    the Frobenius norm.

    Attributes
    ----------
    W, F
        The frame in the middle, (N,3,7) and (N,4,7): together orthogonal, |w_i|² = 3/7.
    U, sg
        Seven equations w_iᵀ K f_i = r_i are U diag(sg) C K = r, (N,7,6) and (N,6).
    B, C
        Orthonormal directions of K, (N,6,12) each: along and normal to the tight frames.
    kappa
        κ(K, L) = diag(sg)⁻¹ Uᵀ [(K f_i)·(L f_i) − (Kᵀ w_i)·(Lᵀ w_i)]_i as a form of the
        coordinates in (B, C), (N,6,12,12).
    g
        The edges: g[:, :, k] are the coordinates of g_k in B, (N,6,6).
    K2
        K₂ = Σ_{k,l} τ_kτ_l K2_kl in the directions (B, C), the pairs k ≤ l: (N,21,12).
    off
        Bounds of |K − K₁|, (N,).
    off3
        Bounds of |K₃|, (N,).
    kappa_B, kappa_C
        Bounds of |κ(K, L)| over all K and all L in B, or in C, of length 1, (N,).
    ok
        Whether the bounds hold, (N,).
    """

    W: FloatArray
    F: FloatArray
    U: FloatArray
    sg: FloatArray
    B: FloatArray
    C: FloatArray
    kappa: FloatArray
    g: FloatArray
    K2: FloatArray
    off: FloatArray
    off3: FloatArray
    kappa_B: FloatArray
    kappa_C: FloatArray
    ok: BoolArray

    @classmethod
    def of_boxes(cls, boxes: Boxes) -> "Cells":
        """Return the cells of boxes.

        With D = Σ τ_k G_k + H w, G_k the edges of a box, H its normal directions and K₀ the
        middle in the chart, K = (I + D K₀ᵀ)⁻¹ D = D − D K₀ᵀ D + …. A box bounds |w| (rw), what
        w has beyond second order (w3), ‖H‖ (hw), and all terms from the second (`second`) or
        from the third on (`tail`). So |K − K₁| ≤ ‖H‖|w| + second, and
        |K₃| ≤ ‖H‖ w3 + ‖K₀‖ (2‖K₁‖‖H‖|w| + ‖H‖²|w|²) + tail.
        """
        N = len(boxes.W)
        # QR makes B of the edges: they are tangent
        Q, edges = np.linalg.qr(swap(boxes.G))
        B = np.ascontiguousarray(swap(Q))
        G = boxes.G.reshape(N, 6, 3, 4)
        kappa = _kappa(boxes, B)
        normal = boxes.hw * boxes.rw
        mixed = 2 * greatest(np.ascontiguousarray(G)) * normal + normal**2
        off3 = boxes.hw * boxes.w3 + boxes.k0 * mixed + boxes.tail + EDGE
        K2 = _second_order(boxes, G)
        both = np.concatenate([B, boxes.C], 1)
        deviations = (
            frobenius(both @ swap(both) - np.eye(12)),
            frobenius(swap(edges) @ B - boxes.G),
        )
        sound = np.max(deviations, axis=0) < 2 * DEVIATION
        return cls(
            W=boxes.W,
            F=boxes.F,
            U=boxes.U,
            sg=boxes.sg,
            B=B,
            C=boxes.C,
            kappa=kappa,
            g=edges,
            K2=np.concatenate([K2 @ swap(B), K2 @ swap(boxes.C)], 2),
            off=normal + boxes.second + EDGE,
            off3=off3,
            kappa_B=trilinear_size(kappa[:, :, :, :6]),
            kappa_C=trilinear_size(kappa[:, :, :, 6:]),
            ok=boxes.ok & sound & np.isfinite(off3),
        )

    def edges(self) -> FloatArray:
        """Return the matrices g_k, (N,6,3,4)."""
        return (swap(self.g) @ self.B).reshape(-1, 6, 3, 4)

    def longest(self) -> FloatArray:
        """Return the greatest |K₁| of each cell, (N,)."""
        return greatest_length(swap(self.g))


def _kappa(boxes: Boxes, B: FloatArray) -> FloatArray:
    """Return κ as a form of the coordinates in (B, C), (N,6,12,12)."""
    N = len(B)
    E = np.concatenate([B, boxes.C], 1).reshape(N, 12, 3, 4)
    Ef = (E.reshape(N, 36, 4) @ boxes.F).reshape(N, 12, 3, 7).transpose(0, 3, 1, 2)
    Ew = (swap(E).reshape(N, 48, 3) @ boxes.W).reshape(N, 12, 4, 7).transpose(0, 3, 1, 2)
    forms = Ef @ swap(Ef) - Ew @ swap(Ew)
    combined = swap(boxes.U / boxes.sg[:, None, :]) @ forms.reshape(N, 7, 144)
    return np.asarray(combined.reshape(N, 6, 12, 12))


def _second_order(boxes: Boxes, G: FloatArray) -> FloatArray:
    """Return H w₂ − sym(G_k K₀ᵀ G_l) for pairs k ≤ l, matrices row after row, (N,21,12)."""
    N = len(G)
    GK = (G @ swap(boxes.K0)[:, None]).reshape(N, 18, 3)
    products = (GK @ G.transpose(0, 2, 1, 3).reshape(N, 3, 24)).reshape(N, 6, 3, 6, 4)
    GKG = products.transpose(0, 1, 3, 2, 4).reshape(N, 6, 6, 12)
    symmetric = 0.5 * (GKG + GKG.transpose(0, 2, 1, 3))
    return np.asarray((boxes.w2 @ boxes.H[:, None] - symmetric)[:, FIRST, SECOND])


def no_null_vector(cells: Cells, limit: float, margin: float) -> BoolArray:
    """Whether no frame of a cell has a null vector W'n = 0, |n| = 1, with all n_i ≥ √ν.

    Such an n, stretched so that Σ n_i = √7, is in the simplex with the corners
    b_j = √ν (1,…,1) + (√7 − 7√ν) e_j, as Σ n_i ≤ √7 |n|. There is none if some x, |x| = 1, has
    x·W'b_j > 0 for all j: x·W'b_j ≥ x·W b_j − Σ_k |x·g_k F b_j| − |K − K₁| |F b_j|. Subgradient
    steps look for x.

    Parameters
    ----------
    cells
        The cells.
    limit
        Greatest lever arm A; ν = (1 − 3A)/7.
    margin
        What x·W'b_j must exceed.
    """
    least, _ = ends(limit)
    corners = least * np.ones((7, 7)) + (np.sqrt(7.0) - 7 * least) * np.eye(7)
    Wb, Fb = cells.W @ corners, cells.F @ corners
    Gb = cells.edges() @ Fb[:, None]
    rest = np.sqrt((Fb * Fb).sum(1)) * cells.off[:, None]
    found = np.zeros(len(Wb), bool)
    x = Wb.sum(2)
    for step in range(_STEPS):
        x = _unit(x)
        changes = np.abs((x[:, None, None] @ Gb)[:, :, 0]).sum(1)
        lower = (x[:, None] @ Wb)[:, 0] - changes - rest
        found |= lower.min(1) > margin
        x = x + 0.5 / (1 + step) * _unit(Wb[np.arange(len(Wb)), :, lower.argmin(1)])
    return np.asarray(found & cells.ok)


def _unit(vectors: FloatArray) -> FloatArray:
    """Return vectors (N,3) divided by their lengths."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.maximum(lengths, 1e-300))
