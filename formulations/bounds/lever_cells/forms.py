"""The two quadratic forms that multipliers make of equations and inequalities, in cells.

Multipliers make a sum that is at most 0 if there is an arm: a form of (V̂, q) plus a form of
(1, q) minus a constant. In the coordinates x = (y, q') and (1, q') the forms are xᵀ Y x and
(1, q')ᵀ X (1, q'), with matrices Y and X that depend on the place τ in the cell. |V̂|² + |q|²
= 4 and 1 + |q|² = 2 do not, so that multiples of the identity share out the constant: what is
left is that the sum of both forms is at most 0. Y and X are known to second order, up to
errors.
"""

from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.cases import Cases
from lockedjoint.formulations.bounds.lever_cells.corners import (
    FIRST,
    SECOND,
    TWICE,
    greatest,
    size,
    swap,
    symmetric_size,
    trilinear_size,
)
from lockedjoint.formulations.bounds.lever_cells.equations import (
    EQUATIONS,
    RIGHT,
    Multipliers,
    polynomial,
)
from lockedjoint.formulations.bounds.lever_cells.expansion import Expansion
from lockedjoint.formulations.bounds.lever_cells.remainders import ROOTS_REST
from lockedjoint.nlp.arrays import FloatArray


@dataclass(frozen=True)
class Forms(Cases):
    """Y and X of N cells in the middle, with what makes their second order, and errors.

    Attributes
    ----------
    expansion
        The expansion in the cells.
    middle
        (4 y + 2 x)/6 in the middle, y and x the least eigenvalues: after the share of the
        constant both matrices have this least eigenvalue, (N,).
    Y0, X0
        Y and X in the middle, (N,10,10) and (N,5,5).
    H, Hq
        The forms of (V̂, q), (N,16,16), and of q without n, (N,4,4).
    HT0
        H T₀, T₀ = diag(Bᵀ, I) from x to (V̂, q), (N,16,10).
    CHT0
        C times the rows of V̂ in H T₀, (N,6,10).
    phi, c
        The polynomial c·n − nᵀφn in the form of (1, q), (N,7,7) and (N,7).
    """

    expansion: Expansion
    middle: FloatArray
    Y0: FloatArray
    X0: FloatArray
    H: FloatArray
    Hq: FloatArray
    HT0: FloatArray
    CHT0: FloatArray
    phi: FloatArray
    c: FloatArray

    @classmethod
    def of(cls, expansion: Expansion, multipliers: Multipliers, limit: float) -> "Forms":
        """Return the forms of multipliers for arms with no lever arm above a limit."""
        cells = expansion.cells
        N, F, Bt = len(cells.F), cells.F, swap(cells.B)
        full = (multipliers.equations @ EQUATIONS.reshape(37, 256)).reshape(N, 16, 16)
        phi, c, c0 = polynomial(multipliers, limit)
        H = full.copy()
        H[:, 12:, 12:] = multipliers.shared
        Hq = full[:, 12:, 12:] - multipliers.shared
        HT0 = np.concatenate([H[:, :, :12] @ Bt, H[:, :, 12:]], 2)
        Y0 = np.concatenate([cells.B @ HT0[:, :12], HT0[:, 12:]], 1)
        X0 = np.zeros((N, 5, 5))
        X0[:, 0, 0] = multipliers.constant
        X0[:, 0, 1:] = X0[:, 1:, 0] = (F @ c[:, :, None])[:, :, 0] / 2
        X0[:, 1:, 1:] = Hq - F @ phi @ swap(F)
        constant = multipliers.equations @ RIGHT + multipliers.constant - c0
        y, x = np.linalg.eigvalsh(Y0)[:, 0], np.linalg.eigvalsh(X0)[:, 0]
        middle = (4 * y + 2 * x - constant) / 6
        # 4 of the one and 2 of the other share are the constant
        of_Y, of_X = (y - middle)[:, None, None], (x - middle)[:, None, None]
        HT0[:, :12, :6] -= of_Y * Bt
        HT0[:, 12:, 6:] -= of_Y * np.eye(4)
        return cls(
            expansion=expansion,
            middle=middle,
            Y0=Y0 - of_Y * np.eye(10),
            X0=X0 - of_X * np.eye(5),
            H=H - of_Y * np.eye(16),
            Hq=Hq - of_X * np.eye(4),
            HT0=HT0,
            CHT0=cells.C @ HT0[:, :12],
            phi=phi,
            c=c,
        )

    def scores(self) -> FloatArray:
        """Return how much each edge changes Y to first order, (N,6)."""
        Y1 = (self.expansion.normal_rows() @ self.CHT0).reshape(-1, 6, 6, 10)
        return np.asarray(np.sqrt((Y1 * Y1).sum((2, 3))))

    def second_order_Y(self) -> FloatArray:
        """Return the coefficients of 1, τ_k and τ_kτ_l, k ≤ l, in Y, (N,28,10,10)."""
        expansion, N = self.expansion, len(self.H)
        CHC = expansion.cells.C @ self.H[:, :12, :12] @ swap(expansion.cells.C)
        Z1 = expansion.normal_rows()
        ZHZ = (Z1 @ CHC @ swap(Z1)).reshape(N, 6, 6, 6, 6)
        half_KtK = 0.5 * expansion.KtK.reshape(N, 84, 4)
        half = np.zeros((N, 28, 10, 10))
        half[:, 1:7, :6] = (Z1 @ self.CHT0).reshape(N, 6, 6, 10)
        T2 = expansion.T2.reshape(N, 126, 12)
        half[:, 7:, :6] = (T2 @ self.HT0[:, :12]).reshape(N, 21, 6, 10)
        half[:, 7:, 6:] = (half_KtK @ self.HT0[:, 12:]).reshape(N, 21, 4, 10)
        half[:, 7:, :6, :6] += 0.5 * ZHZ[:, FIRST, :, SECOND].transpose(1, 0, 2, 3)
        return _whole(half, self.Y0)

    def second_order_X(self) -> FloatArray:
        """Return the coefficients of 1, τ_k and τ_kτ_l, k ≤ l, in X, (N,28,5,5)."""
        expansion, N = self.expansion, len(self.H)
        F12 = np.concatenate([expansion.F1, expansion.F2], 1).reshape(N, 108, 7)
        F1 = expansion.F1.reshape(N, 24, 7)
        FphiF = (F1 @ self.phi @ swap(F1)).reshape(N, 6, 4, 6, 4)
        half_KtK = 0.5 * expansion.KtK.reshape(N, 84, 4)
        half = np.zeros((N, 28, 5, 5))
        half[:, 1:, 1:, 0] = (F12 @ self.c[:, :, None] / 2).reshape(N, 27, 4)
        F_phi = expansion.cells.F @ self.phi
        half[:, 1:, 1:, 1:] = -(F12 @ swap(F_phi)).reshape(N, 27, 4, 4)
        half[:, 7:, 1:, 1:] -= 0.5 * FphiF[:, FIRST, :, SECOND].transpose(1, 0, 2, 3)
        half[:, 7:, 1:, 1:] += (half_KtK @ self.Hq).reshape(N, 21, 4, 4)
        return _whole(half, self.X0)

    def error_Y(self) -> FloatArray:
        """Return bounds of what Y has beyond the second order, (N,).

        Y = TᵀHT, T = T₀ + T₁ + T₂ + T₃ from x to (V̂, q), T₁ = C Z₁, ‖T₂‖ ≤ z2 + k²,
        ‖T₃‖ ≤ z3 + s3. Left out are T₀ᵀHT₃ and T₁ᵀHT₂, twice each, 2 T₁ᵀHT₃ and
        (T₂ + T₃)ᵀH(T₂ + T₃). In the first, T₃ = C Z₃ + …, Z₃ = −κ(K₃, B) − N₁ Z₂ + ….
        """
        expansion, rest = self.expansion, self.expansion.rest
        cells, N = expansion.cells, len(self.H)
        CH = cells.C @ self.H[:, :12]
        CHC = CH[:, :, :12] @ swap(cells.C)
        norm_H, norm_CHT0 = symmetric_size(self.H), size(self.CHT0)
        T0HC = swap(self.CHT0)
        by_kappa = (T0HC @ cells.kappa[:, :, :, :6].reshape(N, 6, 72)).reshape(N, 10, 12, 6)
        kappa = np.minimum(norm_CHT0 * cells.kappa_B, trilinear_size(by_kappa))
        by_N1 = np.minimum(norm_CHT0 * rest.n1, greatest(T0HC[:, None] @ expansion.N1))
        by_Z1 = np.minimum(symmetric_size(CHC) * rest.z1, greatest(CHC[:, None] @ expansion.Z1))
        second, third = rest.z2 + rest.k**2, rest.z3 + rest.s3
        T0HCZ3 = kappa * cells.off3 + by_N1 * rest.z2 + norm_CHT0 * rest.rest3
        T0HT3 = T0HCZ3 + size(self.HT0) * rest.s3
        T1HT2 = by_Z1 * rest.z2 + rest.z1 * size(CH) * rest.k**2
        T1HT3 = rest.z1 * norm_H * third
        return np.asarray(2 * (T0HT3 + T1HT2 + T1HT3) + norm_H * (second + third) ** 2)

    def error_X(self) -> FloatArray:
        """Return bounds of what X has beyond the second order, (N,).

        n = F'ᵀq', F' = F + F₁ + F₂ + F₃ with |F₃| ≤ |K₃|, as ‖W‖ = 1 = ‖F‖. Left out are F₃c/2,
        F φ F₃ᵀ twice, and (F' − F) φ (F' − F)ᵀ − F₁ φ F₁ᵀ; and of σ⁻¹ Hq σ⁻¹ half of
        KᵀK − K₁ᵀK₁ from either side and what the roots leave.
        """
        cells, rest = self.expansion.cells, self.expansion.rest
        norm_phi, norm_c = symmetric_size(self.phi), np.linalg.norm(self.c, axis=1)
        of_n = (norm_c / 2 + 2 * norm_phi) * cells.off3 + norm_phi * rest.cross
        of_q = symmetric_size(self.Hq) * (rest.cross + ROOTS_REST * rest.square**2)
        return np.asarray(of_n + of_q)


def _whole(half: FloatArray, middle: FloatArray) -> FloatArray:
    """Return half + halfᵀ, (N,28,n,n), pairs k < l twice, with the matrices in the middle."""
    whole = half + swap(half)
    whole[:, 7:] *= TWICE[:, None, None]
    whole[:, 0] = middle
    return np.asarray(whole)
