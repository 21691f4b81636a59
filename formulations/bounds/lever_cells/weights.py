"""Weights of half spaces for many boxes at a time, by the simplex method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.corners import BoolArray, IntArray, swap
from lockedjoint.nlp.arrays import FloatArray

#: Pivots at most.
PIVOTS = 40
#: Reduced costs above minus this count as 0.
COST = 1e-7
#: Entries of a column at most this large are no pivots.
PIVOT = 1e-9
#: Least sum of weights: it is 1, but for programs that rounding has spoiled.
TINY = 1e-300
#: Row of a tableau with the sum of λ, below those of six absolute values.
SUM = 6
#: Row with the reduced costs.
COSTS = 7
_SIX = np.arange(6)


@dataclass
class _Tableaus:
    """N tableaus (N,8,n+15), and the number of the variable that is basic in each row (N,7).

    Variables: λ (n), μ₊, μ₋, p (6), q (6), all ≥ 0, where p − q = Σ λ_i a_i + μ r and the cost
    is Σ p + Σ q − Σ λ_i m_i − μ r0. The last column is the right side.
    """

    rows: FloatArray
    basic: IntArray

    def take(self, which: BoolArray) -> _Tableaus:
        return _Tableaus(self.rows[which], self.basic[which])


def combinations(
    m: FloatArray, a: FloatArray, r0: FloatArray, r: FloatArray, pivots: int = PIVOTS
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Maximise Σ λ_i m_i + μ r0 − Σ_k |Σ λ_i a_ik + μ r_k| over λ ≥ 0, Σ λ_i = 1, and any μ.

    This is the greatest lower bound, by a combination, over the cube |τ_k| ≤ 1 of functions
    m_i + Σ τ_k a_ik and r0 + Σ τ_k r_k. If pivots run out, weights are feasible but not the
    best.

    Parameters
    ----------
    m, a : values and slopes, (N,n) and (N,n,6).
    r0, r : value and slopes of the function with a weight of any sign, (N,) and (N,6).
    pivots : pivots at most.

    Returns
    -------
    λ (N,n), μ (N,) and the value that is reached (N,).
    """
    n = m.shape[1]
    tableaus = _start(m, a, r0, r)
    rows, basic = tableaus.rows.copy(), tableaus.basic.copy()
    active = np.arange(len(m))
    for _ in range(pivots):
        enter, leave, go = _choice(tableaus)
        rows[active[~go]], basic[active[~go]] = tableaus.rows[~go], tableaus.basic[~go]
        active, tableaus = active[go], tableaus.take(go)
        if not len(active):
            break
        _pivot(tableaus, enter[go], leave[go])
    rows[active], basic[active] = tableaus.rows, tableaus.basic
    found = np.zeros((len(m), rows.shape[2]))
    np.put_along_axis(found, basic, np.maximum(rows[:, :COSTS, -1], 0), 1)
    lam, mu = found[:, :n], found[:, n] - found[:, n + 1]
    return lam / np.maximum(lam.sum(1, keepdims=True), TINY), mu, rows[:, COSTS, -1]


def _start(m: FloatArray, a: FloatArray, r0: FloatArray, r: FloatArray) -> _Tableaus:
    """Return tableaus in which λ of the greatest m is 1, with p or q for its slopes."""
    N, n = m.shape
    rows = np.zeros((N, 8, n + 15))
    rows[:, :6, :n] = -swap(a)
    rows[:, :6, n], rows[:, :6, n + 1] = -r, r
    rows[:, _SIX, n + 2 + _SIX], rows[:, _SIX, n + 8 + _SIX] = 1, -1
    rows[:, SUM, :n] = rows[:, SUM, -1] = 1
    cost = np.zeros((N, n + 15))
    cost[:, :n], cost[:, n], cost[:, n + 1] = -m, -r0, r0
    cost[:, n + 2 : n + 14] = 1
    first = m.argmax(1)
    each = np.arange(N)
    rows[:, :6] -= rows[each, :6, first][:, :, None] * rows[:, SUM : SUM + 1]
    negative = rows[:, :6, -1] < 0
    rows[:, :6] = np.where(negative[:, :, None], -rows[:, :6], rows[:, :6])
    basic = np.concatenate([n + 2 + _SIX + 6 * negative, first[:, None]], 1)
    of_basic = np.take_along_axis(cost, basic, 1)
    rows[:, COSTS] = cost - np.einsum("nk,nkc->nc", of_basic, rows[:, :COSTS])
    return _Tableaus(rows, basic)


def _choice(t: _Tableaus) -> tuple[IntArray, IntArray, BoolArray]:
    """Return which variable enters, which row it takes, and whether that gains anything."""
    each = np.arange(len(t.rows))
    costs = t.rows[:, COSTS, :-1]
    enter = costs.argmin(1)
    column = t.rows[each, :COSTS, enter]
    with np.errstate(all="ignore"):
        ratio = np.where(column > PIVOT, t.rows[:, :COSTS, -1] / column, np.inf)
    leave = ratio.argmin(1)
    return enter, leave, (costs[each, enter] < -COST) & np.isfinite(ratio[each, leave])


def _pivot(t: _Tableaus, enter: IntArray, leave: IntArray) -> None:
    """Make the variables `enter` basic in the rows `leave`."""
    each = np.arange(len(t.rows))
    pivot = t.rows[each, leave] / t.rows[each, leave, enter][:, None]
    t.rows -= t.rows[each, :, enter][:, :, None] * pivot[:, None, :]
    t.rows[each, leave] = pivot
    t.basic[each, leave] = enter
