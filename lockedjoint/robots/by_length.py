"""How the worst case of one configuration depends on the characteristic length ℓ.

A Jacobian has linear rows in metres and angular rows in radians. With all lengths in units of ℓ
its entry (i, k) is proportional to ℓ to a power: −1 in linear rows, +1 more in the columns of
prismatic joints. So the Jacobian in metres is computed once, and the Jacobians for all lengths
and failures are one stack of matrices.

After failure F, M_F = J_F J_Fᵀ is left of JJᵀ. With the Jacobian in metres it is N_F + ℓ²P_F,
N_F of the revolute joints and P_F of the prismatic ones, and its linear rows and columns are
then divided by ℓ: N_F and P_F are computed once. Its eigenvector u of the least eigenvalue
gives σ = ‖uᵀJ_F‖, eq. (5), which is right to the square of the error of u.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lockedjoint.formulations import measures
from lockedjoint.formulations.measures.worst_failure import FAR_FROM_SINGULAR
from lockedjoint.kinematics.geometry import IntArray
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.robots.best_length import Point, highest

# Number of matrices, one for each length and failure, decomposed together: bounds the memory.
_MATRICES_AT_ONCE = 10_000
# Decades of lengths searched on either side of the present one.
_DECADES = 2.0
# Percentage of the bound up to which nothing is left, but for rounding.
_NOTHING_PERCENT = 1e-9
# Squares of σ below this, 0 too, are divided by as if they were this.
_TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class AtLength:
    """The worst case of a configuration at one characteristic length."""

    length: float  #: ℓ in metres.
    worst_case_sigma: float  #: σ, eq. (5), of J in units of ℓ.
    percent_of_bound: float  #: σ in percent of the bound (6) at the same ‖J‖_F.
    worst_case_joints: tuple[str, ...]  #: Names of the joints that lock in the worst failure.


class LengthScale:
    """A configuration of an arm at any characteristic length.

    Parameters
    ----------
    arm
        The robot and its task.
    metric
        The Jacobian (v; ω) in metres and radians, shape (6, n), as `RobotArm.metric_jacobian`.
    failures
        How many joints lock at once, k.
    """

    def __init__(self, arm: RobotArm, metric: FloatArray, failures: int) -> None:
        self._names, self._shape = arm.chain.names, arm.shape
        rows = arm.task.rows
        self._metric = (metric * arm.chain.speeds)[rows]
        # Entry (i, j) of J in units of ℓ is that in metres times ℓ to the power of row i plus
        # that of column j: (m,), (n,) and the sum, (m, n).
        self._of_rows = np.array([-1.0 if row < 3 else 0.0 for row in rows])
        self._of_columns = np.array(arm.chain.prismatic, dtype=float)
        self._powers = self._of_rows[:, None] + self._of_columns
        # Sums of the squares of the entries of each power −1, 0, 1.
        entries = self._metric**2
        self._traces = [float(entries[self._powers == power].sum()) for power in (-1, 0, 1)]
        # The sets of k joints that may lock, the joints that each leaves, (failures, n − k),
        # and 1 for these, 0 for those that lock, (failures, n).
        self._sets = measures.locked_sets(self._metric, failures)
        self._left, self._kept = joints_left(self._sets, len(self._names))
        self._full_rank = self._left.shape[1] >= self._shape[0]
        # N_F, (failures, m, m), and P_F, None without prismatic joints.
        slides = any(arm.chain.prismatic)
        self._turning = self._squares(1.0 - self._of_columns)
        self._sliding = self._squares(self._of_columns) if slides else None
        # The bound (6) for ‖J‖_F = 1: it is proportional to ‖J‖_F.
        self._bound = measures.sigma_bound(*self._shape, 1.0)

    def _squares(self, columns: FloatArray) -> FloatArray:
        """Return the parts of all M_F, in metres, that are of the columns with 1, not 0."""
        return (self._metric * (self._kept * columns)[:, None]) @ self._metric.T

    def at(self, lengths: FloatArray) -> tuple[AtLength, ...]:
        """Return the worst case at lengths in metres, shape (k,)."""
        return tuple(one for part in self._parts(lengths) for one in self._at(part))

    def _parts(self, lengths: FloatArray) -> list[FloatArray]:
        """Return lengths, shape (k,), in parts that are few enough for the memory."""
        size = max(1, _MATRICES_AT_ONCE // len(self._sets))
        return [lengths[k : k + size] for k in range(0, len(lengths), size)]

    def _at(self, lengths: FloatArray) -> list[AtLength]:
        """Return the worst case at lengths, of the singular values of J_F itself."""
        stack = self._metric * lengths[:, None, None] ** self._powers
        sigmas: FloatArray = np.zeros((len(stack), len(self._sets)))
        if self._full_rank:
            left = stack[:, :, self._left].transpose(0, 2, 1, 3)
            sigmas = np.asarray(np.linalg.svd(left, compute_uv=False)[..., -1], dtype=float)
        found = []
        for length, matrix, after in zip(lengths.tolist(), stack, sigmas, strict=True):
            worst, norm = int(np.argmin(after)), float(np.linalg.norm(matrix))
            found.append(self._named(length, float(after[worst]), norm, worst))
        return found

    def _named(self, length: float, sigma: float, norm: float, failure: int) -> AtLength:
        joints = tuple(self._names[k] for k in self._sets[failure])
        return AtLength(length, sigma, percent(sigma, self._bound * norm), joints)

    def around(self, lengths: FloatArray) -> tuple[tuple[AtLength, ...], AtLength | None]:
        """Return the worst case at lengths, and at that with the largest percentage.

        The lengths, in metres, shape (k,), ascend. The best one is sought up to two decades
        from the one in their middle; None if no length gives more than 0.
        """
        if not self._full_rank:
            return self.at(lengths), None
        parts = self._parts(np.log(lengths))
        points = [point for part in parts for point in self._points(part)]
        shown = tuple(map(self._of, points, lengths.tolist()))
        middle, reach = points[len(points) // 2].log_length, _DECADES * math.log(10.0)
        best = highest(points, middle - reach, middle + reach, self._point)
        found = self._of(best, math.exp(best.log_length))
        return shown, found if found.percent_of_bound > _NOTHING_PERCENT else None

    def _of(self, point: Point, length: float) -> AtLength:
        """Return the worst case at the length of a point."""
        if point.sure:
            return self._named(length, point.sigma, point.norm, point.failure)
        return self._at(np.array([length]))[0]

    def _point(self, log_length: float) -> Point:
        return self._points(np.array([log_length]))[0]

    def _points(self, log_lengths: FloatArray) -> list[Point]:
        """Return height and slope at log ℓ of shape (k,).

        Let J′ = ∂J/∂ log ℓ. With σ² = ‖uᵀJ_F‖² the slope of the height, log(σ/‖J‖_F), is
        uᵀJ′_F J_Fᵀu/σ² − ⟨J, J′⟩/‖J‖_F²: u itself moves only in second order.
        """
        square = np.exp(2 * log_lengths)  # ℓ²
        scales = np.exp(log_lengths[:, None] * self._of_rows)  # of the rows, (k, m)
        left = self._turning
        if self._sliding is not None:
            left = left + self._sliding * square[:, None, None, None]
        values, vectors = np.linalg.eigh(left * (scales[:, :, None] * scales[:, None])[:, None])
        each, worst = np.arange(len(values)), values[:, :, 0].argmin(axis=1)
        values, weakest = values[each, worst], vectors[each, worst, :, 0] * scales
        # uᵀJ_F, (k, n), and what the powers of the rows make of it in J′.
        kept = self._kept[worst]
        if self._sliding is not None:
            kept = kept * np.exp(log_lengths[:, None] * self._of_columns)
        moved = weakest @ self._metric * kept
        rates = (weakest * self._of_rows) @ self._metric * kept + moved * self._of_columns
        sigmas = (moved * moved).sum(axis=1)
        slopes = (rates * moved).sum(axis=1) / np.maximum(sigmas, _TINY)
        divided, same, multiplied = self._traces
        lost, gained = divided / square, multiplied * square
        traces = lost + same + gained
        arrays = (
            log_lengths,
            slopes - (gained - lost) / traces,
            worst,
            np.sqrt(sigmas),
            np.sqrt(traces),
            values[:, 0] > FAR_FROM_SINGULAR * values[:, -1],
        )
        return [Point(*row) for row in zip(*(one.tolist() for one in arrays), strict=True)]


def joints_left(sets: list[tuple[int, ...]], joints: int) -> tuple[IntArray, FloatArray]:
    """Return the joints that each set of k locked ones leaves, as numbers and as a mask.

    Shapes are (failures, n − k), and (failures, n) with 0 for joints that lock, else 1; n is
    `joints`. The arrays are shared between calls, and cannot be written to.
    """
    return _joints_left(tuple(sets), joints)


@lru_cache(maxsize=64)
def _joints_left(sets: tuple[tuple[int, ...], ...], joints: int) -> tuple[IntArray, FloatArray]:
    left = np.array([np.delete(np.arange(joints), locked) for locked in sets])
    kept = np.zeros((len(sets), joints))
    np.put_along_axis(kept, left, 1.0, axis=1)
    left.flags.writeable = kept.flags.writeable = False
    return left, kept


def percent(sigma: float, best: float) -> float:
    """Return a singular value in percent of the best one; 0 if the best is 0."""
    return 100.0 * sigma / best if best > 0 else 0.0
