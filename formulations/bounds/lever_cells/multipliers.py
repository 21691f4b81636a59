"""The multipliers of a cell: a semidefinite program for each cell, many at a time, by a barrier method.

Unknowns x (60): the matrix Y of (y, q), 55 entries; q; and s, the least eigenvalue or inequality, to be greatest.
The equations hold up to a ball: their residual, times multipliers, may be as large as SPREAD times the first-order
change of the quadratic form in the cell. Where s < 0 no arm fulfils the equations in the middle, and the multipliers
are the dual of the point. They need no proof: `bound.excluded` tests them.
"""

from __future__ import annotations

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.bound import (
    EQUATIONS,
    PAIRS,
    RIGHT,
    Multipliers,
)

#: Weight of the first-order change of the quadratic form, and what is added to its squares.
SPREAD = 3.0
RIDGE = 1e-4
#: Weight of s at the start; factor between two weights; duality gap at the end, as a part of −s.
WEIGHT = 300.0
GROWTH = 3.0
SHARE = 0.8
#: Steps of Newton's method at most, and of the search along a line.
STEPS = 40
LINE_STEPS = 5
#: Newton decrement below which the weight grows, and below which the program may end.
NEAR = 0.5
END = 0.1
#: Number of logarithms: 10 + 5 eigenvalues, 35 inequalities, the ball twice.
LOGARITHMS = 52
ROW, COL = np.triu_indices(10)
SCALE = np.where(ROW == COL, 1.0, np.sqrt(2.0))
#: Places in a 10 × 10 matrix of the four products in an entry of the Hessian.
IK, JL = (10 * ROW[:, None] + ROW).ravel(), (10 * COL[:, None] + COL).ravel()
IL, JK = (10 * ROW[:, None] + COL).ravel(), (10 * COL[:, None] + ROW).ravel()
HALF = (SCALE[:, None] * SCALE / 2).ravel()
PLACE = np.zeros((10, 10), int)
PLACE[ROW, COL] = PLACE[COL, ROW] = np.arange(55)
#: Unknowns that X = [1 qᵀ; q Q] − s and the inequalities depend on: Q, q and s.
SHARED = np.array(
    [PLACE[6 + i, 6 + j] for i in range(4) for j in range(i, 4)] + [55, 56, 57, 58, 59]
)


def _directions():
    D = np.zeros((15, 5, 5))
    entries = [(i, j) for i in range(4) for j in range(i, 4)]
    for c, (i, j) in enumerate(entries):
        D[c, i + 1, j + 1] = D[c, j + 1, i + 1] = 1.0 if i == j else np.sqrt(0.5)
    for i in range(4):
        D[10 + i, 0, i + 1] = D[10 + i, i + 1, 0] = 1.0
    D[14] = -np.eye(5)
    return D


DX = _directions()


def _inequalities(F, limit):
    """Return the inequalities g0 (35,) + DG x, x the shared unknowns; DG (N,35,15)."""
    nu = (1 - 3 * limit) / 7
    least, most = np.sqrt(nu), np.sqrt(1 - 6 * nu)
    i, j = np.array(PAIRS).T
    n = np.zeros((len(F), 15, 7))
    n[:, 10:14] = F
    nn = np.swapaxes(F, 1, 2)[:, None] @ DX[:, 1:, 1:] @ F[:, None]
    nn[:, 14] = 0
    squares = nn[:, :, np.arange(7), np.arange(7)]
    DG = np.concatenate(
        [nn[:, :, i, j] - least * (n[:, :, i] + n[:, :, j]), n, (least + most) * n - squares], 2
    )
    DG[:, 14] = -1
    g0 = np.concatenate([np.full(21, least**2), np.full(7, -least), np.full(7, -least * most)])
    return g0, np.ascontiguousarray(np.swapaxes(DG, 1, 2))


def _reduced(e):
    """Return E (N,37,55), the equations in the middle, and their first-order changes (N,37,600)."""
    N = len(e.Z1)
    T = np.zeros((N, 16, 10))
    T[:, :12, :6] = np.swapaxes(e.cells.B, 1, 2)
    T[:, 12:, 6:] = np.eye(4)
    ET = (EQUATIONS.reshape(592, 16) @ T).reshape(N, 37, 16, 10)
    E = np.swapaxes(T, 1, 2)[:, None] @ ET
    CE = (e.cells.C[:, None] @ ET[:, :, :12]).transpose(0, 2, 1, 3).reshape(N, 6, 370)
    change = np.zeros((N, 37, 6, 10, 10))
    half = (np.swapaxes(e.Z1, 2, 3).reshape(N, 36, 6) @ CE).reshape(N, 6, 6, 37, 10)
    change[:, :, :, :6] = half.transpose(0, 3, 1, 2, 4)
    change = change + np.swapaxes(change, 3, 4)
    return E[:, :, ROW, COL] * SCALE, change.reshape(N, 37, 600)


def _line(rate, eigen, ball):
    """Return steps that make −rate·α − Σ log(1 + α·eigen) − log(ball) least; ball = 1 + ball₁α + ball₂α²."""
    lowest = eigen.min(1)
    b1, b2 = ball
    root = (-b1 - np.sqrt(np.maximum(b1 * b1 - 4 * b2, 0))) / (2 * b2)
    root = np.where(root > 0, root, np.inf)
    most = 0.98 * np.minimum(np.where(lowest < 0, -1 / lowest, 1e3), root)
    a = np.minimum(1.0, 0.5 * most)
    for _ in range(LINE_STEPS):
        x = eigen / (1 + a[:, None] * eigen)
        f = 1 + b1 * a + b2 * a * a
        d = (b1 + 2 * b2 * a) / f
        slope = -rate - x.sum(1) - d
        bend = (x * x).sum(1) - 2 * b2 / f + d * d
        a = np.clip(a - slope / bend, 0.2 * a, 0.5 * (a + most))
    return a


def multipliers(e, limit):
    """Return whether multipliers were found, and them, for the cells of an `Expansion`."""
    N = len(e.Z1)
    F = e.cells.F
    E, change = _reduced(e)
    L = np.linalg.cholesky(change @ np.swapaxes(change, 1, 2) + RIDGE * np.eye(37))
    Li = np.linalg.inv(L)
    M, y0 = Li @ E, Li @ RIGHT
    MM = np.swapaxes(M, 1, 2) @ M
    g0, DG = _inequalities(F, limit)
    x = np.zeros((N, 60))
    start = np.linalg.solve(
        E @ np.swapaxes(E, 1, 2) + 1e-9 * np.eye(37),
        np.broadcast_to(RIGHT[:, None], (N, 37, 1)),
    )
    x[:, :55] = (np.swapaxes(E, 1, 2) @ start)[:, :, 0]
    x[:, 55:59] = 0.9 * F.sum(2) / np.sqrt(7)
    X0 = np.zeros((5, 5))
    X0[0, 0] = 1

    def parts(x, at):
        Y = (x[:, :55] / SCALE)[:, PLACE] - x[:, 59, None, None] * np.eye(10)
        r = x[:, SHARED]
        X = X0 + (r @ DX.reshape(15, 25)).reshape(-1, 5, 5)
        g = g0 + (DG[at] @ r[:, :, None])[:, :, 0]
        y = y0[at] - (M[at] @ x[:, :55, None])[:, :, 0]
        return Y, X, g, y

    every = np.arange(N)
    Y, X, g, y = parts(x, every)
    least = np.minimum(np.linalg.eigvalsh(Y)[:, 0], np.linalg.eigvalsh(X)[:, 0])
    x[:, 59] = np.minimum(least, g.min(1)) - 0.3
    weight = np.full(N, WEIGHT)
    good = np.zeros(N, bool)
    at = every[(y * y).sum(1) < SPREAD**2]
    for _ in range(STEPS):
        if not len(at):
            break
        xa, tau, n = x[at], weight[at], len(at)
        Y, X, g, y = parts(xa, at)
        phi = SPREAD**2 - (y * y).sum(1)
        wy, vy = np.linalg.eigh(Y)
        wx, vx = np.linalg.eigh(X)
        ry, rx = vy / np.sqrt(wy)[:, None], vx / np.sqrt(wx)[:, None]
        PY = ry @ np.swapaxes(ry, 1, 2)
        P = PY.reshape(n, 100)
        H = np.zeros((n, 60, 60))
        H[:, :55, :55] = ((P[:, IK] * P[:, JL] + P[:, IL] * P[:, JK]) * HALF).reshape(n, 55, 55)
        H[:, :55, :55] += (2 / phi)[:, None, None] * MM[at]
        ball = 2 * (np.swapaxes(M[at], 1, 2) @ y[:, :, None])[:, :, 0] / phi[:, None]
        H[:, :55, :55] += ball[:, :, None] * ball[:, None, :]
        P2 = PY @ PY
        H[:, 59, :55] = H[:, :55, 59] = -P2[:, ROW, COL] * SCALE
        H[:, 59, 59] = np.trace(P2, axis1=1, axis2=2)
        tx = (np.swapaxes(rx, 1, 2)[:, None] @ DX @ rx[:, None]).reshape(n, 15, 25)
        tg = DG[at] / g[:, :, None]
        H[:, SHARED[:, None], SHARED] += tx @ np.swapaxes(tx, 1, 2) + np.swapaxes(tg, 1, 2) @ tg
        grad = np.zeros((n, 60))
        grad[:, :55] = -PY[:, ROW, COL] * SCALE - ball
        grad[:, 59] = np.trace(PY, axis1=1, axis2=2) - tau
        grad[:, SHARED] -= tx[:, :, ::6].sum(2) + tg.sum(1)
        step = -np.linalg.solve(H, grad[:, :, None])[:, :, 0]
        decrement = np.sqrt(np.maximum(-(grad * step).sum(1), 0))
        gap = LOGARITHMS / tau
        s = xa[:, 59]
        over = (decrement < END) & (s + gap < 0) & (gap < SHARE * -s)
        good[at[over]] = True
        hopeless = (decrement < NEAR) & (s > 0) | ~np.isfinite(decrement)
        dY = (step[:, :55] / SCALE)[:, PLACE] - step[:, 59, None, None] * np.eye(10)
        dX = (step[:, SHARED] @ DX.reshape(15, 25)).reshape(n, 5, 5)
        eigen = [
            np.linalg.eigvalsh(np.swapaxes(ry, 1, 2) @ dY @ ry),
            np.linalg.eigvalsh(np.swapaxes(rx, 1, 2) @ dX @ rx),
        ]
        eigen.append((tg @ step[:, SHARED, None])[:, :, 0])
        dy = (M[at] @ step[:, :55, None])[:, :, 0]
        a = _line(
            tau * step[:, 59],
            np.concatenate(eigen, 1),
            ((ball * step[:, :55]).sum(1), -(dy * dy).sum(1) / phi),
        )
        a = np.where(decrement < 0.3, 1.0, a)
        go = ~(over | hopeless)
        x[at[go]] += (a[:, None] * step)[go]
        up = go & (decrement < NEAR) & ~((s + gap < 0) & (gap < SHARE * -s))
        weight[at[up]] *= GROWTH
        at = at[go]
    return good, _dual(x, weight, parts, every, Li, F, limit)


def _dual(x, weight, parts, every, Li, F, limit):
    Y, X, g, y = parts(x, every)
    phi = SPREAD**2 - (y * y).sum(1)
    equations = -2 * (np.swapaxes(Li, 1, 2) @ y[:, :, None])[:, :, 0] / (phi * weight)[:, None]
    inequality = 1 / (weight[:, None] * g)
    ZX = np.linalg.pinv(X, hermitian=True) / weight[:, None, None]
    lower, upper = inequality[:, 21:28], inequality[:, 28:]
    phi = np.zeros((len(x), 7, 7))
    i, j = np.array(PAIRS).T
    phi[:, i, j] = phi[:, j, i] = inequality[:, :21] / 2
    phi[:, np.arange(7), np.arange(7)] = -upper
    full = (equations @ EQUATIONS[:, 12:, 12:].reshape(37, 16)).reshape(-1, 4, 4)
    shared = full - F @ phi @ np.swapaxes(F, 1, 2) - ZX[:, 1:, 1:]
    return Multipliers(equations, shared, inequality[:, :21], lower, upper, ZX[:, 0, 0])
