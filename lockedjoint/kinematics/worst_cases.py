"""The worst case of an arm and its gradient at many configurations, or fast at one.

The worst case σ(q) is the least σ_min of J with one column left out (eq. 5). ∂σ/∂J is that of
`measures`; from there to ∂σ/∂q it is cross products of columns of J for many configurations,
in NumPy, and CasADi's differentiation for one.

Letters of this file::

    m, n    rows of the task, and joints: variables q, in radians or metres.
    k       motions of the chain, at least n: a joint that others follow has several.
    B       configurations at once: the last axis in this file, in `measures` the first.
    J       the Jacobian of the task's rows in units of ℓ, (m, n, B).
    (v; ω)  a motion's column: velocity of the tip and angular velocity, metres and radians.
    ℓ       the characteristic length in metres, given or of each configuration:
            ℓ² = Σ|v|²/Σ|ω|² over the revolute joints, see `ScaledChain`.
    W       weights of the entries of J, here ∂σ/∂J, (m, n, B).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple, TypeAlias

import casadi as ca
import numpy as np

from lockedjoint.formulations import measures
from lockedjoint.formulations.measures.smooth_worst_case import (
    checked_width,
    smooth_near_singularity,
)
from lockedjoint.formulations.measures.worst_failure import worst_case_of_one
from lockedjoint.kinematics.geometry import crosses
from lockedjoint.kinematics.scaled_chain import ScaledChain
from lockedjoint.kinematics.smooth_of_one import smooth_of_one
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.problem import Evaluation

# A value is raised: it maps Jacobians (N, m, n) to values (N,) and slopes ∂/∂J (N, m, n).
Value: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
# So many configurations are evaluated at once: their arrays stay in the processor's cache. The
# results are the same with any number.
_CONFIGURATIONS_AT_ONCE = 1024
# Divisors that may be 0 have this added, or are at least this: bounds are then infinite or
# useless, and no error is raised.
_TINY = 1e-300
# A float from this to the next number is a right width, as `checked_width` has it. Others are
# left to that function, whose error says what is wrong: calling it takes longer than comparing.
_LEAST_WIDTH = 1e-6
# A float that is larger is left to `checked_width`.
_LARGEST_WIDTH = 1e6
# The functions of so many arms are kept: with fewer, they are made again more often.
_CACHED_ARMS = 64


def worst_cases(arm: ScaledChain, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return σ (eq. 5) and its gradient at many points, shape (N, n), or fast at one, (n,).

    Shapes are (N,) and (N, n); for one point () and (n,).
    """
    if points.ndim == 1 and math.isfinite(points @ points):
        of_one = _single_functions(arm)
        matrix, bounds = of_one.bounded(points)
        sigma, left, right = worst_case_of_one(matrix, bounds)
        # ∂σ/∂J = uvᵀ with the singular vectors u and v, row by row.
        weights = (left[:, None] * right).ravel()
        return np.asarray(sigma), of_one.slope(np.concatenate((points, weights)))[0][:, 0]
    return _at(arm, points, _worst)


def smooth_worst_cases(
    arm: ScaledChain, points: FloatArray, width: float
) -> tuple[FloatArray, FloatArray]:
    """Return the smooth worst case and its gradient at points, shape (N, n) or (n,).

    The width w has no unit; `smooth_of_one` has the formula. Shapes are those of `worst_cases`.
    """
    if points.ndim == 1:
        if type(width) is not float or not _LEAST_WIDTH <= width <= _LARGEST_WIDTH:
            width = checked_width(width)
        quick = smooth_of_one(arm)(points, width)
        if quick is not None:
            return quick
        if math.isfinite(points @ points):
            return smooth_from_jacobian(arm, points, width)

    def smooth(jacobians: FloatArray) -> tuple[FloatArray, FloatArray]:
        found = measures.smooth_worst_case_batch(jacobians, width)
        return found.value, found.gradient

    return _at(arm, points, smooth)


def smooth_from_jacobian(
    arm: ScaledChain, point: FloatArray, width: float
) -> tuple[FloatArray, FloatArray]:
    """Return the same at one finite point, (n,), near singularity too: without JJᵀ."""
    of_one = _single_functions(arm)
    value, weights = smooth_near_singularity(of_one.jacobian(point)[0][None], width)
    return value[0], of_one.slope(np.concatenate((point, weights.ravel())))[0][:, 0]


def _at(arm: ScaledChain, points: FloatArray, value: Value) -> tuple[FloatArray, FloatArray]:
    """Return a value of J, (N,) or (), and its gradient, at points, shape (N, n) or (n,)."""
    if points.ndim == 1:
        values, gradients = _at(arm, points[None], value)
        return values[0], gradients[0]
    values, gradients = np.empty(len(points)), np.empty(points.shape)
    for first in range(0, len(points), _CONFIGURATIONS_AT_ONCE):
        part = slice(first, first + _CONFIGURATIONS_AT_ONCE)
        columns, orientation = arm.chain.motion_columns(np.ascontiguousarray(points[part].T))
        if arm.task.frame == "tip":
            # Rᵀ turns v and ω from the axes of the base to those of the tip.
            turned = columns.reshape(len(columns), 2, 3, -1)
            columns = np.einsum("ijb,khib->khjb", orientation, turned).reshape(columns.shape)
        with np.errstate(divide="ignore", invalid="ignore"):  # no length: J is refused
            scaled = _Scaled(arm, columns)
        jacobians = np.ascontiguousarray(scaled.jacobian.transpose(2, 0, 1))
        values[part], slopes = value(jacobians)
        gradients[part] = scaled.slope(slopes.transpose(1, 2, 0)).T
    return values, gradients


class _Scaled:
    """The task's rows of J in units of ℓ, from the columns of the motions, (k, 6, B).

    Columns are along the axes of the task's frame, in metres and radians.
    """

    def __init__(self, arm: ScaledChain, columns: FloatArray) -> None:
        self._arm, self._columns = arm, columns
        # Prismatic joints, (n,); speeds, (n, 1, 1); columns by joint, (n, 6, B), and those of
        # the revolute joints; Σ|ω|² and ℓ, (1, B); all rows in units of ℓ, (n, 6, B).
        self._slides = np.array(arm.chain.prismatic)
        self._speeds = arm.chain.speeds[:, None, None]
        metric = np.zeros((arm.size, *columns.shape[1:]))
        for motion, column in zip(arm.chain.motions, columns, strict=True):
            metric[motion.variable] += motion.multiplier * column
        self._metric = metric
        self._turns = metric[~self._slides]
        self._angular = _total(self._turns[:, 3:] ** 2)
        self._length: float | FloatArray = arm.length or 1.0
        if arm.follows_configuration:
            self._length = (_total(self._turns[:, :3] ** 2) / self._angular) ** 0.5
        self._all = self._in_units(metric)

    def _in_units(self, metric: FloatArray) -> FloatArray:
        """Return columns by joint, (n, 6, B), scaled as J is.

        Linear rows are divided by ℓ, columns of slides multiplied by ℓ, all by their speeds.
        With ℓ held, this is its own transpose: it takes ∂/∂J back to ∂/∂(v; ω), too.
        """
        scaled = metric * self._speeds
        scaled[~self._slides, :3] /= self._length
        scaled[self._slides, 3:] *= self._length
        return scaled

    @property
    def jacobian(self) -> FloatArray:
        """J, shape (m, n, B)."""
        return self._all[:, self._arm.task.rows].swapaxes(0, 1)

    def slope(self, weights: FloatArray) -> FloatArray:
        """Return ∂(Σ W_ij J_ij)/∂q, shape (n, B), of W with shape (m, n, B)."""
        arm, turns = self._arm, ~self._slides
        full = np.zeros_like(self._all)
        full[:, arm.task.rows] = weights.swapaxes(0, 1)
        direct = self._in_units(full)
        if arm.follows_configuration:
            # ∂/∂ℓ is gained − lost: rows v/ℓ lose −v/ℓ² of revolute joints, and columns of
            # slides gain ω. With A = Σ|ω|², ∂ℓ/∂v = v/(ℓA) and ∂ℓ/∂ω = −ℓω/A.
            lost = _total((full * self._all)[turns, :3]) / self._length
            gained = _total((full * self._speeds * self._metric)[self._slides, 3:])
            by_length = (gained - lost) / self._angular  # (∂/∂ℓ)/A
            direct[turns, :3] += by_length / self._length * self._turns[:, :3]
            direct[turns, 3:] -= by_length * self._length * self._turns[:, 3:]
        motions = arm.chain.motions
        driven = np.stack([motion.multiplier * direct[motion.variable] for motion in motions])
        each = slope_of_columns(self._columns, driven, arm.task.frame == "tip")
        result = np.zeros((arm.size, each.shape[1]))
        for motion, one in zip(motions, each, strict=True):
            result[motion.variable] += motion.multiplier * one
        return result


def _worst(jacobians: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return σ, (N,), and ∂σ/∂J, (N, m, n), of Jacobians (N, m, n)."""
    worst = measures.worst_case_sigma_batch(jacobians)
    return worst.sigma, worst.gradient


def _total(entries: FloatArray) -> FloatArray:
    """Return the sum over the first two axes, shape (1, B)."""
    return np.asarray(entries.sum(axis=0).sum(axis=0, keepdims=True))


def slope_of_columns(
    columns: FloatArray, weights: FloatArray, tip_frame: bool = False
) -> FloatArray:
    """Return ∂/∂q_i of Σ_j w_j·c_j, c_j = (v_j; ω_j) the columns of a serial chain.

    From the columns alone, in O(k): motion i turns v_j and ω_j of the later ones as ω_i × v_j
    and ω_i × ω_j, and moves the tip of the earlier ones, which changes v_j by ω_j × v_i.
    Columns and weights have shape (k, 6, B), one for each motion, along the axes of the base,
    or of the tip, which turn, too; the slope has shape (k, B).
    """
    # With w_j = (f_j; g_j), Σ f_j·(ω_j × v_i) over j ≤ i is v_i·Σ (f_j × ω_j), the force; and
    # Σ f_j·(ω_i × v_j) + g_j·(ω_i × ω_j) over j > i is ω_i·Σ (v_j × f_j + ω_j × g_j), the
    # moments. Axes of the tip turn with it: what was the sum over j > i is −Σ over j ≤ i.
    linear, angular = columns[:, :3], columns[:, 3:]
    force = np.cumsum(crosses(weights[:, :3], angular), axis=0)
    moment = crosses(linear, weights[:, :3]) + crosses(angular, weights[:, 3:])
    turned = np.cumsum(moment, axis=0)
    turned = -turned if tip_frame else turned[-1:] - turned
    return np.asarray(np.sum(linear * force + angular * turned, axis=1))


def _bounds_of_failures(matrix: ca.SX) -> ca.SX:
    """Return bounds of 1/λ, λ the least eigenvalue of M_f = JJᵀ − jjᵀ, as rows, (2, n).

    The matrix is J, (m, n), in symbols; j is its column f. The first row has lower bounds, the
    second upper ones.

    M_f⁻¹ = K + wwᵀ/(1 − jᵀw), K = (JJᵀ)⁻¹, w = Kj (Sherman and Morrison). In axes of which w is
    the first, it is [[c, bᵀ], [b, D]], whose largest eigenvalue is at least c and at most that
    of [[c, |b|], [|b|, |D|]].
    """
    m, n = matrix.shape
    factor = ca.chol(matrix @ matrix.T)
    solved = ca.solve(factor, ca.solve(factor.T, ca.horzcat(matrix, ca.SX.eye(m))))
    moved, inverse = solved[:, :n], solved[:, n:]  # all w, (m, n), and K
    again = inverse @ moved
    size = ca.sum1(moved * moved) + _TINY
    along = ca.sum1(moved * again) / size
    least = along + size / ca.fmax(1 - ca.sum1(matrix * moved), _TINY)  # c
    across = ca.sum1(again * again) / size - along**2  # |b|²
    rest = ca.sqrt(ca.fmax(ca.sumsqr(inverse) - along**2 - 2 * across, 0))  # |D| or more
    most = (least + rest + ca.sqrt((least - rest) ** 2 + 4 * ca.fmax(across, 0))) / 2
    return ca.vertcat(least, most)


class _OfOne(NamedTuple):
    """Functions of one configuration, (n,)."""

    jacobian: Evaluation  #: From q to J, (m, n).
    bounded: Evaluation  #: From q to J and the bounds of its failures, (2, n).
    slope: Evaluation  #: From q and W, row by row, (n + mn,), to ∂(Σ W_ij J_ij)/∂q, (n, 1).


@lru_cache(maxsize=_CACHED_ARMS)
def _single_functions(arm: ScaledChain) -> _OfOne:
    """Return the functions of an arm, which are made once."""
    q, weights = arm.symbols(), ca.SX.sym("W", *arm.shape)
    matrix, flat = arm.matrix(q), ca.vec(weights.T)  # as NumPy's ravel
    slope = ca.gradient(ca.dot(matrix, weights), q)
    return _OfOne(
        Evaluation(q, [matrix]),
        Evaluation(q, [matrix, _bounds_of_failures(matrix)]),
        Evaluation(ca.vertcat(q, flat), [slope]),
    )
