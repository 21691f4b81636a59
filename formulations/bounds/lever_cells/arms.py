"""Which arms there are in the region of a centre: trees of boxes that exclude them.

All frames nearest to a centre are looked at with all 64 signs of their columns, so that n_i > 0
may be assumed. A box has one of these ends: it is not in the region (`regions`); it has no null
vector, with any signs or with its own; or multipliers exclude it, those of a box that it is
part of or its own. Otherwise it is cut in two. While a box is large its signs are open. A small
one is divided by the signs for which a null vector may exist.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.boxes import Boxes
from lockedjoint.formulations.bounds.lever_cells.cells import Cells, no_null_vector
from lockedjoint.formulations.bounds.lever_cells.centres import SIGNS
from lockedjoint.formulations.bounds.lever_cells.certificates import excluded
from lockedjoint.formulations.bounds.lever_cells.corners import BoolArray, IntArray
from lockedjoint.formulations.bounds.lever_cells.equations import (
    MULTIPLIER_COUNT,
    Multipliers,
)
from lockedjoint.formulations.bounds.lever_cells.expansion import Expansion
from lockedjoint.formulations.bounds.lever_cells.multipliers import multipliers
from lockedjoint.formulations.bounds.lever_cells.nodes import ANY, Nodes, batches
from lockedjoint.formulations.bounds.lever_cells.regions import (
    MARGIN,
    SMALLEST_HALF,
    End,
    Region,
    Tally,
    longest_edge,
)
from lockedjoint.nlp.arrays import FloatArray

#: Root mean square of the edges of a box below which it is divided by signs.
DIVIDED_EDGE = 0.06
#: Bound of the errors of a cell, for multipliers of the usual size, above which it is cut
#: without a program for multipliers.
LARGEST_ERROR = 0.03
#: How many times a box is cut, after a program that was in vain, before the next program.
CUTS_BETWEEN_PROGRAMS = 2
#: Norm of the form H of multipliers of the usual size; see `forms.Forms`.
USUAL_H = 0.13
#: Norm of their C H T₀.
USUAL_CHT = 0.07
#: Norm of their C H Cᵀ.
USUAL_CHC = 0.08
#: Share of the longest edge below which an edge is not cut.
SHORT = 0.35


def arms_excluded(
    region: Region, limit: float, root: Nodes | None = None, stop: Callable[[], bool] = bool
) -> Tally:
    """Exclude the isotropic arms with axes in a region and all |v_i|² − 1 ≤ `limit`.

    The proof holds if no box is left. It ends at the first box that is too small.

    Parameters
    ----------
    region
        The frames.
    limit
        The limit A of lever arms.
    root
        The boxes; by default one that holds the ball.
    stop
        Asked between batches whether to leave the rest.
    """
    tally, stack = Tally(), [root or Nodes.cube(region.chart.greatest)]
    for nodes in batches(stack):
        nodes, c = region.remaining(nodes, tally, sphere=False)
        if c is None:
            stack.append(nodes.halves(None, longest_edge(nodes, None)))
        else:
            stack.extend(_looked_at(limit, nodes, c, tally))
        if stop() or any(part.h.max(1).min() < SMALLEST_HALF for part in stack if len(part)):
            break
    tally.left = sum(map(len, stack))
    return tally


def _looked_at(limit: float, nodes: Nodes, c: Boxes, tally: Tally) -> list[Nodes]:
    """Return what is left of nodes with bounds: their halves, or themselves with signs."""
    small = np.sqrt((c.G**2).sum((1, 2)) / 6) < DIVIDED_EDGE
    unsigned = nodes.signs == ANY
    divided, signed = unsigned & small & c.ok, ~unsigned & c.ok
    large = ~(divided | signed)
    halves = nodes.take(large).halves(c.take(large), longest_edge(nodes, c)[large])
    return [
        halves,
        _divided(limit, nodes.take(divided), c.take(divided), tally),
        _signed(limit, nodes.take(signed), c.take(signed), tally),
    ]


def _divided(limit: float, nodes: Nodes, c: Boxes, tally: Tally) -> Nodes:
    """Return the boxes once for all signs with which they may have a null vector."""
    if not len(nodes):
        return nodes
    cells = Cells.of_boxes(c)
    # columns with other signs have the same K: W and F change alone
    open_ = [
        ~no_null_vector(replace(cells, W=cells.W * s, F=cells.F * s), limit, MARGIN)
        for s in SIGNS
    ]
    signs, which = np.nonzero(open_)
    tally.ends[End.DIVIDED] += int((~np.any(open_, 0)).sum())
    return replace(nodes.take(which), signs=signs)


def with_signs(c: Boxes, signs: FloatArray) -> Boxes:
    """Return boxes of the same frames with other signs (N,7) of their columns.

    K is the same, and so are w_iᵀ K f_i and all products of two parts of one column: only W and
    F change.
    """
    s = signs[:, None]
    return replace(c, W=c.W * s, F=c.F * s)


def _signed(limit: float, nodes: Nodes, c: Boxes, tally: Tally) -> Nodes:
    """Return halves of the boxes, which have signs, that are not excluded."""
    if not len(nodes):
        return nodes
    cells = Cells.of_boxes(with_signs(c, SIGNS[nodes.signs]))
    empty = no_null_vector(cells, limit, MARGIN)
    tally.ends[End.NO_NULL_VECTOR] += int(empty.sum())
    nodes, c, cells = nodes.take(~empty), c.take(~empty), cells.take(~empty)
    remaining, axis = np.ones(len(nodes), bool), longest_edge(nodes, c)
    inherited, wait = nodes.inherited.copy(), np.maximum(nodes.wait - 1, 0)
    expansion = Expansion.of_cells(cells)
    hopeful = np.flatnonzero(cells.ok & (_usual_error(expansion) < LARGEST_ERROR))
    expansion = expansion.take(hopeful)
    done = _by_inherited(expansion, inherited[hopeful], limit, tally)
    remaining[hopeful] = ~done
    tried = ~done & (nodes.wait[hopeful] == 0)
    own = _by_own(expansion.take(tried), limit, tally)
    tried = hopeful[tried]
    remaining[tried], wait[tried] = ~own.excluded, CUTS_BETWEEN_PROGRAMS - 1
    having = tried[own.having]
    inherited[having] = own.packed
    axis[having] = _to_cut(own.scores, np.sqrt((c.G[having] ** 2).sum(2)))
    left = replace(nodes, inherited=inherited, wait=wait).take(remaining)
    return left.halves(c.take(remaining), axis[remaining])


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
    expansion: Expansion, packed: FloatArray, limit: float, tally: Tally
) -> BoolArray:
    """Whether the multipliers that cells inherit exclude them; those of NaN do not."""
    answer = np.zeros(len(packed), bool)
    having = np.flatnonzero(np.isfinite(packed[:, 0]))
    if len(having):
        some = Multipliers.unpacked(packed[having])
        answer[having], _ = excluded(expansion.take(having), some, limit, MARGIN)
    tally.ends[End.INHERITED] += int(answer.sum())
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


def _by_own(expansion: Expansion, limit: float, tally: Tally) -> _Own:
    """Look for multipliers of cells, and whether they exclude them."""
    N = len(expansion.cells.W)
    answer = np.zeros(N, bool)
    if not N:
        nothing = np.zeros(0, np.intp)
        return _Own(answer, nothing, np.zeros((0, MULTIPLIER_COUNT)), np.zeros((0, 6)))
    good, m = multipliers(expansion, limit)
    tally.programs += N
    having = np.flatnonzero(good)
    m = m.take(having)
    if len(having):
        answer[having], forms = excluded(expansion.take(having), m, limit, MARGIN)
        scores = forms.scores()
    else:
        scores = np.zeros((0, 6))
    tally.ends[End.OWN] += int(answer.sum())
    return _Own(answer, having, m.packed(), scores)


def _to_cut(scores: FloatArray, edges: FloatArray) -> IntArray:
    """Return which edge changes the forms most, among those that are not short, (N,)."""
    long = edges > SHORT * edges.max(1, keepdims=True)
    return np.asarray(np.where(long, scores, -1.0).argmax(1))
