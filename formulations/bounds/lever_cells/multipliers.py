"""The multipliers of cells: their semidefinite programs by a barrier method, many at a time.

Newton's method makes −weight·s − Σ log (eigenvalues, inequalities, ball) least while the weight
of s grows. The multipliers are the dual of the last point. They need no proof: `certificates`
tests what they exclude.
"""

from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.cases import Cases
from lockedjoint.formulations.bounds.lever_cells.corners import BoolArray, swap
from lockedjoint.formulations.bounds.lever_cells.equations import Multipliers
from lockedjoint.formulations.bounds.lever_cells.expansion import Expansion
from lockedjoint.formulations.bounds.lever_cells.programs import (
    COLUMN,
    IN_Y,
    ROW,
    SCALE,
    SHARED,
    UNKNOWNS,
    X_CHANGES,
    Programs,
    S,
    matrices_X,
    matrices_Y,
)
from lockedjoint.nlp.arrays import FloatArray

#: Weight of s at the start.
_WEIGHT = 300.0
#: Factor from one weight to the next.
_GROWTH = 3.0
#: Duality gap at the end, as a part of −s.
_SHARE = 0.8
#: Steps of Newton's method at most.
_STEPS = 40
#: Steps along each line.
_LINE_STEPS = 5
#: Newton decrement below which the weight grows, and a program with s > 0 is given up.
_NEAR = 0.5
#: Newton decrement below which a program may end.
_END = 0.02
#: Newton decrement below which a step is taken in full.
_FULL = 0.3
#: Part of the way to the boundary that a step may go.
_INSIDE = 0.98
#: A step where the boundary is nowhere.
_FAR = 1e3
#: Number of logarithms: 10 + 5 eigenvalues, 35 inequalities, the ball twice.
_LOGARITHMS = 52
#: Places in a 10×10 matrix (entries one after another) of P_ik P_jl + P_il P_jk, for entries
#: (i, j) and (k, l) of Y.
_IK = (10 * ROW[:, None] + ROW).ravel()
_JL = (10 * COLUMN[:, None] + COLUMN).ravel()
_IL = (10 * ROW[:, None] + COLUMN).ravel()
_JK = (10 * COLUMN[:, None] + ROW).ravel()
#: Factors of these in the Hessian.
_FACTORS = (SCALE[:, None] * SCALE / 2).ravel()


def multipliers(expansion: Expansion, limit: float) -> tuple[BoolArray, Multipliers]:
    """Return multipliers of cells, and for which of them the program ended with s < 0.

    Parameters
    ----------
    expansion
        The cells, all of them `ok`.
    limit
        Greatest lever arm A of arms that should not exist.
    """
    programs = Programs.of(expansion, limit)
    x = programs.start()
    N = len(x)
    weight = np.full(N, _WEIGHT)
    found = np.zeros(N, bool)
    left = np.flatnonzero(programs.at(x).ball > 0)
    for _ in range(_STEPS):
        if not len(left):
            break
        newton = _newton(programs.take(left), x[left], weight[left])
        decrement, s, gap = newton.decrement, x[left, S], _LOGARITHMS / weight[left]
        exact = (s + gap < 0) & (gap < _SHARE * -s)
        over = (decrement < _END) & exact
        hopeless = ((decrement < _NEAR) & (s > 0)) | ~np.isfinite(decrement)
        found[left[over]] = True
        go = ~(over | hopeless)
        x[left[go]] += (newton.length[:, None] * newton.step)[go]
        weight[left[go & (decrement < _NEAR) & ~exact]] *= _GROWTH
        left = left[go]
    return found, programs.dual(x, weight)


@dataclass(frozen=True)
class _Newton(Cases):
    """A step of Newton's method (N,60), its decrement and how much of it to take, (N,)."""

    step: FloatArray
    decrement: FloatArray
    length: FloatArray


def _newton(programs: Programs, x: FloatArray, weight: FloatArray) -> _Newton:
    """Return the step at points x for weights of s."""
    N = len(x)
    point = programs.at(x)
    root_Y, root_X = _inverse_root(point.Y), _inverse_root(point.X)
    # the gradient of −log ball
    ball = 2 * (swap(programs.equations) @ point.residual[:, :, None])[:, :, 0]
    ball /= point.ball[:, None]
    of_X = (swap(root_X)[:, None] @ X_CHANGES @ root_X[:, None]).reshape(N, 15, 25)
    of_inequalities = programs.slopes / point.inequalities[:, :, None]
    inverse_Y = root_Y @ swap(root_Y)

    hessian = _hessian_of_Y(inverse_Y)
    hessian[:, :IN_Y, :IN_Y] += (2 / point.ball)[:, None, None] * programs.squares
    hessian[:, :IN_Y, :IN_Y] += ball[:, :, None] * ball[:, None, :]
    shared = of_X @ swap(of_X) + swap(of_inequalities) @ of_inequalities
    hessian[:, SHARED[:, None], SHARED] += shared

    gradient = np.zeros((N, UNKNOWNS))
    gradient[:, :IN_Y] = -inverse_Y[:, ROW, COLUMN] * SCALE - ball
    gradient[:, S] = np.trace(inverse_Y, axis1=1, axis2=2) - weight
    # every sixth of 25 entries is on the diagonal
    gradient[:, SHARED] -= of_X[:, :, ::6].sum(2) + of_inequalities.sum(1)

    step = np.asarray(-np.linalg.solve(hessian, gradient[:, :, None])[:, :, 0], np.float64)
    decrement = np.sqrt(np.maximum(-(gradient * step).sum(1), 0.0))
    rates = (
        np.linalg.eigvalsh(swap(root_Y) @ matrices_Y(step) @ root_Y),
        np.linalg.eigvalsh(swap(root_X) @ matrices_X(step) @ root_X),
        (of_inequalities @ step[:, SHARED, None])[:, :, 0],
    )
    change = (programs.equations @ step[:, :IN_Y, None])[:, :, 0]
    ball_first = (ball * step[:, :IN_Y]).sum(1)
    ball_second = -(change * change).sum(1) / point.ball
    length = _line(weight * step[:, S], np.concatenate(rates, 1), ball_first, ball_second)
    return _Newton(step, decrement, np.where(decrement < _FULL, 1.0, length))


def _inverse_root(matrices: FloatArray) -> FloatArray:
    """Return R with R Rᵀ the inverses of positive matrices."""
    values, vectors = np.linalg.eigh(matrices)
    return np.asarray(vectors / np.sqrt(values)[:, None])


def _hessian_of_Y(inverse: FloatArray) -> FloatArray:
    """Return the Hessian (N,60,60) of −log det(Y − s), from the inverse of Y − s."""
    N = len(inverse)
    flat = inverse.reshape(N, 100)
    products = flat[:, _IK] * flat[:, _JL] + flat[:, _IL] * flat[:, _JK]
    square = inverse @ inverse
    hessian = np.zeros((N, UNKNOWNS, UNKNOWNS))
    hessian[:, :IN_Y, :IN_Y] = (products * _FACTORS).reshape(N, IN_Y, IN_Y)
    hessian[:, S, :IN_Y] = hessian[:, :IN_Y, S] = -square[:, ROW, COLUMN] * SCALE
    hessian[:, S, S] = np.trace(square, axis1=1, axis2=2)
    return hessian


def _line(
    gain: FloatArray, rates: FloatArray, ball_first: FloatArray, ball_second: FloatArray
) -> FloatArray:
    """Return lengths α that make the barrier function least along steps, (N,).

    It is −gain α − Σ log(1 + α rate) − log(1 + ball_first α + ball_second α²).
    """
    lowest = rates.min(1)
    discriminant = np.maximum(ball_first * ball_first - 4 * ball_second, 0.0)
    root = (-ball_first - np.sqrt(discriminant)) / (2 * ball_second)
    root = np.where(root > 0, root, np.inf)
    most = _INSIDE * np.minimum(np.where(lowest < 0, -1 / lowest, _FAR), root)
    length = np.minimum(1.0, 0.5 * most)
    for _ in range(_LINE_STEPS):
        scaled = rates / (1 + length[:, None] * rates)
        ball = 1 + ball_first * length + ball_second * length * length
        change = (ball_first + 2 * ball_second * length) / ball
        slope = -gain - scaled.sum(1) - change
        bend = (scaled * scaled).sum(1) - 2 * ball_second / ball + change * change
        length = np.clip(length - slope / bend, 0.2 * length, 0.5 * (length + most))
    return np.asarray(length)
