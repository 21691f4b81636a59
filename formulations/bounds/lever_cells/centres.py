"""Centres: unit tight frames with weights, and the pairs (centre, order) near one of them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations.bounds.lever_cells.charts import Chart, tight_chart
from lockedjoint.formulations.bounds.lever_cells.corners import BoolArray, IntArray
from lockedjoint.nlp.arrays import FloatArray

#: All orders of seven columns, 5040×7.
ORDERS = np.array(list(itertools.permutations(range(7))))
#: Rows of the places in the upper triangle of a 7×7 matrix, 21.
ROWS = np.triu_indices(7, 1)[0]
#: Columns of these places.
COLS = np.triu_indices(7, 1)[1]
#: What the diagonals add to tr P P' of tight frames: 7 (3/7)².
DIAGONAL = 9.0 / 7.0
#: Squared distance 3 − tr P P' below which a pair is the centre itself.
SAME = 1e-5
#: Distance, in radii of the centre, beyond which pairs are left out.
REACH = 2.1
#: Number of centres that room is made for at a time.
ROOM = 50


def upper(matrices: FloatArray) -> FloatArray:
    """Return the upper triangles (…,21), without diagonals, of matrices (…,7,7)."""
    return np.asarray(matrices[..., ROWS, COLS])


def projection(chart: Chart) -> FloatArray:
    """Return P = WᵀW of a centre, (7,7)."""
    return np.asarray(chart.W.T @ chart.W)


@dataclass(frozen=True)
class HalfSpaces:
    """Half spaces tr P X_i + d_i > 0: frames nearer to (centre, order) i than to a centre c.

    Attributes
    ----------
    X : P_i − P_c, (M,7,7); zero on the diagonal.
    d : g_i − g_c, (M,).
    other : the number of the other centre, (M,).
    """

    X: FloatArray
    d: FloatArray
    other: IntArray

    @cached_property
    def rough(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """The upper triangles, doubled, (21,M), and d (M): for a first choice only."""
        return (2 * upper(self.X).T).astype(np.float32), self.d.astype(np.float32)


@dataclass
class Centres:
    """Centres that grow in number; a frame P is nearest to where tr P π(P_c) + g_c is greatest.

    The chart of a centre holds all frames with tr P P_c + g_c ≥ 3 − radius².

    Attributes
    ----------
    radius : the radius R of the level 3 − R².
    charts : their charts, in order.
    weights : their weights g_c.
    P : their projections, (7,7) each.
    """

    radius: float
    charts: list[Chart] = field(default_factory=list)
    weights: list[float] = field(default_factory=list)
    P: list[FloatArray] = field(default_factory=list)
    # the upper triangles of all P in all orders, (5040·room, 21), of which the first are in use
    _ordered: npt.NDArray[np.float32] = field(
        default_factory=lambda: np.empty((0, 21), np.float32), repr=False
    )

    def add(self, W: FloatArray, weight: float = 0.0) -> None:
        """Add the tight frame next to the row space of W (3,7)."""
        chart = tight_chart(W, self.radius**2 + weight)
        P, n = projection(chart), len(ORDERS)
        used = n * len(self.P)
        if used == len(self._ordered):
            room = np.empty((n * ROOM, 21), np.float32)
            self._ordered = np.concatenate([self._ordered, room])
        self._ordered[used : used + n] = P[ORDERS[:, ROWS], ORDERS[:, COLS]]
        self.charts.append(chart)
        self.weights.append(weight)
        self.P.append(P)

    def level(self, a: int) -> float:
        """Return the trace tr P P_a at which the nearness to centre a is the level."""
        return 3 - self.radius**2 - self.weights[a]

    def near(self, a: int, most: int, known: int | None = None) -> HalfSpaces:
        """Return half spaces of the pairs (b, order) that are nearest to centre a.

        Any choice of pairs is valid; this one, in single precision, should be a good one.

        Parameters
        ----------
        a : the number of the centre.
        most : how many pairs at most.
        known : with only as many centres as this, the first.
        """
        known = len(self.P) if known is None else known
        n = len(ORDERS)
        traces = 2 * (self._ordered[: n * known] @ upper(self.P[a]).astype(np.float32))
        squared = 3 - DIAGONAL - traces
        keep = np.flatnonzero(self._reached(a, squared))
        weights, P = np.array(self.weights), np.array(self.P)
        key = squared[keep].astype(float) - weights[keep // n]
        keep = keep[np.argsort(key, kind="stable")[:most]]
        order, b = ORDERS[keep % n], keep // n
        X = P[b[:, None, None], order[:, :, None], order[:, None, :]] - P[a]
        return HalfSpaces(X, weights[b] - weights[a], b)

    def _reached(self, a: int, squared: npt.NDArray[np.float32]) -> BoolArray:
        """Whether pairs at these squared distances are others than centre a, and near it."""
        reach = REACH**2 * (self.radius**2 + self.weights[a])
        return np.asarray((squared > SAME) & (squared < reach))
