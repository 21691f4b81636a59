"""Frames, arms, cells and places in them, for tests."""

import numpy as np
from scipy.optimize import least_squares

from lockedjoint.formulations.bounds.lever_cells.boxes import boxes
from lockedjoint.formulations.bounds.lever_cells.cells import Cells
from lockedjoint.formulations.bounds.lever_cells.charts import (
    RESIDUAL,
    middles,
    roots,
    tight_chart,
)
from lockedjoint.formulations.bounds.lever_cells.corners import FIRST, SECOND, TWICE, swap
from lockedjoint.formulations.bounds.lever_cells.equations import EQUATIONS, RIGHT, polynomial

#: Rows w, v = V̂ f and n of an isotropic arm with small lever arms, in six digits.
ROUNDED_ARM = np.array(
    [
        [0.009868, -0.334607, 0.308797, -0.594859, -0.178441, 0.458097, 0.443886],
        [0.254111, -0.206242, -0.528867, 0.2693, -0.553167, 0.465283, -0.13486],
        [-0.603243, 0.523521, -0.231335, 0.04682, -0.301225, 0.047223, 0.461898],
        [0.682778, 0.329834, -0.15604, -0.231858, -0.207099, -0.408842, 0.369967],
        [0.069097, 0.458781, -0.342689, -0.502371, 0.363757, 0.396787, -0.3538],
        [0.040276, 0.39155, 0.57515, -0.05626, -0.545319, 0.056561, -0.458838],
        [0.314399, 0.314399, 0.314399, 0.511985, 0.314399, 0.493597, 0.314399],
    ]
)


def arm(start=ROUNDED_ARM):
    """An arm near a 7×7 matrix: orthogonal rows W, V and n, |w_i|² = 3/7, w_i·v_i = 0."""
    upper = np.triu_indices(7)

    def equations(entries):
        Q = entries.reshape(7, 7)
        lengths, products = (Q[:3] ** 2).sum(0) - 3 / 7, (Q[:3] * Q[3:6]).sum(0)
        return np.concatenate([(Q @ Q.T - np.eye(7))[upper], lengths, products])

    found = least_squares(equations, start.ravel(), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert np.abs(found.fun).max() < 1e-11
    return found.x.reshape(7, 7)


def largest_lever_arm(n):
    """A of an arm, where n_i² = (1 − 3 a_i)/7."""
    return (1 - 7 * (n**2).min()) / 3


def cells_at(W, middles_of, half):
    """Cells of boxes of one half side in the chart of W; the chart and the boxes."""
    chart = tight_chart(W, 0.13)
    N = len(middles_of)
    sides = half * np.ones((N, 6))
    nothing = np.zeros((N, 6)), np.zeros((N, 6, 6)), np.full(N, np.inf)
    found = boxes(chart, middles_of, sides, *nothing)
    return chart, found, Cells.of_boxes(found)


def frames_at(chart, of_boxes, cells, places, half):
    """K, as matrices, of the frames at places τ (N,6) in cells, and where they were found."""
    t = middle_of(chart, of_boxes) + half * places
    z, residual = middles(chart, t, of_boxes.z0)
    K = (t @ chart.B + z @ chart.C).reshape(-1, 3, 4)
    W = roots(K)[1] @ (chart.W + K @ chart.F)
    own = np.linalg.solve(W @ swap(cells.W), W @ swap(cells.F))
    return own, (residual < RESIDUAL) & cells.ok


def middle_of(chart, of_boxes):
    """Tangent coordinates of the middles of boxes."""
    return of_boxes.K0.reshape(-1, 12) @ chart.B.T


def coordinates(cells, K):
    """The coordinates of K in the directions (B, C), (N,12)."""
    directions = np.concatenate([cells.B, cells.C], 1)
    return np.einsum("nkx,nx->nk", directions, K.reshape(-1, 12))


def first_order(cells, places):
    """The coordinates of K₁ at places (N,6)."""
    inside = (cells.g @ places[:, :, None])[:, :, 0]
    return np.concatenate([inside, np.zeros_like(inside)], 1)


def products(places):
    """τ_kτ_l for pairs k ≤ l, those with k < l twice, (N,21)."""
    return places[:, FIRST] * places[:, SECOND] * TWICE


def exact_forms(forms, K):
    """Y and X of frames K, (N,10,10) and (N,5,5), from their definition."""
    cells, N = forms.expansion.cells, len(K)
    directions = np.concatenate([cells.B, cells.C], 1).reshape(N, 12, 3, 4)
    kappa = np.einsum("nmxy,nx->nmy", cells.kappa, coordinates(cells, K))
    KVK = (K[:, None] @ swap(directions) @ K[:, None]).reshape(N, 12, 12)
    D2 = -cells.C @ swap(KVK)
    L, M = np.split(kappa + D2, 2, axis=2)
    Z = -np.linalg.solve(np.eye(6) + M, L)
    root3, _, root4, _, _ = roots(K)
    V = root3[:, None] @ (cells.B + swap(Z) @ cells.C).reshape(N, 6, 3, 4) @ root4[:, None]
    T = np.zeros((N, 16, 10))
    T[:, :12, :6] = swap(V.reshape(N, 6, 12))
    T[:, 12:, 6:] = root4
    F = cells.F - swap(K) @ cells.W
    X = np.zeros((N, 5, 5))
    X[:, 0, 0] = forms.X0[:, 0, 0]
    X[:, 0, 1:] = X[:, 1:, 0] = (F @ forms.c[:, :, None])[:, :, 0] / 2
    X[:, 1:, 1:] = root4 @ forms.Hq @ root4 - F @ forms.phi @ swap(F)
    return swap(T) @ forms.H @ T, X


def exact_sum(cells, multipliers, limit, K):
    """The sum of both forms less the constant in the own frames of K, at most 0 for an arm."""
    W, F = parts(cells, K)
    N = len(W)
    normal_and_tangent = np.linalg.svd(np.einsum("nai,nbi->niab", W, F).reshape(N, 7, 12))[2]
    T = np.zeros((N, 16, 10))
    T[:, :12, :6] = swap(normal_and_tangent[:, 6:])
    T[:, 12:, 6:] = np.eye(4)
    full = np.tensordot(multipliers.equations, EQUATIONS, (1, 0))
    phi, c, c0 = polynomial(multipliers, limit)
    H = full.copy()
    H[:, 12:, 12:] = multipliers.shared
    X = np.zeros((N, 5, 5))
    X[:, 0, 0] = multipliers.constant
    X[:, 0, 1:] = X[:, 1:, 0] = (F @ c[:, :, None])[:, :, 0] / 2
    X[:, 1:, 1:] = full[:, 12:, 12:] - multipliers.shared - F @ phi @ swap(F)
    least_Y = np.linalg.eigvalsh(swap(T) @ H @ T)[:, 0]
    least_X = np.linalg.eigvalsh(X)[:, 0]
    constant = multipliers.equations @ RIGHT + multipliers.constant - c0
    return 4 * least_Y + 2 * least_X - constant


def parts(cells, K):
    """The parts W' and F' of frames, orthonormal."""
    _, rho, _, sigma, _ = roots(K)
    return rho @ (cells.W + K @ cells.F), sigma @ (cells.F - swap(K) @ cells.W)
