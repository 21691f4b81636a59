"""The second order of (V̂, q) and n in cells, which does not depend on multipliers.

The equations w_i·V̂ f_i = 0 of an arm become polynomial with V' = ρ V̂ σ, ρ = (I + KKᵀ)^-½ and
σ = (I + KᵀK)^-½: w'_iᵀ V' f'_i = 0. In the directions (B, C) these read
C·V' + κ(K, V') + D2(K, K; V') = 0, D2(K, L; V) = −C·(K Vᵀ L). So V' = (B + C Z) y with

    (I + N) Z = −L,  N = κ(K, C) + D2(K, K; C),  L = κ(K, B) + D2(K, K; B).

With K = K₁ + K₂ + K₃ of `Cells`, the orders of N, L and Z are

    N₁ = κ(K₁, C),  N₂ = κ(K₂, C) + D2(K₁, K₁; C),  L₁ = κ(K₁, B),
    Z₁ = −L₁,  Z₂ = N₁ L₁ − D2(K₁, K₁; B) − κ(K₂, B).

Then V̂ = ρ⁻¹ V' σ⁻¹ = B y + C Z₁ y + T₂ y + …, T₂ y = C Z₂ y + ½ (K₁K₁ᵀ B y + B y K₁ᵀK₁), and
q = σ⁻¹ q' = q' + ½ K₁ᵀK₁ q' + …, n = F'ᵀ q' with F' = F − Kᵀ W.
"""

from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.cases import Cases
from lockedjoint.formulations.bounds.lever_cells.cells import Cells
from lockedjoint.formulations.bounds.lever_cells.corners import FIRST, SECOND, swap
from lockedjoint.formulations.bounds.lever_cells.remainders import Remainders, remainders
from lockedjoint.nlp.arrays import FloatArray


@dataclass(frozen=True)
class Expansion(Cases):
    """First and second order in τ, for N cells.

    A second order is the sum over all k and l of τ_kτ_l times the entry of the pair; arrays
    have the 21 pairs k ≤ l.

    Attributes
    ----------
    cells
        The cells.
    Z1
        Of the normal part Z, (N,6,6,6): by edge, then 6×6 from y to C.
    N1
        Of N, (N,6,6,6).
    T2
        Of V̂, (N,21,6,12): by pair, then the 12 numbers of V̂ for each unit vector y.
    KtK
        K₁ᵀK₁, (N,21,4,4).
    F1, F2
        Of F', (N,6,4,7) and (N,21,4,7).
    rest
        Bounds of what is left out.
    """

    cells: Cells
    Z1: FloatArray
    N1: FloatArray
    T2: FloatArray
    KtK: FloatArray
    F1: FloatArray
    F2: FloatArray
    rest: Remainders

    @classmethod
    def of_cells(cls, cells: Cells) -> "Expansion":
        """Return the expansion in cells."""
        N = len(cells.W)
        G = cells.edges()
        directions = np.concatenate([cells.B, cells.C], 1).reshape(N, 12, 3, 4)
        first = swap(cells.g)[:, None] @ cells.kappa[:, :, :6, :]
        L1 = first[..., :6].transpose(0, 2, 1, 3)
        N1 = first[..., 6:].transpose(0, 2, 1, 3)
        D2 = _quadratic_part(G, directions, cells.C)
        NL = N1.reshape(N, 36, 6) @ L1.transpose(0, 2, 1, 3).reshape(N, 6, 36)
        Z2 = _pairs(NL.reshape(N, 6, 6, 6, 6)) - D2[..., :6] - _of_second(cells, slice(0, 6))
        N2 = D2[..., 6:] + _of_second(cells, slice(6, 12))
        KKt = _pairs(_products(G))
        KtK = _pairs(_products(swap(G)))
        normal = swap(Z2).reshape(N, 126, 6) @ cells.C
        T2 = normal.reshape(N, 21, 6, 12) + _of_roots(cells.B, KKt, KtK)
        Gw = (swap(G) @ cells.W[:, None]).transpose(0, 3, 1, 2)
        Ew = (swap(directions) @ cells.W[:, None]).reshape(N, 12, 28)
        return cls(
            cells=cells,
            Z1=-L1,
            N1=N1,
            T2=T2,
            KtK=KtK,
            F1=-Gw.transpose(0, 2, 3, 1),
            F2=-(cells.K2 @ Ew).reshape(N, 21, 4, 7),
            rest=remainders(cells, -L1, Z2, N1, N2),
        )

    def normal_rows(self) -> FloatArray:
        """Return the transposes of Z₁ below one another, (N,36,6)."""
        return swap(self.Z1).reshape(-1, 36, 6)


def _pairs(products: FloatArray) -> FloatArray:
    """Return the symmetric parts, for pairs k ≤ l, of (N,6,a,6,b) in k and l: (N,21,a,b)."""
    both = products[:, FIRST, :, SECOND] + products[:, SECOND, :, FIRST]
    return np.asarray(0.5 * both.transpose(1, 0, 2, 3))


def _products(G: FloatArray) -> FloatArray:
    """Return G_k G_lᵀ of (N,6,a,b), as (N,6,a,6,a)."""
    N, _, a, b = G.shape
    rows = G.reshape(N, 6 * a, b)
    return np.asarray((rows @ swap(rows)).reshape(N, 6, a, 6, a))


def _of_second(cells: Cells, part: slice) -> FloatArray:
    """Return κ(K₂, ·) of the directions of one part, B or C, (N,21,6,6)."""
    N = len(cells.W)
    forms = cells.kappa[:, :, :, part].transpose(0, 2, 1, 3).reshape(N, 12, 36)
    return np.asarray((cells.K2 @ forms).reshape(N, 21, 6, 6))


def _quadratic_part(G: FloatArray, directions: FloatArray, C: FloatArray) -> FloatArray:
    """Return D2(K₁, K₁; V) for V along each of 12 directions, (N,21,6,12)."""
    N = len(G)
    transposed = directions.transpose(0, 3, 1, 2).reshape(N, 4, 36)
    GV = (G.reshape(N, 18, 4) @ transposed).reshape(N, 6, 3, 12, 3)
    GV = GV.transpose(0, 1, 3, 2, 4).reshape(N, 216, 3)
    GVG = (GV @ G.transpose(0, 2, 1, 3).reshape(N, 3, 24)).reshape(N, 6, 12, 3, 6, 4)
    both = GVG[:, FIRST, ..., SECOND, :] + GVG[:, SECOND, ..., FIRST, :]
    both = both.transpose(1, 0, 2, 3, 4).reshape(N, 252, 12)
    return swap((both @ swap(-0.5 * C)).reshape(N, 21, 12, 6))


def _of_roots(B: FloatArray, KKt: FloatArray, KtK: FloatArray) -> FloatArray:
    """Return ½ (K₁K₁ᵀ B y + B y K₁ᵀK₁) for unit vectors y, (N,21,6,12)."""
    N = len(B)
    E = B.reshape(N, 6, 3, 4)
    left = KKt.reshape(N, 63, 3) @ E.transpose(0, 2, 1, 3).reshape(N, 3, 24)
    right = E.reshape(N, 18, 4) @ KtK.transpose(0, 2, 1, 3).reshape(N, 4, 84)
    left = left.reshape(N, 21, 3, 6, 4).transpose(0, 1, 3, 2, 4)
    right = right.reshape(N, 6, 3, 21, 4).transpose(0, 3, 1, 2, 4)
    return np.asarray(0.5 * (left + right).reshape(N, 21, 6, 12))
