"""The certificate of a cell: multipliers for which no arm of a frame in it fulfils the equations."""

from __future__ import annotations
from dataclasses import dataclass
import itertools
import numpy as np
from lockedjoint.formulations.bounds.lever_cells.cells import CORNERS, COLUMN

PAIRS = [(i, j) for i in range(7) for j in range(i + 1, 7)]
UPPER = [(k, l) for k in range(6) for l in range(k + 1, 6)]
#: Pairs k ≤ l of edges, by number; those with k = l; and the weight of the symmetric part of a pair.
FIRST, SECOND = np.triu_indices(6)
SQUARES = np.flatnonzero(FIRST == SECOND)
MIXED = np.flatnonzero(FIRST != SECOND)
TWICE = np.where(FIRST == SECOND, 1.0, 2.0)
#: Products 1, τ_k and τ_kτ_l, k < l, at the 64 corners (22, 64).
MONOMIALS = np.concatenate(
    [np.ones((64, 1)), CORNERS, CORNERS[:, FIRST[MIXED]] * CORNERS[:, SECOND[MIXED]]], 1
).T.copy()
#: Cells whose corners are tested together: their matrices should stay in the cache.
TOGETHER = 32


def _sign(p):
    return (-1) ** sum(p[i] > p[j] for i in range(4) for j in range(i + 1, 4))


def equations():
    """Return the 37 equations ⟨E, oo^T⟩ = b of o, the 16 entries of a matrix of SO(4)."""
    E, b = [], []

    def add(terms, right):
        M = np.zeros((16, 16))
        for i, j, v in terms:
            M[i, j] += v / 2
            M[j, i] += v / 2
        E.append(M)
        b.append(right)

    for a in range(3):
        for c in range(a, 4):
            add([(4 * a + j, 4 * c + j, 1.0) for j in range(4)], a == c)
    for i in range(4):
        for j in range(i, 4):
            add([(4 * a + i, 4 * a + j, 1.0) for a in range(4)], i == j)
    for a in range(3):
        for c in range(a + 1, 3):
            d = 3 - a - c
            for i in range(4):
                for j in range(i + 1, 4):
                    k, m = [t for t in range(4) if t not in (i, j)]
                    s = _sign((a, c, d, 3)) * _sign((i, j, k, m))
                    add(
                        [
                            (4 * a + i, 4 * c + j, 1.0),
                            (4 * a + j, 4 * c + i, -1.0),
                            (4 * d + k, 12 + m, -s),
                            (4 * d + m, 12 + k, s),
                        ],
                        0,
                    )
    return np.array(E), np.array(b, float)


EQUATIONS, RIGHT = equations()


@dataclass
class Multipliers:
    """For N cells: of the equations (N,37), of q's block (N,4,4), of the products (N,21), of n_i ≥ √ν (N,7), of n_i ≤ … (N,7), constant (N,)."""

    equations: np.ndarray
    shared: np.ndarray
    products: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    constant: np.ndarray

    def take(self, which):
        return Multipliers(
            *(
                getattr(self, n)[which]
                for n in ("equations", "shared", "products", "lower", "upper", "constant")
            )
        )


def polynomial(m, limit):
    """Return φ (N,7,7), c (N,7), c0 (N,): Σ multiplier·inequality = nᵀφn − c·n − c0, n_i ≥ least."""
    nu = (1 - 3 * limit) / 7
    least, most = np.sqrt(nu), np.sqrt(1 - 6 * nu)
    N = len(m.constant)
    phi, c = np.zeros((N, 7, 7)), np.zeros((N, 7))
    c0 = (
        -(least**2) * m.products.sum(1) + least * m.lower.sum(1) + least * most * m.upper.sum(1)
    )
    for p, (i, j) in enumerate(PAIRS):
        phi[:, i, j] += m.products[:, p] / 2
        phi[:, j, i] += m.products[:, p] / 2
        c[:, i] += least * m.products[:, p]
        c[:, j] += least * m.products[:, p]
    i = np.arange(7)
    phi[:, i, i] -= m.upper
    c -= m.lower + (least + most) * m.upper
    return phi, c, c0


def _norm(M):
    """Return the greatest singular value of (N,a,b)."""
    return np.linalg.norm(M, 2, axis=(1, 2))


def third(k, r, least):
    """Bound of the part of u beyond −½κ(K,K), for |K| ≤ r and ‖K‖ ≤ k."""
    return (2 * COLUMN * k**2 * r + 0.756 * k**3 * r + COLUMN * k**2 * r**2) / (2 * least)


def _high(M):
    """Return an upper bound of the greatest singular value of (…,a,b): the Schatten norm with p = 8."""
    if M.shape[-1] == 1:
        return np.sqrt((M * M).sum((-1, -2)))
    M = np.swapaxes(M, -1, -2) @ M if M.shape[-1] <= M.shape[-2] else M @ np.swapaxes(M, -1, -2)
    M = M @ M
    return (M * M).sum((-1, -2)) ** 0.125


def greatest(P1):
    """Return a bound of max ‖Σ τ_k P_k‖, which is convex, so greatest at a corner; (N,6,a,b)."""
    N, _, a, b = P1.shape
    return _high((CORNERS[:32] @ P1.reshape(N, 6, a * b)).reshape(N, 32, a, b)).max(1)


def greatest_square(P2):
    """Return a bound of max ‖Σ τ_kτ_l P_kl‖, P_kl = P_lk: squares are ½ ± ½; (N,6,6,a,b)."""
    N, _, _, a, b = P2.shape
    k, l = np.array(UPPER).T
    d = P2[:, np.arange(6), np.arange(6)]
    off = (2 * CORNERS[:32, k] * CORNERS[:32, l]) @ P2[:, k, l].reshape(N, 15, a * b)
    return _high(off.reshape(N, 32, a, b) + 0.5 * d.sum(1)[:, None]).max(1) + 0.5 * _high(
        d
    ).sum(1)


def _size(M):
    """Return the greatest singular value of (N,a,b)."""
    T = np.swapaxes(M, -1, -2)
    S = T @ M if M.shape[-1] <= M.shape[-2] else M @ T
    return np.sqrt(np.maximum(np.linalg.eigvalsh(S)[..., -1], 0))


def beyond(k, r, least):
    """Bound of the part of u beyond −½κ(K,K), as `third`, where SU (w_iᵀ M f_i) = C·M bounds the first term."""
    return k**2 * r + (0.756 * k**3 * r + COLUMN * k**2 * r**2) / (2 * least)


def greatest_pairs(P2):
    """Return a bound of max ‖Σ_{k≤l} τ_kτ_l TWICE P_kl‖, as `greatest_square`; (N,21,a,b)."""
    N, _, a, b = P2.shape
    d = P2[:, SQUARES]
    off = 2 * MONOMIALS[7:, :32].T @ P2[:, MIXED].reshape(N, 15, a * b)
    return _high(off.reshape(N, 32, a, b) + 0.5 * d.sum(1)[:, None]).max(1) + 0.5 * _high(
        d
    ).sum(1)


def positive(A, n):
    """Return whether matrices are positive; A (n(n+1)/2, L): lower columns, one after another; A is overwritten."""
    good = np.ones(A.shape[1], bool)
    start = 0
    with np.errstate(all="ignore"):
        for j in range(n):
            column = A[start : start + n - j]
            good &= column[0] > 0
            share = column[1:] / column[0]
            at = start + n - j
            for i in range(j + 1, n):
                A[at : at + n - i] -= share[i - j - 1] * column[i - j :]
                at += n - i
            start += n - j
    return good


def _flat(A):
    """Return an upper bound of max |A(x,y,z)| over unit vectors, by two flattenings; (N,a,6,6)."""
    out = []
    for M in (np.swapaxes(A, 1, 2), A.transpose(0, 3, 1, 2)):
        M = M.reshape(len(A), 6, -1)
        out.append(np.linalg.eigvalsh(M @ np.swapaxes(M, 1, 2))[:, -1])
    return np.sqrt(np.maximum(np.minimum(*out), 0))


class Expansion:
    """The second order of (V, q) and n in cells, and norms of what is left; it does not depend on multipliers.

    T2 (N,21,6,12): of V, for pairs k ≤ l; Z1 (N,6,6,6): of the normal part; F1 (N,6,4,7), F2 (N,21,4,7) of F.
    """

    def __init__(self, cells):
        N = len(cells.W)
        self.cells = cells
        W, F, g, kap = cells.W, cells.F, cells.g, cells.kappa
        E = cells.B.reshape(N, 6, 3, 4)
        gt = np.swapaxes(g, 1, 2)
        kB = gt[:, None] @ kap[:, :, :6, :]
        L1 = kB[..., :6].transpose(0, 2, 1, 3)
        N1 = kB[..., 6:].transpose(0, 2, 1, 3)
        u2 = (-0.5 * kB[..., :6] @ g[:, None])[:, :, FIRST, SECOND]
        u2 = np.ascontiguousarray(np.swapaxes(u2, 1, 2))  # n,p,m
        G = (gt @ cells.B).reshape(N, 6, 3, 4)
        Gw = (np.swapaxes(G, 2, 3) @ W[:, None]).transpose(0, 3, 1, 2)
        E12 = np.concatenate([E, cells.C.reshape(N, 6, 3, 4)], 1)
        R = np.swapaxes(E12, 2, 3).reshape(N, 48, 3)  # D2(K,L;V) = −C·(K Vᵀ L), symmetric part
        GE = G.reshape(N, 18, 4) @ R.reshape(N, 12, 4, 3).transpose(0, 2, 1, 3).reshape(
            N, 4, 36
        )
        GE = (
            GE.reshape(N, 6, 3, 12, 3).transpose(0, 1, 3, 2, 4).reshape(N, 216, 3)
        )  # n,(k v a),b
        GEG = (GE @ G.transpose(0, 2, 1, 3).reshape(N, 3, 24)).reshape(N, 6, 12, 3, 6, 4)
        GEG = (
            (GEG[:, FIRST, ..., SECOND, :] + GEG[:, SECOND, ..., FIRST, :])
            .transpose(1, 0, 2, 3, 4)
            .reshape(N, 252, 12)
        )
        D2 = (GEG @ np.swapaxes(-0.5 * cells.C, 1, 2)).reshape(N, 21, 12, 6)
        L2 = np.swapaxes(D2[:, :, :6], 2, 3)
        N2 = np.swapaxes(D2[:, :, 6:], 2, 3)
        NL = N1.reshape(N, 36, 6) @ L1.transpose(0, 2, 1, 3).reshape(N, 6, 36)
        NL = NL.reshape(N, 6, 6, 6, 6)  # n,k,m,l,b
        NL = 0.5 * (NL[:, FIRST, :, SECOND] + NL[:, SECOND, :, FIRST]).transpose(1, 0, 2, 3)
        kCB = kap[:, :, 6:, :6].transpose(0, 2, 1, 3).reshape(N, 6, 36)
        self.Z1 = -L1
        self.kCB = kCB
        self.N1 = N1
        self.Z2 = NL - L2 - (u2 @ kCB).reshape(N, 21, 6, 6)
        kCC = kap[:, :, 6:, 6:].transpose(0, 2, 1, 3).reshape(N, 6, 36)
        self.N2 = N2 + (u2 @ kCC).reshape(N, 21, 6, 6)
        R = G.reshape(N, 18, 4)
        KKt = (R @ np.swapaxes(R, 1, 2)).reshape(N, 6, 3, 6, 3)
        KKt = 0.5 * (KKt[:, FIRST, :, SECOND] + KKt[:, SECOND, :, FIRST]).transpose(1, 0, 2, 3)
        R = np.swapaxes(G, 2, 3).reshape(N, 24, 3)
        KtK = (R @ np.swapaxes(R, 1, 2)).reshape(N, 6, 4, 6, 4)
        KtK = 0.5 * (KtK[:, FIRST, :, SECOND] + KtK[:, SECOND, :, FIRST]).transpose(1, 0, 2, 3)
        left = (KKt.reshape(N, 63, 3) @ E.transpose(0, 2, 1, 3).reshape(N, 3, 24)).reshape(
            N, 21, 3, 6, 4
        )
        right = (E.reshape(N, 18, 4) @ KtK.transpose(0, 2, 1, 3).reshape(N, 4, 84)).reshape(
            N, 6, 3, 21, 4
        )
        S2 = 0.5 * (left.transpose(0, 1, 3, 2, 4) + right.transpose(0, 3, 1, 2, 4)).reshape(
            N, 126, 12
        )
        self.T2 = np.swapaxes(self.Z2, 2, 3).reshape(N, 126, 6) @ cells.C + S2
        self.KtK = KtK
        self.G, self.u2 = G, u2
        self.F1 = -Gw.transpose(0, 2, 3, 1)
        Cw = (np.swapaxes(cells.C.reshape(N, 6, 3, 4), 2, 3) @ W[:, None]).reshape(N, 6, 28)
        self.F2 = -(u2 @ Cw).reshape(N, 21, 4, 7)
        self._norms()

    def _norms(self):
        cells = self.cells
        least = cells.sg.min(1)
        k, l1, n1 = greatest(self.G), greatest(self.Z1), greatest(self.N1)
        z2, n2, u2n = (
            greatest_pairs(self.Z2),
            greatest_pairs(self.N2),
            greatest_pairs(self.u2[..., None]),
        )
        rs, ru, ru3 = cells.rs, cells.ru, cells.ru3
        for _ in range(3):
            r = np.sqrt(rs**2 + ru**2)
            op = np.minimum(k + ru, r)
            ru3 = np.minimum(ru3, n1 * ru + 0.5 * cells.kcc * ru**2 + beyond(op, r, least))
            ru = np.minimum(ru, u2n + ru3)
        self.R2 = op**2
        self.cross = 2 * k * ru + ru**2
        n3 = cells.kcc * ru3 + self.cross
        n = n1 + n2 + n3
        left3 = cells.ksc * ru3 + self.cross + (n2 + n3) * l1 + n * z2
        with np.errstate(all="ignore"):
            self.z3 = np.where(n < 0.9, left3 / (1 - n), np.inf)
            # Z3 = −κ(Cu3,B) − (rest of L) + (rest of N) Z1 .. − N1 Z2 − (rest of N) Z2 − N Z3
            self.rest3 = self.cross + (n2 + n3) * (l1 + z2) + n * self.z3
        self.k, self.l1, self.z2, self.ru3, self.n1 = k, l1, z2, ru3, n1
        self.z = l1 + z2 + self.z3
        self.s3 = self.cross + self.R2 * self.z + 0.5 * self.R2**2 * (1 + self.z)
        self.theta = 1 / ((1 + self.R2) ** 2 * (1 + self.z**2))

    def take(self, which):
        """Return the expansion of some of the cells."""
        out = object.__new__(Expansion)
        out.__dict__ = {
            n: a[which] if n != "cells" else a.take(which) for n, a in self.__dict__.items()
        }
        return out


class Forms:
    """The two quadratic forms of multipliers m in cells: Y (N,28,10,10) and X (N,28,5,5), monomials 1, τ_k, τ_kτ_l."""

    def __init__(self, e, m, limit):
        self.e = e
        cells = e.cells
        N = len(cells.W)
        F, B, C = cells.F, cells.B, cells.C
        full = (m.equations @ EQUATIONS.reshape(37, 256)).reshape(N, 16, 16)
        phi, c, c0 = polynomial(m, limit)
        H = full.copy()
        H[:, 12:, 12:] = m.shared
        Hq = full[:, 12:, 12:] - m.shared
        bound = m.equations @ RIGHT + m.constant - c0
        Fphi = F @ phi
        Y0 = np.empty((N, 10, 10))
        HB = H[:, :, :12] @ np.swapaxes(B, 1, 2)
        Y0[:, :6, :6] = B @ HB[:, :12]
        Y0[:, 6:, :6] = HB[:, 12:]
        Y0[:, :6, 6:] = np.swapaxes(HB[:, 12:], 1, 2)
        Y0[:, 6:, 6:] = m.shared
        X0 = np.zeros((N, 5, 5))
        X0[:, 0, 0] = m.constant
        X0[:, 0, 1:] = X0[:, 1:, 0] = (F @ c[:, :, None])[:, :, 0] / 2
        X0[:, 1:, 1:] = Hq - Fphi @ np.swapaxes(F, 1, 2)
        ly, lx = np.linalg.eigvalsh(Y0)[:, 0], np.linalg.eigvalsh(X0)[:, 0]
        self.middle = (4 * ly + 2 * lx - bound) / 6
        sy, sx = ly - self.middle, lx - self.middle  # 4 sy + 2 sx = bound
        self.H = H - sy[:, None, None] * np.eye(16)
        self.Hq = Hq - sx[:, None, None] * np.eye(4)
        self.Y0 = Y0 - sy[:, None, None] * np.eye(10)
        self.X0 = X0 - sx[:, None, None] * np.eye(5)
        self.HT0 = np.concatenate([HB, H[:, :, 12:]], 2)
        self.HT0[:, :12, :6] -= sy[:, None, None] * np.swapaxes(B, 1, 2)
        self.HT0[:, 12:, 6:] -= sy[:, None, None] * np.eye(4)
        self.CHT0 = C @ self.HT0[:, :12]  # n,m,10
        self.CH = C @ self.H[:, :12]  # n,m,16
        self.HC = self.CH[:, :, :12] @ np.swapaxes(C, 1, 2)
        self.phi, self.c, self.Fphi = phi, c, Fphi
        self._errors()

    def _errors(self):
        e = self.e
        nH, nHT0, nCHT0 = (
            np.abs(np.linalg.eigvalsh(self.H)).max(1),
            _size(self.HT0),
            _size(self.CHT0),
        )
        nHC, nCH = np.abs(np.linalg.eigvalsh(self.HC)).max(1), _size(self.CH)
        t2 = e.z2 + e.k**2
        e3 = e.z3 + e.s3
        # the normal part of order 3 times CHT0: κ(Cu3,B), N1 Z2 together with CHT0, the rest by norms
        N = len(nH)
        A = (np.swapaxes(self.CHT0, 1, 2) @ e.kCB).reshape(N, 10, 6, 6)
        nk = np.minimum(nCHT0 * e.cells.ksc, _flat(A))
        nN1 = np.minimum(nCHT0 * e.n1, greatest(np.swapaxes(self.CHT0, 1, 2)[:, None] @ e.N1))
        normal = nk * e.ru3 + nN1 * e.z2 + nCHT0 * e.rest3
        nZ = np.minimum(e.l1 * nHC, greatest(self.HC[:, None] @ e.Z1))
        self.errY = 2 * (normal + nHT0 * e.s3) + 2 * (nZ * e.z2 + e.l1 * nCH * e.k**2)
        self.errY += 2 * e.l1 * nH * e3 + nH * (t2 + e3) ** 2
        nphi, nc = np.abs(np.linalg.eigvalsh(self.phi)).max(1), np.linalg.norm(self.c, axis=1)
        nHq = np.abs(np.linalg.eigvalsh(self.Hq)).max(1)
        self.errX = (
            nc * e.ru3 / 2 + 2 * nphi * e.ru3 + nphi * e.cross + nHq * (e.cross + 0.5 * e.R2**2)
        )

    def scores(self):
        """Return how much each edge changes the forms to first order, next to their least eigenvalues (N,6)."""
        N = len(self.Y0)
        Y1 = (np.swapaxes(self.e.Z1, 2, 3).reshape(N, 36, 6) @ self.CHT0).reshape(N, 6, 6, 10)
        return np.sqrt((Y1 * Y1).sum((2, 3)))

    def take(self, which):
        """Return the forms of some of the cells."""
        out = object.__new__(Forms)
        out.__dict__ = {
            n: a.take(which) if n == "e" else a[which] for n, a in self.__dict__.items()
        }
        return out

    def expand(self):
        """Compute the first and second order: Y, X (N,28,·,·)."""
        e = self.e
        N = len(self.Y0)
        Zt = np.swapaxes(e.Z1, 2, 3).reshape(N, 36, 6)
        Y = np.zeros((N, 28, 10, 10))
        Y[:, 1:7, :6] = (Zt @ self.CHT0).reshape(N, 6, 6, 10)
        Y[:, 7:, :6] = (e.T2 @ self.HT0[:, :12]).reshape(N, 21, 6, 10)
        Y[:, 7:, 6:] = (0.5 * e.KtK.reshape(N, 84, 4) @ self.HT0[:, 12:]).reshape(N, 21, 4, 10)
        ZHZ = ((Zt @ self.HC) @ np.swapaxes(Zt, 1, 2)).reshape(N, 6, 6, 6, 6)
        Y[:, 7:, :6, :6] += 0.5 * ZHZ[:, FIRST, :, SECOND].transpose(1, 0, 2, 3)
        Y = Y + np.swapaxes(Y, 2, 3)
        Y[:, 7:] *= TWICE[:, None, None]
        Y[:, 0] = self.Y0
        X = np.zeros((N, 28, 5, 5))
        F12 = np.concatenate([e.F1, e.F2], 1).reshape(N, 108, 7)
        X[:, 1:, 1:, 0] = (F12 @ self.c[:, :, None] / 2).reshape(N, 27, 4)
        X[:, 1:, 1:, 1:] = -(F12 @ np.swapaxes(self.Fphi, 1, 2)).reshape(N, 27, 4, 4)
        R = e.F1.reshape(N, 24, 7)
        q = (R @ self.phi @ np.swapaxes(R, 1, 2)).reshape(N, 6, 4, 6, 4)
        X[:, 7:, 1:, 1:] -= 0.5 * q[:, FIRST, :, SECOND].transpose(1, 0, 2, 3)
        X[:, 7:, 1:, 1:] += (0.5 * e.KtK.reshape(N, 84, 4) @ self.Hq).reshape(N, 21, 4, 4)
        X = X + np.swapaxes(X, 2, 3)
        X[:, 7:] *= TWICE[:, None, None]
        X[:, 0] = self.X0
        self.Y, self.X = Y, X

    def lower(self):
        """Return Y and X (N,22,·,·) without squares: their negative parts are added to the constant ones."""
        out = []
        for P in (self.Y, self.X):
            w, v = np.linalg.eigh(P[:, 7 + SQUARES])
            P0 = P[:, 0] + ((v * np.minimum(w, 0)[:, :, None, :]) @ np.swapaxes(v, -1, -2)).sum(
                1
            )
            out.append(np.concatenate([P0[:, None], P[:, 1:7], P[:, 7 + MIXED]], 1))
        return out


def corner_values(forms):
    """Return the least eigenvalues of Y and X, less the errors, at the corners (N,64)."""
    N = len(forms.Y)
    Y, X = forms.lower()
    vy = np.linalg.eigvalsh((MONOMIALS.T @ Y.reshape(N, 22, 100)).reshape(N, 64, 10, 10))[
        ..., 0
    ]
    vx = np.linalg.eigvalsh((MONOMIALS.T @ X.reshape(N, 22, 25)).reshape(N, 64, 5, 5))[..., 0]
    return vy - forms.errY[:, None], vx - forms.errX[:, None]


def values(cells, m, limit):
    """Return a lower bound of a sum that is at most 0 if an arm exists, by all eigenvalues (slow)."""
    forms = Forms(Expansion(cells), m, limit)
    forms.expand()
    vy, vx = corner_values(forms)
    theta = forms.e.theta[:, None]
    out = (4 * np.minimum(vy, theta * vy) + 2 * np.minimum(vx, theta * vx)).min(1)
    return np.where(cells.ok & np.isfinite(out), out, -np.inf)


def _columns(P, which=slice(None)):
    """Return the lower columns of the matrices at corners, (n(n+1)/2, N·corners), of P (N,22,n,n)."""
    N, _, n, _ = P.shape
    j, i = np.triu_indices(n)
    M = MONOMIALS[:, which]
    entries = P.reshape(N, 22, n * n)[:, :, i * n + j].transpose(2, 0, 1).reshape(-1, 22)
    return (entries @ M).reshape(len(i), -1)


def _diagonal(n):
    """Return the places of the diagonal among lower columns."""
    return np.cumsum([0] + [n - j for j in range(n - 1)])


def _corners(Y, X, errY, errX, theta, margin):
    N = len(Y)
    a = _columns(X)
    j, i = np.triu_indices(5)
    M = np.zeros((a.shape[1], 5, 5))
    M[:, i, j] = a.T
    x = np.linalg.eigvalsh(M)[:, 0] - 1e-9  # "L": only the lower part is read
    vx = x.reshape(N, 64) - errX[:, None]
    need = (margin - 2 * np.minimum(vx, theta[:, None] * vx)) / 4
    need = np.where(need > 0, need / theta[:, None], need) + errY[:, None]
    a[_diagonal(5)] -= x
    good = positive(a, 5)
    a = _columns(Y)
    a[_diagonal(10)] -= need.reshape(-1)
    good &= positive(a, 10)
    return good.reshape(N, 64).all(1)


def excluded(expansion, m, limit, margin):
    """Return whether `values` is above margin, and the forms of all cells that are good in the middle."""
    forms = Forms(expansion, m, limit)
    e = expansion
    out = np.zeros(len(forms.middle), bool)
    forms.slack = slack = (
        np.minimum(forms.middle, e.theta * forms.middle) * 6 - 4 * forms.errY - 2 * forms.errX
    )
    with np.errstate(all="ignore"):
        todo = np.flatnonzero(e.cells.ok & np.isfinite(slack) & (slack > margin))
    for s in range(0, len(todo), TOGETHER):
        some = todo[s : s + TOGETHER]
        f = forms.take(some)
        f.expand()
        Y, X = f.lower()
        out[some] = _corners(Y, X, f.errY, f.errX, f.e.theta, margin)
    return out, forms
