"""Max-min of an arm at many postures at once: its conditions and their derivatives.

The statement is that of `encodings.schur_complement`, with τ = log t as a variable::

    maximise   τ                                          over x = (q, τ), t = exp τ
    subject to c_f = 1 − g_f ≥ 0,  g_f = j_fᵀ P j_f,        for every joint f
               q − lower ≥ 0,  upper − q ≥ 0              where there are limits

with P = (JJᵀ − tI)⁻¹. If JJᵀ ≻ tI, then c_f ≥ 0 says that JJᵀ − j_f j_fᵀ ⪰ tI: the failure of
joint f leaves a least singular value of at least √t.

The letters: J is the Jacobian in the unit of the arm's `matrix`, m task rows by n joints, with
the columns j_f; q are the joints' positions, radians or (prismatic joints) metres. M = JJᵀ,
W = PJ has the columns w_f, λ_f is the multiplier of c_f, Λ = diag λ_f, ∂_a is ∂/∂q_a, and ⟨·,·⟩
is the sum of products of entries. Then ::

    ∂_a P = −P ∂_aM P,    ∂_aM = ∂_aJ Jᵀ + J ∂_aJᵀ,    r_fa = ∂_a j_f − ∂_aM w_f = P⁻¹ ∂_a w_f
    ∂_a g_f = 2 w_fᵀ ∂_a j_f − w_fᵀ ∂_aM w_f
    Σ λ_f ∂_ab g_f = 2 Σ λ_f (r_faᵀ P r_fb − e_faᵀ e_fb) + ⟨Y, ∂_ab J⟩,
        e_fa = ∂_aJᵀ w_f,    Y = 2 (WΛ − WΛWᵀJ)

The level t is one more direction, number n, in which M − tI changes by −I: r_ft = w_f,
∂_t g_f = w_fᵀ w_f, e_ft = 0, and J does not depend on it. Finally ∂_τ = t ∂_t. J and its
derivatives are CasADi's, the rest is NumPy.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.many_points import AtManyPoints

# Least eigenvalue of JJᵀ − tI above which it counts as positive definite; nearer to 0 its
# inverse is rounding.
_POSITIVE = 1e-9


class MaxMinValues:
    """The p conditions c of an arm: those of n joints, then the finite lower and upper limits.

    Parameters
    ----------
    arm
        The arm, with n joints.

    Attributes
    ----------
    size
        Number of variables, n + 1.
    lower, upper
        Limits of the joints, shape (n,), radians or metres; infinite where there is none.
    """

    def __init__(self, arm: RobotArm) -> None:
        self._m, self._n = arm.shape
        self.size = self._n + 1
        q, weights = arm.symbols(), ca.SX.sym("Y", *arm.shape)  # the Y of the header
        matrix = ca.densify(arm.matrix(q))
        slopes = ca.densify(ca.jacobian(ca.vec(matrix), q))
        second = ca.densify(ca.hessian(ca.dot(weights, matrix), q)[0])
        self._matrix = AtManyPoints(ca.Function("matrix", [q], [matrix]))
        # J and ∂ vec(J)/∂q, shape (m·n, n): vec stacks the columns of J.
        self._slopes = AtManyPoints(ca.Function("slopes", [q], [matrix, slopes]))
        # ⟨Y, ∂_ab J⟩, shape (n, n).
        self._second = AtManyPoints(ca.Function("second", [q, ca.vec(weights)], [second]))
        self.lower, self.upper = arm.bounds
        self._limits = np.isfinite(self.lower), np.isfinite(self.upper)
        unit = np.eye(self._n, self.size)
        sides = unit[self._limits[0]], -unit[self._limits[1]]
        self._slopes_of_limits = np.concatenate(sides)

    def slacks(self, x: FloatArray) -> FloatArray:
        """Return all c, shape (B, p), at x, shape (B, n + 1); c_f = −∞ unless JJᵀ ≻ tI."""
        q, level = x[:, :-1], np.exp(x[:, -1])
        matrix = self._matrix(q)[0]  # J, shape (B, m, n)
        gram = matrix @ matrix.transpose(0, 2, 1) - level[:, None, None] * np.eye(self._m)
        gram = np.nan_to_num(gram, nan=0.0, posinf=0.0, neginf=0.0)
        regular = np.linalg.eigvalsh(gram)[:, 0] > _POSITIVE
        gram[~regular] = np.eye(self._m)  # any matrix that can be inverted
        rows = np.sum(matrix * np.linalg.solve(gram, matrix), axis=1)  # g_f, shape (B, n)
        rows[~regular] = np.inf
        return np.concatenate([1.0 - rows, *self._from_limits(q)], axis=1)

    def _from_limits(self, q: FloatArray) -> list[FloatArray]:
        """Return q − lower and upper − q at the finite limits, shape (B, limits) each."""
        low, high = self._limits
        return [(q - self.lower)[:, low], (self.upper - q)[:, high]]

    def derivatives(
        self, x: FloatArray, multipliers: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return ∂c/∂x, shape (B, p, n + 1), and −Σ y ∂²c/∂x², shape (B, n + 1, n + 1).

        At x, shape (B, n + 1), with the multipliers y of all conditions, shape (B, p). JJᵀ ≻ tI
        is assumed. Indices in comments: a, b directions, f joints that fail.
        """
        m, n = self._m, self._n
        q, level = x[:, :-1], np.exp(x[:, -1])
        weights = multipliers[:, :n]  # λ, shape (B, f): limits are linear, and do not curve
        matrix, slopes = self._slopes(q)
        turned = matrix.transpose(0, 2, 1)
        # ∂_aJᵀ, shape (B, a, n, m): CasADi's rows are the entries of J, column by column.
        moved = slopes.transpose(0, 2, 1).reshape(-1, n, n, m)
        inverse = np.linalg.inv(matrix @ turned - level[:, None, None] * np.eye(m))  # P
        solved = inverse @ matrix  # W, shape (B, m, f)
        along = moved @ solved[:, None]  # e_fa, shape (B, a, n, f)
        changed = moved.transpose(0, 1, 3, 2) @ (turned @ solved)[:, None]
        changed += matrix[:, None] @ along  # ∂_aM w_f, shape (B, a, m, f)
        rest = np.empty((len(q), n + 1, m, n))  # r_fa, shape (B, a, m, f), a = n for t
        rest[:, :n] = moved.transpose(0, 1, 3, 2) - changed
        rest[:, n] = solved
        rows = np.empty((len(q), n + 1, n))  # ∂_a g_f, shape (B, a, f)
        # The first derivative is wᵀ(2 ∂j − ∂M w) = wᵀ(r + ∂j).
        both = rest[:, :n] + moved.transpose(0, 1, 3, 2)
        rows[:, :n] = np.sum(solved[:, None] * both, axis=2)
        rows[:, n] = np.sum(solved**2, axis=1)

        def summed(one: FloatArray, other: FloatArray) -> FloatArray:
            """Return Σ λ_f one_faᵀ other_fb, shape (B, a, b)."""
            weighted = one * weights[:, None, None, :]
            flat = (len(one), one.shape[1], -1)
            return np.asarray(weighted.reshape(flat) @ other.reshape(flat).transpose(0, 2, 1))

        # Σ λ_f ∂_ab g_f, shape (B, a, b), without and then with the term of ∂_ab J.
        curved = 2 * summed(rest, inverse[:, None] @ rest)
        curved[:, :n, :n] -= 2 * summed(along, along)
        weighted = solved * weights[:, None, :]
        pull = 2 * (weighted - weighted @ solved.transpose(0, 2, 1) @ matrix)  # Y
        by_column = pull.transpose(0, 2, 1).reshape(-1, m * n)
        curved[:, :n, :n] += self._second(q, by_column)[0]
        # The level's direction becomes τ: ∂_τ = t ∂_t, and ∂_ττ = t² ∂_tt + t ∂_t.
        rows[:, n] *= level[:, None]
        curved[:, n] *= level[:, None]
        curved[:, :, n] *= level[:, None]
        curved[:, n, n] += np.sum(weights * rows[:, n], axis=1)
        limits = np.broadcast_to(
            self._slopes_of_limits, (len(q), *self._slopes_of_limits.shape)
        )
        return np.concatenate([-rows.transpose(0, 2, 1), limits], axis=1), curved
