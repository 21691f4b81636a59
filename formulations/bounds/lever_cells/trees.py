"""Trees of boxes: the tight frames of a box are excluded piece by piece, by halving.

A box is excluded if it has no frame, no null vector, or no arm by the multipliers that it
inherits or by its own. Otherwise it is cut along one coordinate, and its halves take its bounds
and its multipliers.
"""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.boxes import SLACK, Boxes, boxes, children
from lockedjoint.formulations.bounds.lever_cells.cases import Cases
from lockedjoint.formulations.bounds.lever_cells.cells import Cells, no_null_vector
from lockedjoint.formulations.bounds.lever_cells.certificates import excluded
from lockedjoint.formulations.bounds.lever_cells.charts import Chart
from lockedjoint.formulations.bounds.lever_cells.corners import BoolArray, IntArray
from lockedjoint.formulations.bounds.lever_cells.equations import (
    MULTIPLIER_COUNT,
    Multipliers,
)
from lockedjoint.formulations.bounds.lever_cells.expansion import Expansion
from lockedjoint.formulations.bounds.lever_cells.multipliers import multipliers
from lockedjoint.nlp.arrays import FloatArray

#: What a test has to exceed, a thousand times what rounding can change.
MARGIN = 1e-6
#: Boxes that are looked at together.
BATCH = 400
#: Half side above which a box is cut at once: its bounds would not be finite.
LARGEST_HALF = 0.3
#: Root mean square of the edges of a cell above which it is cut without multipliers.
LARGEST_EDGE = 0.1
#: Bound of the errors of a cell, for multipliers of the usual size, above which the same holds.
LARGEST_ERROR = 0.08
#: Norm of the form H of multipliers of the usual size; see `forms.Forms`.
USUAL_H = 0.13
#: Norm of their C H T₀.
USUAL_CHT = 0.07
#: Norm of their C H Cᵀ.
USUAL_CHC = 0.08
#: Share of the longest edge below which an edge is not cut.
SHORT = 0.35


class End(Enum):
    """Why a box is excluded."""

    OUTSIDE = "outside the chart"
    NO_NULL_VECTOR = "no null vector"
    INHERITED = "multipliers of a box that it is part of"
    OWN = "multipliers of its own"


@dataclass(frozen=True)
class Nodes(Cases):
    """N boxes t ± h and what is known of them.

    Attributes
    ----------
    t, h : middles and half sides, (N,6).
    z, tilt, near : what is known of z, as `boxes.boxes` takes it.
    inherited : multipliers of a box that each is part of, (N,89); NaN where there are none.
    """

    t: FloatArray
    h: FloatArray
    z: FloatArray
    tilt: FloatArray
    near: FloatArray
    inherited: FloatArray

    def __len__(self) -> int:
        """Return the number of boxes."""
        return len(self.t)

    @classmethod
    def cube(cls, half: float) -> Nodes:
        """Return the cube |t_k| ≤ half around a centre."""
        return cls(
            np.zeros((1, 6)),
            np.full((1, 6), half),
            np.zeros((1, 6)),
            np.zeros((1, 6, 6)),
            np.full(1, np.inf),
            np.full((1, MULTIPLIER_COUNT), np.nan),
        )

    def joined(self, other: Nodes) -> Nodes:
        """Return these boxes and the other ones."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Nodes(*(np.concatenate(pair) for pair in pairs))

    def outside(self, chart: Chart) -> BoolArray:
        """Whether all |t| in a box are greater than T, and so than all |K| of the chart."""
        nearest = (np.maximum(np.abs(self.t) - self.h, 0.0) ** 2).sum(1)
        return np.asarray(nearest > chart.greatest**2 + SLACK)

    def halves(self, c: Boxes | None, axis: IntArray, inherited: FloatArray) -> Nodes:
        """Return both halves of each box, cut along its axis.

        `c` has the boxes' bounds, None if there are none; `inherited` is what halves inherit.
        """
        rows = np.arange(len(self))
        h = self.h.copy()
        h[rows, axis] *= 0.5
        if c is None:
            unknown = self.z, np.zeros((len(self), 6, 6)), np.full(len(self), np.inf)
            known = [unknown, unknown]
        else:
            known = children(c, rows, axis)
        both = []
        for sign, (z, tilt, near) in zip((-1, 1), known, strict=True):
            t = self.t.copy()
            t[rows, axis] += sign * h[rows, axis]
            both.append(Nodes(t, h, z, tilt, near, inherited))
        return both[0].joined(both[1])


@dataclass
class Census:
    """What a tree consists of.

    Attributes
    ----------
    ends : how many boxes are excluded, by why.
    nodes, programs : numbers of boxes, and of programs for multipliers.
    left : number of boxes that were not looked at, as time was up.
    seconds : time.
    """

    ends: Counter[End] = field(default_factory=Counter)
    nodes: int = 0
    programs: int = 0
    left: int = 0
    seconds: float = 0.0

    @property
    def certificates(self) -> int:
        """Number of boxes that multipliers exclude."""
        return self.ends[End.INHERITED] + self.ends[End.OWN]


def census(chart: Chart, limit: float, root: Nodes, seconds: float = np.inf) -> Census:
    """Exclude all arms of the frames in boxes of a chart, and count the boxes that it takes.

    Parameters
    ----------
    chart
        The chart. Only its frames with |K| ≤ T count.
    limit
        The arms with all |v_i|² − 1 ≤ `limit` are excluded.
    root
        The boxes.
    seconds
        Time after which the rest is left.
    """
    found, start = Census(), time.monotonic()
    stack = [root]
    while stack and time.monotonic() - start < seconds:
        nodes = stack.pop()
        while stack and len(nodes) < BATCH:
            nodes = nodes.joined(stack.pop())
        if len(nodes) > BATCH:
            stack.append(nodes.take(slice(None, -BATCH)))
            nodes = nodes.take(slice(-BATCH, None))
        found.nodes += len(nodes)
        outside = nodes.outside(chart)
        found.ends[End.OUTSIDE] += int(outside.sum())
        nodes = nodes.take(~outside)
        if len(nodes):
            stack.append(_looked_at(chart, limit, nodes, found))
    found.left = sum(map(len, stack))
    found.seconds = time.monotonic() - start
    return found


def _looked_at(chart: Chart, limit: float, nodes: Nodes, found: Census) -> Nodes:
    """Return the halves of the boxes that are not excluded; count the others."""
    axis, inherited = nodes.h.argmax(1), nodes.inherited.copy()
    if nodes.h.max() > LARGEST_HALF:
        return nodes.halves(None, axis, inherited)
    c = boxes(chart, nodes.t, nodes.h, nodes.z, nodes.tilt, nodes.near)
    edges = np.sqrt((c.G**2).sum(2))
    axis = np.where(c.ok, edges.argmax(1), axis)
    remaining = np.ones(len(nodes), bool)
    known = np.flatnonzero(c.ok)
    if len(known):
        cells = Cells.of_boxes(c.take(known))
        empty = no_null_vector(cells, limit, MARGIN)
        remaining[known[empty]] = False
        found.ends[End.NO_NULL_VECTOR] += int(empty.sum())
        small = np.sqrt((edges[known] ** 2).sum(1) / 6) < LARGEST_EDGE
        tried = np.flatnonzero(~empty & cells.ok & small)
        expansion = Expansion.of_cells(cells.take(tried))
        hopeful = _usual_error(expansion) < LARGEST_ERROR
        tried, expansion = known[tried[hopeful]], expansion.take(hopeful)
        remaining[tried] = ~_by_inherited(expansion, inherited[tried], limit, found)
        rest = np.flatnonzero(remaining[tried])
        own = _by_own(expansion.take(rest), limit, found)
        remaining[tried[rest]] = ~own.excluded
        some = tried[rest[own.having]]
        inherited[some] = own.packed
        axis[some] = _to_cut(own.scores, edges[some])
    rows = np.flatnonzero(remaining)
    return nodes.take(rows).halves(c.take(rows), axis[rows], inherited[rows])


def _usual_error(expansion: Expansion) -> FloatArray:
    """Return about what the errors of Y come to, for multipliers of the usual size, (N,)."""
    r = expansion.rest
    with np.errstate(all="ignore"):
        first = 2 * (USUAL_CHT * r.z3 + USUAL_H * r.s3)
        second = 2 * r.z1 * (USUAL_CHC * r.z2 + USUAL_H * r.k**2)
        third = 2 * USUAL_H * r.z1 * (r.z3 + r.s3)
        fourth = USUAL_H * (r.z2 + r.k**2 + r.z3 + r.s3) ** 2
        return np.asarray(4 * (first + second + third + fourth))


def _by_inherited(
    expansion: Expansion, packed: FloatArray, limit: float, found: Census
) -> BoolArray:
    """Whether the multipliers that cells inherit exclude them; those of NaN do not."""
    answer = np.zeros(len(packed), bool)
    having = np.flatnonzero(np.isfinite(packed[:, 0]))
    if len(having):
        some = Multipliers.unpacked(packed[having])
        answer[having], _ = excluded(expansion.take(having), some, limit, MARGIN)
    found.ends[End.INHERITED] += int(answer.sum())
    return answer


@dataclass(frozen=True)
class _Own:
    """Whether cells are excluded by multipliers of their own (N,).

    having : the cells that have multipliers, (M,); packed, scores : these (M,89), and how much
    each edge changes the forms (M,6).
    """

    excluded: BoolArray
    having: IntArray
    packed: FloatArray
    scores: FloatArray


def _by_own(expansion: Expansion, limit: float, found: Census) -> _Own:
    """Look for multipliers of cells, and whether they exclude them."""
    N = len(expansion.cells.W)
    answer = np.zeros(N, bool)
    if not N:
        nothing = np.zeros(0, np.intp)
        return _Own(answer, nothing, np.zeros((0, MULTIPLIER_COUNT)), np.zeros((0, 6)))
    good, m = multipliers(expansion, limit)
    found.programs += N
    having = np.flatnonzero(good)
    m = m.take(having)
    if len(having):
        answer[having], forms = excluded(expansion.take(having), m, limit, MARGIN)
        scores = forms.scores()
    else:
        scores = np.zeros((0, 6))
    found.ends[End.OWN] += int(answer.sum())
    return _Own(answer, having, m.packed(), scores)


def _to_cut(scores: FloatArray, edges: FloatArray) -> IntArray:
    """Return which edge changes the forms most, among those that are not short, (N,)."""
    long = edges > SHORT * edges.max(1, keepdims=True)
    return np.asarray(np.where(long, scores, -1.0).argmax(1))
