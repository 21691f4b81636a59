"""What rotations and reflections of the frame leave of a solver's multipliers.

What comes in: matrices of shape (m, m) in the rows of J, and the conditions of the joints. What
goes out: means over all frames, under which these conditions are the same. A mean is a multiple
of a unit matrix, or a few of them, so that rounding it costs only an amount of second order.
J has m rows; a condition ⟨A, jjᵀ⟩ = b or ≤ b is one on each column j, with a matrix A, (m, m).
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lockedjoint.formulations.joints.gram_conditions import GramCondition
from lockedjoint.formulations.joints.parts import Parts
from lockedjoint.nlp.arrays import FloatArray

#: Number of rows of a spatial Jacobian: linear rows first, then as many rotational ones.
SPATIAL_ROWS = 6


@dataclass(frozen=True)
class FrameSymmetry:
    """What rotations and reflections of the frame leave of matrices, on average.

    Spatial columns are (v; ω): v has the linear rows and ω the rotational ones. A mean over all
    frames consists of multiples of 3×3 unit matrices then: one for v with v, one for ω with ω
    and one for v with ω. In other task spaces it is one multiple of the unit matrix.

    Attributes
    ----------
    complete
        Whether the conditions of all joints are the same in all frames.
    parts_apart
        Whether they also are if v alone changes its sign: the multiple for v with ω is 0.
    """

    complete: bool = False
    parts_apart: bool = False

    @classmethod
    def of(cls, parts: Parts) -> FrameSymmetry:
        """Return the symmetries of the conditions of all joints."""
        conditions = [one for kind in parts.kinds for one in kind.conditions]
        matrices = [np.array(one.matrix) for one in conditions]
        complete = all(np.array_equal(x, _turned_mean(x, cross=True)) for x in matrices)
        # A condition with the limit 0, such as v·ω = 0, holds with either sign of v.
        parts_apart = complete and all(
            (one.equal and one.limit == 0) or np.array_equal(x, _turned_mean(x, cross=False))
            for one, x in zip(conditions, matrices, strict=True)
        )
        return cls(complete=complete, parts_apart=parts_apart)

    def mean(self, matrix: FloatArray) -> FloatArray:
        """Return the mean of a matrix over all frames; itself if conditions depend on these."""
        return _turned_mean(matrix, cross=not self.parts_apart) if self.complete else matrix

    def weight(self, condition: GramCondition, value: float) -> Fraction:
        """Return the mean of the multiplier λ = `value`; at least 0 for an inequality.

        The mean is 0 where v → −v changes the condition and keeps all others.
        """
        matrix = np.array(condition.matrix)
        if self.parts_apart and not np.array_equal(matrix, _turned_mean(matrix, cross=False)):
            return Fraction(0)
        return Fraction(value if condition.equal else max(value, 0.0))


def _turned_mean(matrix: FloatArray, cross: bool) -> FloatArray:
    """Return the mean of a matrix over all frames, shape (m, m).

    It has multiples of unit matrices with the same traces, see `FrameSymmetry`. Of spatial rows
    these are four, of which those for v with ω are 0 without `cross`.
    """
    size = len(matrix)
    if size != SPATIAL_ROWS:
        return np.asarray(np.trace(matrix) / size * np.eye(size))
    # Axes of `quarters`: (v or ω, its row, v or ω, its column). Shape of `means`: (2, 2).
    quarters = matrix.reshape(2, 3, 2, 3)
    means = quarters.trace(axis1=1, axis2=3) / 3
    means = 0.5 * (means + means.T)
    kept = means if cross else np.diag(np.diag(means))
    return np.asarray(np.kron(kept, np.eye(3)))
