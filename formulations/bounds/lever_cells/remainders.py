"""What the second order leaves out: bounds of norms over a cell, with the inequality of each.

Names are those of `expansion`; |K − K₁| ≤ off and |K₃| ≤ off3 hold in the cell. Everything is a
bound of a greatest singular value, of maps between coordinates of length |·| too.
"""

from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.cases import Cases
from lockedjoint.formulations.bounds.lever_cells.cells import Cells
from lockedjoint.formulations.bounds.lever_cells.corners import greatest, greatest_pairs
from lockedjoint.nlp.arrays import FloatArray

#: Bounds ‖N‖ from which on (I + N)⁻¹ is not used.
_MOST = 0.9
#: Addition to the right side of the equation of Z₃, for the deviations that `boxes` allows.
ROUNDING = 1e-9
#: |ρ⁻¹V'σ⁻¹ − V' − ½(KKᵀV' + V'KᵀK)| ≤ this ‖K‖⁴|V'|. With D = ρ⁻¹ and E = σ⁻¹ it is
#: |½D²V' − DV'E + ½V'E²|, the same for D − m and E − m; these have norms ≤ ‖K‖²/4 for the m in
#: the middle of their eigenvalues, which makes ⅛ ‖K‖⁴|V'|, so that ½ is more than enough.
ROOTS_REST = 0.5


@dataclass(frozen=True)
class Remainders(Cases):
    """Bounds over each of N cells, all (N,).

    Attributes
    ----------
    k
        ‖K₁‖.
    square
        ‖K‖²: ‖K‖ ≤ ‖K₁‖ + |K − K₁|, and ‖K₁‖ ≤ |K₁|.
    cross
        |K M K − K₁ M K₁|, ‖M‖ ≤ 1, and with transposes: K − K₁ is in one factor or in both,
        so it is at most 2 ‖K₁‖ off + off².
    z1, z2, n1
        ‖Z₁‖, ‖Z₂‖, ‖N₁‖.
    z3
        ‖Z₃‖, Z₃ = Z − Z₁ − Z₂. From (I + N) Z = −L,
        (I + N) Z₃ = −κ(K₃, B) − ΔD2 + (N − N₁) L₁ − N Z₂, with ΔD2 = D2(K, K; B) −
        D2(K₁, K₁; B), |ΔD2| ≤ cross; and ‖(I + N)⁻¹‖ ≤ 1/(1 − ‖N‖).
    rest3
        ‖Z₃ + κ(K₃, B) + N₁ Z₂‖ = ‖−ΔD2 + (N − N₁) L₁ − (N − N₁) Z₂ − N Z₃‖.
    s3
        What V̂ has beyond (B + CZ + S₂) y, S₂ y = ½(K₁K₁ᵀBy + By K₁ᵀK₁), for |y| = 1: ½ cross
        from either side, ‖K‖² ‖Z‖ of C Z y, and ROOTS_REST ‖K‖⁴ ‖B + C Z‖ from the roots. It
        bounds what q has beyond q' + ½K₁ᵀK₁q' too: ½ cross + ROOTS_REST ‖K‖⁴.
    theta
        Below (|y|² + |q'|²)/4, as |V̂|² = 3, |q| = 1, |V'| ≥ |V̂|/(1 + ‖K‖²), |q'|² ≥ |q|²/(1 +
        ‖K‖²) and |V'|² = |y|² + |Z y|². It is at most 1, and |y| ≤ |V'| ≤ |V̂|, |q'| ≤ |q|.
    """

    k: FloatArray
    square: FloatArray
    cross: FloatArray
    z1: FloatArray
    z2: FloatArray
    n1: FloatArray
    z3: FloatArray
    rest3: FloatArray
    s3: FloatArray
    theta: FloatArray


def remainders(
    cells: Cells, Z1: FloatArray, Z2: FloatArray, N1: FloatArray, N2: FloatArray
) -> Remainders:
    """Return the bounds in cells, from Z and N by edge (N,6,6,6) and by pair (N,21,6,6)."""
    k, z1, n1 = greatest(cells.edges()), greatest(Z1), greatest(N1)
    z2, n2 = greatest_pairs(Z2), greatest_pairs(N2)
    off, off3 = cells.off, cells.off3
    square = np.minimum(k + off, cells.longest() + off) ** 2
    cross = 2 * k * off + off**2
    with np.errstate(all="ignore"):
        # N − N₁ − N₂ = κ(K₃, C) + D2(K, K; C) − D2(K₁, K₁; C)
        later = n2 + cells.kappa_C * off3 + cross
        n = n1 + later
        right = cells.kappa_B * off3 + cross + later * z1 + n * z2 + ROUNDING
        z3 = np.where(n < _MOST, right / (1 - n), np.inf)
        z = z1 + z2 + z3
        return Remainders(
            k=k,
            square=square,
            cross=cross,
            z1=z1,
            z2=z2,
            n1=n1,
            z3=z3,
            rest3=cross + later * (z1 + z2) + n * z3 + ROUNDING,
            s3=cross + square * z + ROOTS_REST * square**2 * (1 + z),
            theta=1 / ((1 + square) ** 2 * (1 + z**2)),
        )
