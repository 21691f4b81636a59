"""Charts: places of unit tight frames around one of them, the centre.

A frame is the row space of W (3×7), with F (4×7) an orthonormal basis of its complement; it is
tight (of columns of one length) where |w_i|² = 3/7 for all seven columns of W. Near a centre
(W̄, F̄) a frame is the row space of W̄ + K F̄, with K = Σ t_k B_k + Σ z_m C_m (3×4). The rows
of (B; C) are an orthonormal basis of the 12 numbers of K: along C the lengths of the columns
change to first order, along B they do not. So tight frames near the centre have coordinates t
(6), and z (6) follows by Newton's method.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.corners import inverse3, swap
from lockedjoint.nlp.arrays import FloatArray

#: Squared length of every column of W.
COLUMN2 = 3.0 / 7.0
#: Steps of Newton's method at most.
STEPS = 14
#: Residual ½ max | |w_i|² − 3/7 | below which a step has nothing left to gain.
SETTLED = 1e-14
#: Residual below which a frame counts as tight.
RESIDUAL = 1e-12
#: Longest step of Newton's method in z.
LONGEST_STEP = 0.2
#: Addition to the normal equations of a step, which may be singular.
RIDGE = 1e-14
#: Least squared singular value that `normals` divides by.
LEAST_SQUARE = 1e-12
#: Greatest deviation, in a Frobenius norm, of what should be orthonormal, inverse or tangent;
#: in boxes of seven vectors it was at most 7e-15.
DEVIATION = 1e-13
#: Residual of a centre at most.
CENTRE_RESIDUAL = 1e-13


@dataclass(frozen=True)
class Chart:
    """A centre with its directions, and the ball of K around it that is of interest.

    Attributes
    ----------
    W, F : the centre, (3,7) and (4,7); together an orthogonal matrix.
    B, C : tangent and normal directions, (6,12) each, flattened 3×4 matrices.
    greatest : bound T of |K|: only frames with |K| ≤ T are looked at.
    least : least singular value of the equations at the centre, as in `directions`.
    """

    W: FloatArray
    F: FloatArray
    B: FloatArray
    C: FloatArray
    greatest: float
    least: float


def tight_chart(W: FloatArray, squared: float) -> Chart:
    """Return the chart of the tight frame next to the row space of W (3,7).

    The frames with tr(P P̄) ≥ 3 − `squared` are all in it: with angles α_i between both row
    spaces Σ sin² α_i ≤ s, and |K|² = Σ tan² α_i is then at most s/(1 − s), as s/(1 − s) is
    convex and 0 at 0.

    Raises
    ------
    ValueError
        If Newton's method does not find a tight frame there, or rounding is not small.
    """
    W, F = _orthogonal(W)
    for _ in range(3):
        _, sg, B, C = directions(W, F)
        z, residual = middles(Chart(W, F, B, C, 1.0, float(sg.min())), *np.zeros((2, 1, 6)))
        W, F = _orthogonal(W + (z @ C).reshape(3, 4) @ F)
    if not residual[0] < CENTRE_RESIDUAL:
        raise ValueError(f"no tight frame: residual {residual[0]:.1e}")
    U, sg, B, C = directions(W, F)
    frame, K = np.concatenate([W, F]), np.concatenate([B, C])
    A = (W.T[:, :, None] * F.T[:, None, :]).reshape(7, 12)
    for deviation in (frame @ frame.T - np.eye(7), K @ K.T - np.eye(12), (U * sg) @ C - A):
        if not frobenius(deviation[None])[0] < DEVIATION:
            raise ValueError(f"large rounding errors in a chart: {np.abs(deviation).max():.1e}")
    return Chart(W, F, B, C, float(np.sqrt(squared / (1 - squared))), float(sg.min()))


def frobenius(matrices: FloatArray) -> FloatArray:
    """Return the Frobenius norms of matrices (N,a,b)."""
    return np.asarray(np.sqrt(np.einsum("nij,nij->n", matrices, matrices)))


def _orthogonal(W: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return orthonormal bases of the row space of W, the nearest to W, and of the rest."""
    u, _, v = np.linalg.svd(W, full_matrices=True)
    return u @ v[:3], v[3:]


def directions(
    W: FloatArray, F: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return U, sg, B and C: the seven numbers w_iᵀ K f_i are U diag(sg) C K.

    Parameters
    ----------
    W, F : frames, (…,3,7) and (…,4,7).

    Returns
    -------
    U (…,7,6), sg (…,6), B (…,6,12), C (…,6,12), by the singular value decomposition of the 7×12
    matrix with rows w_i f_iᵀ. Its rank is at most 6, as these add up to W Fᵀ = 0.
    """
    A = np.einsum("...ai,...bi->...iab", W, F)
    A = A.reshape(*A.shape[:-2], 12)
    U, sg, V = np.linalg.svd(A)
    return U[..., :6], sg[..., :6], V[..., 6:, :], V[..., :6, :]


def normals(W: FloatArray, F: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return U (N,7,6), sg (N,6), in rising order, and C (N,6,12), as `directions`, but sooner.

    They come from the eigenvectors of a 7×7 matrix. UᵀA = diag(sg) C holds always; the rows of
    C are orthonormal up to 1e-16/sg².
    """
    A = (swap(W)[:, :, :, None] * swap(F)[:, :, None, :]).reshape(len(W), 7, 12)
    squares, vectors = np.linalg.eigh(A @ swap(A))
    sg = np.sqrt(np.maximum(squares[:, 1:], LEAST_SQUARE))
    U = vectors[:, :, 1:]
    return U, sg, (swap(U) @ A) / sg[:, :, None]


def roots(
    K: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return (I+KKᵀ)^½, its inverse ρ, (I+KᵀK)^½, its inverse σ, and ‖K‖, for K (N,3,4).

    The frame of K in the frame (W, F) is (ρ(W + K F), σ(F − Kᵀ W)).
    """
    squares, v = np.linalg.eigh(K @ swap(K))
    squares = np.maximum(squares, 0)
    d = np.sqrt(1 + squares)
    along = swap(K) @ v
    root3 = (v * d[:, None]) @ swap(v)
    rho = (v / d[:, None]) @ swap(v)
    root4 = np.eye(4) + (along / (1 + d)[:, None]) @ swap(along)
    sigma = np.eye(4) - (along / (d * (1 + d))[:, None]) @ swap(along)
    return root3, rho, root4, sigma, np.asarray(np.sqrt(squares[:, 2]), float)


def middles(chart: Chart, t: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return normal coordinates of tight frames with tangent coordinates t, by Newton's method.

    Parameters
    ----------
    t : tangent coordinates, (N,6).
    z : where to start, (N,6).

    Returns
    -------
    Normal coordinates (N,6) and their residuals ½ max | |w_i|² − 3/7 | (N): where a residual is
    at least `RESIDUAL`, no frame was found.
    """
    fixed = t @ chart.B
    z = z.copy()
    residual = np.full(len(t), np.inf)
    active = np.arange(len(t))
    for step in range(STEPS):
        K = (fixed[active] + z[active] @ chart.C).reshape(-1, 3, 4)
        rows, defect = _columns(chart, K)
        residual[active] = np.abs(defect).max(1)
        left = residual[active] > SETTLED
        if step == STEPS - 1 or not left.any():
            break
        active = active[left]
        z[active] -= _step(chart, K[left], rows[left], defect[left])
    return z, residual


def _columns(chart: Chart, K: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (I+KKᵀ)^-1 (W̄ + K F̄) (N,3,7) and ½(|w_i|² − 3/7) of the frame of K (N,7)."""
    V = chart.W + K @ chart.F
    rows = inverse3(np.eye(3) + K @ swap(K)) @ V
    return rows, 0.5 * (np.einsum("nai,nai->ni", V, rows) - COLUMN2)


def _step(chart: Chart, K: FloatArray, rows: FloatArray, defect: FloatArray) -> FloatArray:
    """Return a step of Newton's method in z (N,6), by least squares and not too long."""
    f = chart.F - swap(K) @ rows
    outer = (swap(rows)[:, :, :, None] * swap(f)[:, :, None, :]).reshape(-1, 12)
    D = (outer @ np.ascontiguousarray(chart.C.T)).reshape(-1, 7, 6)
    step = np.linalg.solve(swap(D) @ D + RIDGE * np.eye(6), swap(D) @ defect[:, :, None])[
        :, :, 0
    ]
    length = np.sqrt((step * step).sum(1, keepdims=True))
    return np.asarray(step * np.minimum(1.0, LONGEST_STEP / np.maximum(length, 1e-300)))
