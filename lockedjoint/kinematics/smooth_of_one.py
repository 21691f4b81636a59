"""The smooth worst case of one configuration, for control loops: CasADi and LAPACK.

J is the Jacobian of the task's rows in units of ℓ, (m, n), see `scaled_chain`; j_f is column f
of it; w > 0 is the width, without a unit: s tends to the worst case σ as w tends to 0. With the
eigenvectors u_fi, i = 1 … m, of M_f = JJᵀ − j_f j_fᵀ, what the failure of joint f leaves, the
singular values σ_fi = |J_Fᵀ u_fi| and

    s = −w log Σ_fi exp(−σ_fi/w),      ∂s/∂J = Σ_fi p_fi/σ_fi u_fi u_fiᵀ J_F,

where p_fi = exp((s − σ_fi)/w) are shares, which add up to 1, and J_F is J with 0 for column f.
With all u_fi as columns of U, (m, mn), and J_Fᵀ u_fi as rows of R, (mn, n), which is UᵀJ with 0
in column f of the rows that belong to f,

    ∂s/∂J = U diag(p/σ) R.

From there to ∂s/∂q it is vector products of the motions' columns, as in `slope_of_columns`.

One function leads from q to J and all M_f, LAPACK decomposes these in place, and a second
function leads from there to s and ∂s/∂q. Small calls of NumPy in their place, and its `eigh`
with its checks and copies, would take twice as long.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import TypeAlias

import casadi as ca
import numpy as np

from lockedjoint.formulations.measures.worst_failure import FAR_FROM_SINGULAR, dsyev
from lockedjoint.kinematics.scaled_chain import ScaledChain
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.problem import Buffered

# The tuple holds s, shape (), and its gradient ∂s/∂q, shape (n,).
SmoothValue: TypeAlias = tuple[FloatArray, FloatArray]
# Eigenvalues below this, also negative ones, are rounding: their roots are taken of this.
_TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True, eq=False)
class SmoothParts:
    """The two functions of CasADi around the decomposition."""

    #: From q to the upper triangles of all M_f, each (m, m) by columns, J, and the columns
    #: (v; ω) of the k motions in metres and radians, (6, k).
    before: ca.Function
    #: From J, the motions' columns, U and w to (s, how far from singular), and ∂s/∂q. U has
    #: the eigenvectors of M_1, those of the least eigenvalue first, then those of M_2, and so
    #: on. If the second is not above 0, JJᵀ has lost the digits of s.
    after: ca.Function


def smooth_parts(arm: ScaledChain) -> SmoothParts:
    """Return the functions for an arm."""
    (m, n), q = arm.shape, arm.symbols()
    columns = ca.densify(arm.motion_columns(q))
    matrix = ca.densify(arm.matrix_of(columns))
    outer = matrix @ matrix.T
    # The list has M_f for each f; the decomposition reads its upper half alone.
    left = [outer - matrix[:, f] @ matrix[:, f].T for f in range(n)]
    halves = ca.vertcat(*(ca.vec(ca.densify(ca.triu(one))) for one in left))
    before = ca.Function("smooth_before", [q], [halves, matrix, columns])
    # Products of matrices are MX: as SX they are thousands of instructions.
    jacobian, moving = ca.MX.sym("J", m, n), ca.MX.sym("C", *columns.shape)
    vectors, width = ca.MX.sym("U", m, m * n), ca.MX.sym("w")
    # The matrix (mn, n) has 0 in column f of the m rows that belong to f, else 1.
    others = 1.0 - np.kron(np.eye(n), np.ones((m, 1)))
    rows = (vectors.T @ jacobian) * ca.DM(others)
    ratios, found = _shares(m, n)(ca.sum2(rows * rows), width)
    gradient = vectors @ (ca.horzcat(*[ratios] * n) * rows)
    given = [jacobian, moving, vectors, width]
    after = ca.Function("smooth_after", given, [found, _slope(arm)(moving, gradient)])
    return SmoothParts(before, after)


def _slope(arm: ScaledChain) -> ca.Function:
    """Return the function from the motions' columns, (6, k), and ∂s/∂J, (m, n), to ∂s/∂q, (n,).

    It is `slope_of_columns` of `worst_cases` in symbols, which says what force and moments are.
    """
    motions = arm.chain.motions
    columns, weights = ca.SX.sym("C", 6, len(motions)), ca.SX.sym("W", *arm.shape)
    driven = ca.gradient(ca.dot(arm.matrix_of(columns), weights), columns)
    # After the loop: sums of moments of the motions before each, and v_k·Σ f_j × ω_j, j ≤ k.
    force, turned, pushed = ca.SX.zeros(3), [ca.SX.zeros(3)], []
    for k in range(len(motions)):
        linear, angular = columns[:3, k], columns[3:, k]
        force = force + ca.cross(driven[:3, k], angular)
        moment = ca.cross(linear, driven[:3, k]) + ca.cross(angular, driven[3:, k])
        turned.append(turned[-1] + moment)
        pushed.append(ca.dot(linear, force))
    slope = ca.SX.zeros(arm.size)
    for k, motion in enumerate(motions):
        turn = -turned[k + 1] if arm.task.frame == "tip" else turned[-1] - turned[k + 1]
        slope[motion.variable] += motion.multiplier * (pushed[k] + ca.dot(columns[3:, k], turn))
    return ca.Function("smooth_slope", [columns, weights], [slope])


def _shares(m: int, n: int) -> ca.Function:
    """Return the function from all σ² and w to p/σ and (s, how far from singular).

    σ_fi² and p/σ are (mn, 1), f by f, the least first for each f.
    """
    values, width = ca.SX.sym("squares", m * n), ca.SX.sym("w")
    sigmas = ca.sqrt(ca.fmax(values, _TINY))
    smallest, largest = values[0], values[m - 1]
    for f in range(1, n):
        smallest = ca.fmin(smallest, values[m * f])
        largest = ca.fmax(largest, values[m * f + m - 1])
    # The least σ is taken off before, so that no exponential underflows in all terms.
    least = ca.sqrt(ca.fmax(smallest, _TINY))
    terms = ca.exp((least - sigmas) / width)
    total = ca.sum1(terms)
    value = least - width * ca.log(total)
    far = smallest - FAR_FROM_SINGULAR * largest
    ratios = terms / sigmas / total
    return ca.Function("smooth_shares", [values, width], [ratios, ca.vertcat(value, far)])


class SmoothOfOne:
    """s and ∂s/∂q of an arm at one configuration after the other."""

    def __init__(self, arm: ScaledChain) -> None:
        (m, n), parts = arm.shape, smooth_parts(arm)
        # The functions read and write these arrays in place: none may be replaced by another.
        self._q, self._width, self._found = np.zeros(n), np.zeros(1), np.zeros(2)
        left, self._slope = np.zeros((n, m, m)), np.zeros(n)
        jacobian, columns = np.zeros(m * n), np.zeros(6 * len(arm.chain.motions))
        found = (flat(left), jacobian, columns)
        self._before = Buffered(parts.before, {0: self._q}, dict(enumerate(found)))
        given = (jacobian, columns, flat(left), self._width)
        after = {0: self._found, 1: self._slope}
        self._after = Buffered(parts.after, dict(enumerate(given)), after)
        # The list has each M_f by columns, as LAPACK wants it, and so it is changed in place:
        # its eigenvectors are written over it, and `left` becomes U.
        self._left = [matrix.T for matrix in left]
        self._decomposed = dsyev()
        self._lock = threading.Lock()  # the arrays are one thread's at a time

    def __call__(self, point: FloatArray, width: float) -> SmoothValue | None:
        """Return s, shape (), and its gradient, shape (n,), at a point, shape (n,).

        None near singularity, or where a number is not finite: JJᵀ does not tell.
        """
        decomposed = self._decomposed
        with self._lock:
            self._q[:] = point
            self._width[0] = width
            self._before.run()
            for matrix in self._left:
                # Its arguments are: with vectors, of the upper half, in place.
                failed = decomposed(matrix, 1, 0, None, 1)[2]
                if failed:
                    return None
            self._after.run()
            value, far = self._found.tolist()
            return (np.asarray(value), self._slope.copy()) if far > 0 else None


def flat(array: FloatArray) -> FloatArray:
    """Return the same memory in one dimension."""
    return array.reshape(-1)


def smooth_of_one(arm: ScaledChain) -> SmoothOfOne:
    """Return what is made once for an arm, and kept with it.

    A cache would compare equal arms joint by joint, which takes longer than half of a call.
    """
    made: SmoothOfOne | None = arm.__dict__.get("_smooth_of_one")
    if made is None:
        made = arm.__dict__["_smooth_of_one"] = SmoothOfOne(arm)
    return made
