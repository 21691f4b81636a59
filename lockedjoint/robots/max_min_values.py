"""Max-min of an arm at many postures at once: how far it is from its limits, with derivatives.

The statement is that of `encodings.schur_complement`, with τ = log t as a variable::

    maximise   τ                                          over x = (q, τ), t = exp τ
    subject to c_f = 1 − j_fᵀ (JJᵀ − tI)⁻¹ j_f ≥ 0         for every joint f
               q − lower ≥ 0,  upper − q ≥ 0              where there are limits

With P = (JJᵀ − tI)⁻¹, W = PJ with the columns w_f, g_f = j_fᵀ w_f, and ∂_a for ∂/∂q_a::

    ∂_a P = −P ∂_aM P,    ∂_aM = ∂_aJ Jᵀ + J ∂_aJᵀ,    r_fa = ∂_a j_f − ∂_aM w_f = P⁻¹ ∂_a w_f
    ∂_a g_f = 2 w_fᵀ ∂_a j_f − w_fᵀ ∂_aM w_f
    Σ λ_f ∂_ab g_f = 2 Σ λ_f (r_faᵀ P r_fb − e_faᵀ e_fb) + ⟨Y, ∂_ab J⟩,
        e_fa = ∂_aJᵀ w_f,    Y = 2 (WΛ − WΛWᵀJ)

The level is one more direction, with ∂_t M = −I: r_ft = w_f, ∂_t g_f = w_fᵀ w_f, and no other
terms; ∂_τ = t ∂_t. J and its derivatives are CasADi's, the rest is NumPy.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.many_points import AtManyPoints

# JJᵀ − tI is positive definite if its least eigenvalue is above this.
_POSITIVE = 1e-9


class MaxMinValues:
    """The conditions of an arm, p of them: those of n joints, then lower and upper limits.

    Attributes
    ----------
    size
        Number of variables, n + 1.
    """

    def __init__(self, arm: RobotArm) -> None:
        self._m, self._n = arm.shape
        self.size = self._n + 1
        q, weights = arm.symbols(), ca.SX.sym("Y", *arm.shape)
        matrix = ca.densify(arm.matrix(q))
        slopes = ca.densify(ca.jacobian(ca.vec(matrix), q))
        second = ca.densify(ca.hessian(ca.dot(weights, matrix), q)[0])
        self._matrix = AtManyPoints(ca.Function("matrix", [q], [matrix]))
        self._slopes = AtManyPoints(ca.Function("slopes", [q], [matrix, slopes]))
        self._second = AtManyPoints(ca.Function("second", [q, ca.vec(weights)], [second]))
        self.lower, self.upper = arm.bounds
        self._limits = np.isfinite(self.lower), np.isfinite(self.upper)
        unit = np.eye(self._n, self.size)
        sides = unit[self._limits[0]], -unit[self._limits[1]]
        self._slopes_of_limits = np.concatenate(sides)

    def slacks(self, x: FloatArray) -> FloatArray:
        """Return all c, shape (B, p), at x, shape (B, n + 1); −∞ unless JJᵀ ≻ tI."""
        q, level = x[:, :-1], np.exp(x[:, -1])
        matrix = self._matrix(q)[0]
        gram = matrix @ matrix.transpose(0, 2, 1) - level[:, None, None] * np.eye(self._m)
        gram = np.nan_to_num(gram, nan=0.0, posinf=0.0, neginf=0.0)
        regular = np.linalg.eigvalsh(gram)[:, 0] > _POSITIVE
        gram[~regular] = np.eye(self._m)
        rows = np.sum(matrix * np.linalg.solve(gram, matrix), axis=1)
        rows[~regular] = np.inf
        return np.concatenate([1.0 - rows, *self._from_limits(q)], axis=1)

    def _from_limits(self, q: FloatArray) -> list[FloatArray]:
        low, high = self._limits
        return [(q - self.lower)[:, low], (self.upper - q)[:, high]]

    def derivatives(
        self, x: FloatArray, multipliers: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return ∂c/∂x, shape (B, p, n + 1), and −Σ y ∂²c/∂x², shape (B, n + 1, n + 1).

        At x, shape (B, n + 1), with multipliers y, shape (B, p).
        """
        m, n = self._m, self._n
        q, level = x[:, :-1], np.exp(x[:, -1])
        weights = multipliers[:, :n]
        matrix, slopes = self._slopes(q)
        turned = matrix.transpose(0, 2, 1)
        # ∂_aJᵀ, shape (B, a, n, m): CasADi's rows are the entries of J, column by column.
        moved = slopes.transpose(0, 2, 1).reshape(-1, n, n, m)
        inverse = np.linalg.inv(matrix @ turned - level[:, None, None] * np.eye(m))
        solved = inverse @ matrix
        along = moved @ solved[:, None]  # e_fa, shape (B, a, n, f)
        changed = moved.transpose(0, 1, 3, 2) @ (turned @ solved)[:, None]
        changed += matrix[:, None] @ along  # ∂_aM w_f, shape (B, a, m, f)
        rest = np.empty((len(q), n + 1, m, n))
        rest[:, :n] = moved.transpose(0, 1, 3, 2) - changed
        rest[:, n] = solved
        rows = np.empty((len(q), n + 1, n))
        # wᵀ(2 ∂j − ∂M w) = wᵀ(r + ∂j)
        both = rest[:, :n] + moved.transpose(0, 1, 3, 2)
        rows[:, :n] = np.sum(solved[:, None] * both, axis=2)
        rows[:, n] = np.sum(solved**2, axis=1)

        def summed(one: FloatArray, other: FloatArray) -> FloatArray:
            """Return Σ λ_f one_faᵀ other_fb, shape (B, a, b)."""
            weighted = one * weights[:, None, None, :]
            flat = (len(one), one.shape[1], -1)
            return np.asarray(weighted.reshape(flat) @ other.reshape(flat).transpose(0, 2, 1))

        curved = 2 * summed(rest, inverse[:, None] @ rest)
        curved[:, :n, :n] -= 2 * summed(along, along)
        weighted = solved * weights[:, None, :]
        pull = 2 * (weighted - weighted @ solved.transpose(0, 2, 1) @ matrix)
        by_column = pull.transpose(0, 2, 1).reshape(-1, m * n)
        curved[:, :n, :n] += self._second(q, by_column)[0]
        # In τ: ∂_τ = t ∂_t, and the second derivative has t ∂_t besides.
        rows[:, n] *= level[:, None]
        curved[:, n] *= level[:, None]
        curved[:, :, n] *= level[:, None]
        curved[:, n, n] += np.sum(weights * rows[:, n], axis=1)
        limits = np.broadcast_to(
            self._slopes_of_limits, (len(q), *self._slopes_of_limits.shape)
        )
        return np.concatenate([-rows.transpose(0, 2, 1), limits], axis=1), curved
