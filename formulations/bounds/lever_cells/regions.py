"""The frames that are nearest to one centre: boxes of its ball that hold none of them.

A box of the chart of a centre c is dropped if all its frames are outside the ball, or if all
are nearer to images of other centres. It is cut in two otherwise.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.boxes import Boxes, boxes
from lockedjoint.formulations.bounds.lever_cells.centres import Centres, HalfSpaces
from lockedjoint.formulations.bounds.lever_cells.charts import Chart
from lockedjoint.formulations.bounds.lever_cells.corners import BoolArray, IntArray
from lockedjoint.formulations.bounds.lever_cells.half_spaces import nearer
from lockedjoint.formulations.bounds.lever_cells.nodes import Nodes, batches
from lockedjoint.formulations.bounds.lever_cells.traces import trace_range
from lockedjoint.nlp.arrays import FloatArray

#: What a test has to exceed, thirty times what rounding can change.
MARGIN = 1e-6
#: Half side above which a box is cut at once: its bounds would not be finite.
LARGEST_HALF = 0.3
#: Part of a bound of tr P P_c that is due to norms, above which half spaces are hopeless.
HOPELESS = 0.12
#: Half side below which a tree is given up: something is not as it should be.
SMALLEST_HALF = 5e-4


class End(Enum):
    """Why a box is excluded."""

    OUTSIDE = "outside the chart"
    BEYOND = "beyond the sphere"
    INSIDE = "inside the sphere"
    NEARER = "nearer to other centres"
    DIVIDED = "no signs have a null vector"
    NO_NULL_VECTOR = "no null vector"
    INHERITED = "multipliers of a box that it is part of"
    OWN = "multipliers of its own"


@dataclass
class Tally:
    """What a tree consists of.

    Attributes
    ----------
    ends : how many boxes are excluded, by why.
    nodes, programs : numbers of boxes, and of programs for multipliers.
    left : number of boxes that are not excluded. The tree is a proof if there are none.
    """

    ends: Counter[End] = field(default_factory=Counter)
    nodes: int = 0
    programs: int = 0
    left: int = 0

    @property
    def certificates(self) -> int:
        """Number of boxes that multipliers exclude."""
        return self.ends[End.INHERITED] + self.ends[End.OWN]

    def add(self, other: Tally) -> None:
        """Add what another tree consists of."""
        self.ends += other.ends
        self.nodes += other.nodes
        self.programs += other.programs
        self.left += other.left


@dataclass(frozen=True)
class Region:
    """The frames nearest to a centre, of those in its ball.

    Attributes
    ----------
    chart : the chart of the ball.
    P : the projection of the centre, (7,7).
    level : the trace tr P P_c on the sphere.
    half_spaces : those of images near the centre.
    """

    chart: Chart
    P: FloatArray
    level: float
    half_spaces: HalfSpaces

    @classmethod
    def of(cls, centres: Centres, a: int) -> Region:
        """Return the region of centre a."""
        return cls(centres.charts[a], centres.P[a], centres.level, centres.near(a))

    def remaining(self, nodes: Nodes, tally: Tally, sphere: bool) -> tuple[Nodes, Boxes | None]:
        """Return the nodes that are not dropped, cut to the chart, and their bounds.

        There are no bounds, but None, if boxes are too large. With `sphere` only frames on the
        sphere count.
        """
        tally.nodes += len(nodes)
        outside = nodes.outside(self.chart)
        tally.ends[End.OUTSIDE] += int(outside.sum())
        nodes = nodes.take(~outside).cut_to(self.chart)
        if not len(nodes) or nodes.h.max() > LARGEST_HALF:
            return nodes, None
        c = boxes(self.chart, nodes.t, nodes.h, nodes.z, nodes.tilt, nodes.near)
        below, above, rest = trace_range(c, np.broadcast_to(self.P, (len(nodes), 7, 7)))
        beyond = above < self.level - MARGIN
        inside = (below > self.level + MARGIN) & sphere
        tried = np.flatnonzero(~beyond & ~inside & c.ok & (rest < HOPELESS))
        apart = np.zeros(len(nodes), bool)
        apart[tried] = self._nearer(c.take(tried), sphere)
        for why, which in ((End.BEYOND, beyond), (End.INSIDE, inside), (End.NEARER, apart)):
            tally.ends[why] += int(which.sum())
        left = np.flatnonzero(~(beyond | inside | apart))
        return nodes.take(left), c.take(left)

    def _nearer(self, c: Boxes, sphere: bool) -> BoolArray:
        """Whether a combination of half spaces excludes boxes."""
        if not len(c.W) or not len(self.half_spaces.X):
            return np.zeros(len(c.W), bool)
        level = self.level if sphere else None
        return np.asarray(nearer(c, self.half_spaces, self.P, level)[0] > MARGIN)


def sphere(region: Region) -> Tally:
    """Show that each frame on the sphere of a ball is nearer to another centre.

    The proof holds if no box is left. It ends at the first box that is too small.
    """
    tally, stack = Tally(), [Nodes.cube(region.chart.greatest)]
    for nodes in batches(stack):
        nodes, c = region.remaining(nodes, tally, sphere=True)
        if len(nodes) and nodes.h.max(1).min() < SMALLEST_HALF:
            tally.left = len(nodes) + sum(map(len, stack))
            break
        if len(nodes):
            stack.append(nodes.halves(c, longest_edge(nodes, c)))
    return tally


def longest_edge(nodes: Nodes, c: Boxes | None) -> IntArray:
    """Return the coordinate in which a box is longest, as a change of K if this is known."""
    longest: IntArray = nodes.h.argmax(1)
    if c is not None:
        longest = np.where(c.ok, (c.G**2).sum(2).argmax(1), longest)
    return longest
