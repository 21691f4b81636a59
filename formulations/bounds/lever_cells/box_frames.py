"""The frame in the middle of a box, and directions that suit the tight frames around it.

Seen from the frame (W, F) of K0, the frame of K0 + D in the chart is that of
K = (I + D'K0ᵀ)^-1 D', D' = ρ0 D σ0. For W̄ + (K0+D) F̄, in terms of W and F, is
ρ0^-1 (I + D'K0ᵀ) W + ρ0^-1 D' F.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.cases import Cases
from lockedjoint.formulations.bounds.lever_cells.charts import Chart, normals, roots
from lockedjoint.formulations.bounds.lever_cells.corners import swap
from lockedjoint.nlp.arrays import FloatArray


@dataclass(frozen=True)
class Frames(Cases):
    """Frames in the middles of N boxes |t_k − t0_k| ≤ h_k of a chart.

    D' = Σ τ_k G_k + Σ w_m H_m with τ_k = (t_k − t0_k)/h_k, so |τ_k| ≤ 1 in the box, and
    w = z − z0 − Σ τ_k slope_k. All G_k are tangent to the tight frames at (W, F): C G_k = 0, so
    that w is of second order.

    Attributes
    ----------
    W, F : the frames, (N,3,7) and (N,4,7).
    U, sg, C : their equations U diag(sg) C K as in `charts.normals`: (N,7,6), (N,6), (N,6,12).
    K0, k0 : their K in the chart, (N,3,4), and its norm, (N,).
    G : edges of the box as changes of K, (N,6,12).
    H : normal directions of the chart as changes of K, ρ0 C_m σ0, (N,6,12).
    normal, Ninv : C Hᵀ (N,6,6) and its inverse.
    z0 : normal coordinates in the chart, (N,6).
    slope : first-order change of z along τ_k, by row, (N,6,6).
    """

    W: FloatArray
    F: FloatArray
    U: FloatArray
    sg: FloatArray
    C: FloatArray
    K0: FloatArray
    k0: FloatArray
    G: FloatArray
    H: FloatArray
    normal: FloatArray
    Ninv: FloatArray
    z0: FloatArray
    slope: FloatArray


def middle_frames(chart: Chart, t: FloatArray, h: FloatArray, z0: FloatArray) -> Frames:
    """Return the frames with coordinates t and z0 (N,6), for boxes of half sides h (N,6)."""
    N = len(t)
    K0 = (t @ chart.B + z0 @ chart.C).reshape(-1, 3, 4)
    _, rho, _, sigma, k0 = roots(K0)
    W, F = rho @ (chart.W + K0 @ chart.F), sigma @ (chart.F - swap(K0) @ chart.W)
    U, sg, C = normals(W, F)
    both = np.concatenate([chart.B, chart.C]).reshape(12, 3, 4)
    both = (rho[:, None] @ both @ sigma[:, None]).reshape(N, 12, 12)
    G, H = both[:, :6] * h[:, :, None], both[:, 6:]
    normal = C @ swap(H)
    Ninv = np.asarray(np.linalg.inv(normal), np.float64)
    slope = -swap(Ninv @ (C @ swap(G)))
    return Frames(W, F, U, sg, C, K0, k0, G + slope @ H, H, normal, Ninv, z0, slope)
