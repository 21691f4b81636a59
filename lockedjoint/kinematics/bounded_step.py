"""One step of damped least squares that knows the limits of the joints.

A joint at its limit that is pushed outwards cannot follow. If it stays in the Jacobian and the
step is cut off at the limit, the other joints do too little, and the iteration creeps or ends
beside the goal. So such a joint is taken out of the Jacobian before the step is computed. This
is decided anew at each step: the joint is put back as soon as the step turns inwards.
"""

from __future__ import annotations

import numpy as np

from lockedjoint.kinematics.geometry import BoolArray
from lockedjoint.nlp.arrays import FloatArray

# A joint that is this near to its limit is at it: rounding. A larger one stops joints early.
_AT_LIMIT_M_OR_RAD = 1e-12
# A squared pivot of Cholesky's factor is at least this, so that its root is no divisor of 0.
# A larger one shortens the steps near singular configurations.
_LEAST_SQUARED_PIVOT = 1e-14


def bounded_step(
    matrix: FloatArray,
    missing: FloatArray,
    damping: FloatArray,
    q: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    drift: FloatArray | None = None,
) -> FloatArray:
    """Return the move of each joint towards what is missing, shape (n, B).

    A joint at its limit does not move outwards. Others may: the caller shortens the move and
    stops it at the limits.

    Parameters
    ----------
    matrix
        Jacobians, shape (m, n, B).
    missing
        What is missing to the targets, e, shape (m, B).
    damping
        λ of the step Jᵀ(JJᵀ + λ)⁻¹e, shape (B,).
    q, lower, upper
        Where the joints are, and their limits, shape (n, B) each: infinite where there are
        none, equal where a joint is locked.
    drift
        A move that the joints make besides, as far as the target allows it, shape (n, B).
    """
    at_lower = q <= lower + _AT_LIMIT_M_OR_RAD
    at_upper = q >= upper - _AT_LIMIT_M_OR_RAD
    # Jᵀe is the direction in which each joint alone would lessen |e|².
    push = np.einsum("mnb,mb->nb", matrix, missing)
    if drift is not None:
        push = push + drift
    free = ~(at_lower & at_upper) & ~_outwards(push, at_lower, at_upper)
    move = _move(matrix, missing, damping, free, drift)
    # Some joints are pushed inwards, but the step that serves all rows moves them outwards.
    out = free & _outwards(move, at_lower, at_upper)
    again = np.flatnonzero(out.any(axis=0))
    if again.size:
        parts = (matrix[:, :, again], missing[:, again], damping[again])
        rest = free[:, again] & ~out[:, again]
        own = None if drift is None else drift[:, again]
        move[:, again] = _move(*parts, rest, own)
        still_out = _outwards(move[:, again], at_lower[:, again], at_upper[:, again])
        move[:, again] = np.where(still_out, 0.0, move[:, again])
    return move


def least_squares(matrix: FloatArray, missing: FloatArray, damping: FloatArray) -> FloatArray:
    """Return Jᵀ(JJᵀ + λ)⁻¹e for each of many, shape (n, B), from J, e and λ as above.

    JJᵀ + λ = LLᵀ (Cholesky), Ly = e, Lᵀx = y, and the result is Jᵀx. Each entry of L is an
    array (B,), so that NumPy works on all configurations at once: m is at most 6, B is large.
    """
    rows = len(matrix)
    # The factor is L by lines; right holds e, then y, then x.
    factor: list[list[FloatArray]] = []
    right: list[FloatArray] = []
    for i in range(rows):
        line: list[FloatArray] = []
        for j in range(i + 1):
            entry = np.einsum("nb,nb->b", matrix[i], matrix[j])
            if i == j:
                entry += damping
            for k in range(j):
                entry -= line[k] * (factor[j][k] if j < i else line[k])
            line.append(
                np.sqrt(np.maximum(entry, _LEAST_SQUARED_PIVOT))
                if i == j
                else entry / factor[j][j]
            )
        factor.append(line)
        value = missing[i].copy()
        for k in range(i):
            value -= line[k] * right[k]
        right.append(value / line[i])
    for i in reversed(range(rows)):
        for k in range(i + 1, rows):
            right[i] = right[i] - factor[k][i] * right[k]
        right[i] = right[i] / factor[i][i]
    return np.asarray(np.einsum("inb,ib->nb", matrix, np.stack(right)))


def _outwards(move: FloatArray, at_lower: BoolArray, at_upper: BoolArray) -> BoolArray:
    """Return which moves (n, B) lead out of a limit that the joint is at, (n, B)."""
    return np.asarray((at_lower & (move < 0)) | (at_upper & (move > 0)))


def _move(
    matrix: FloatArray,
    missing: FloatArray,
    damping: FloatArray,
    free: BoolArray,
    drift: FloatArray | None,
) -> FloatArray:
    """Return the move of the joints that are free, (n, B); the others stay.

    With a drift d it is d + J⁺(e − Jd), J⁺ the damped inverse: it still serves the target.
    """
    if drift is None:
        return least_squares(matrix * free, missing, damping)
    own = drift * free
    beside = missing - np.einsum("mnb,nb->mb", matrix, own)
    return own + least_squares(matrix * free, beside, damping)
