"""What an entry of the atlas asks for as a least level, and the slopes of levels by J.

Letters: J (m, n), k joints that lock, F a set of k joints, M_F = J_F̄J_F̄ᵀ (m, m) with the
eigenvalues λ_i(F), w a width of smoothing. The logarithm of what is asked for is the least over
F of::

    max-min, isotropy   ℓ_F = ½ log λ_min(F)
    condition           ℓ_F = ½ log λ_min(F) − ½ log λ_max(F)
    manipulability      ℓ_F = ½ log det M_F − ½ log det JJᵀ

Smoothed, the least of x_1, x_2, … is −w log Σ exp(−x_i/w), with the slopes exp(−x_i/w)/Σ; the
largest is likewise. As w goes to 0 it is the least itself.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from lockedjoint.formulations import condition, manipulability
from lockedjoint.formulations.atlas.entry import Entry
from lockedjoint.nlp.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Levels:
    """The levels ℓ_F of an entry's formulation, for some sets F.

    Attributes
    ----------
    formulation
        Name of the entry's formulation, which says what ℓ_F is.
    kept
        Which joints each set F leaves: 1 or 0, shape (sets, n).
    """

    formulation: str
    kept: FloatArray

    @classmethod
    def of(cls, entry: Entry) -> "Levels":
        """Return the levels of all sets of an entry."""
        sets = list(combinations(range(entry.joints), entry.failures))
        kept = np.ones((len(sets), entry.joints))
        for row, locked in zip(kept, sets, strict=True):
            row[list(locked)] = 0.0
        return cls(entry.formulation, kept)

    def lowest(self, jacobian: FloatArray, count: int) -> "Levels":
        """Return the levels of the `count` sets that are the least at a Jacobian."""
        return Levels(self.formulation, self.kept[np.argsort(self.values(jacobian))[:count]])

    def values(self, jacobian: FloatArray) -> FloatArray:
        """Return ℓ_F, shape (sets,)."""
        return self.with_weights(jacobian)[0]

    def least(self, jacobian: FloatArray) -> float:
        """Return the least ℓ_F."""
        return float(np.min(self.values(jacobian)))

    def slopes(self, jacobian: FloatArray) -> FloatArray:
        """Return ∂ℓ_F/∂J, shape (sets, m·n), J's entries column after column."""
        return self.slopes_of(jacobian, self.with_weights(jacobian)[1])

    def slopes_of(self, jacobian: FloatArray, by_gram: FloatArray) -> FloatArray:
        """Return ∂ℓ_F/∂J as `slopes` does, from what `with_weights` returned for J."""
        change = 2 * self.kept[:, :, None] * (by_gram @ jacobian).transpose(0, 2, 1)
        if self.formulation == manipulability.NAME:
            change -= np.linalg.solve(jacobian @ jacobian.T, jacobian).T
        return np.asarray(change.reshape(len(change), -1))

    def smoothed(self, jacobian: FloatArray, width: float) -> tuple[float, FloatArray]:
        """Return the smoothed least level, and its slopes by J, shape (m, n)."""
        m, n = jacobian.shape
        values, by_gram = self.with_weights(jacobian, width)
        shares, least = smoothed_least(values[None, :], width)
        # Column j has slopes from all sets that leave it: Σ_F share_F ∂ℓ_F/∂M_F, (n, m, m).
        by_joint = (shares.T * self.kept).T @ by_gram.reshape(-1, m * m)
        change = 2 * (by_joint.reshape(n, m, m) @ jacobian.T[:, :, None])[:, :, 0].T
        if self.formulation == manipulability.NAME:
            change -= np.linalg.solve(jacobian @ jacobian.T, jacobian)
        return float(least[0]), np.asarray(change)

    def with_weights(
        self, jacobian: FloatArray, width: float = 0.0
    ) -> tuple[FloatArray, FloatArray]:
        """Return ℓ_F, (sets,), and ∂ℓ_F/∂M_F, (sets, m, m), without the part of det JJᵀ."""
        left = self.kept[:, None, :] * jacobian
        values, vectors = np.linalg.eigh(left @ left.transpose(0, 2, 1))
        values = np.maximum(values, np.finfo(float).tiny)
        logs = np.log(values)
        if self.formulation == manipulability.NAME:
            weights = np.ones_like(logs)
            levels = np.sum(logs, axis=1) - np.linalg.slogdet(jacobian @ jacobian.T)[1]
        else:
            weights, levels = smoothed_least(logs, width)
        if self.formulation == condition.NAME:
            of_largest, minus_largest = smoothed_least(-logs, width)
            weights, levels = weights - of_largest, levels + minus_largest
        by_gram = (vectors * (0.5 * weights / values)[:, None, :]) @ vectors.transpose(0, 2, 1)
        return 0.5 * levels, by_gram


def smoothed_least(values: FloatArray, width: float) -> tuple[FloatArray, FloatArray]:
    """Return the slopes of each row's smoothed least, (rows, p), and its value, (rows,).

    `values` have the shape (rows, p). With width 0 it is the least itself.
    """
    lowest = np.min(values, axis=1)
    if width == 0.0:
        return np.eye(values.shape[1])[np.argmin(values, axis=1)], lowest
    shares = np.exp((lowest[:, None] - values) / width)
    total = np.sum(shares, axis=1)
    return shares / total[:, None], lowest - width * np.log(total)
