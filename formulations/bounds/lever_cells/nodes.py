"""Nodes of trees: boxes of a chart, and what is known of the frames in them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from lockedjoint.formulations.bounds.lever_cells.boxes import SLACK, Boxes, children
from lockedjoint.formulations.bounds.lever_cells.cases import Cases
from lockedjoint.formulations.bounds.lever_cells.charts import Chart
from lockedjoint.formulations.bounds.lever_cells.corners import BoolArray, IntArray
from lockedjoint.formulations.bounds.lever_cells.equations import MULTIPLIER_COUNT
from lockedjoint.nlp.arrays import FloatArray

#: Nodes that are looked at together.
BATCH = 400
#: Signs of the columns of a node for which all 64 are still possible.
ANY = -1


@dataclass(frozen=True)
class Nodes(Cases):
    """N boxes t ± h and what is known of them.

    Attributes
    ----------
    t, h : middles and half sides, (N,6).
    z, tilt, near : what is known of z, as `boxes.boxes` takes it.
    signs : signs of the columns, numbers in `centres.SIGNS`, or `ANY`, (N,).
    inherited : multipliers of a box that each is part of, (N,89); NaN where there are none.
    wait : how many times each is still cut before the next program for multipliers, (N,).
    """

    t: FloatArray
    h: FloatArray
    z: FloatArray
    tilt: FloatArray
    near: FloatArray
    signs: IntArray
    inherited: FloatArray
    wait: IntArray

    @classmethod
    def cube(cls, half: float, signs: int = ANY) -> Nodes:
        """Return the cube |t_k| ≤ half around a centre."""
        return cls(
            t=np.zeros((1, 6)),
            h=np.full((1, 6), half),
            z=np.zeros((1, 6)),
            tilt=np.zeros((1, 6, 6)),
            near=np.full(1, np.inf),
            signs=np.full(1, signs),
            inherited=np.full((1, MULTIPLIER_COUNT), np.nan),
            wait=np.zeros(1, int),
        )

    def __len__(self) -> int:
        """Return the number of boxes."""
        return len(self.t)

    def joined(self, other: Nodes) -> Nodes:
        """Return these boxes and the other ones."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Nodes(*(np.concatenate(pair) for pair in pairs))

    def outside(self, chart: Chart) -> BoolArray:
        """Whether all |t| in a box are greater than T, and so than all |K| of the chart."""
        nearest = (np.maximum(np.abs(self.t) - self.h, 0.0) ** 2).sum(1)
        return np.asarray(nearest > chart.greatest**2 + SLACK)

    def cut_to(self, chart: Chart) -> Self:
        """Return the least boxes that hold the parts of these with |t| ≤ T.

        In a box t_k² ≤ T² − Σ_{i≠k} min t_i². No box may be outside.
        """
        least = np.maximum(np.abs(self.t) - self.h, 0.0) ** 2
        others = least.sum(1, keepdims=True) - least
        most = np.sqrt(np.maximum(chart.greatest**2 + SLACK - others, 0.0)) + SLACK
        low, up = np.maximum(self.t - self.h, -most), np.minimum(self.t + self.h, most)
        cut = ((low > self.t - self.h) | (up < self.t + self.h)) & (up > low)
        t, h = np.where(cut, (low + up) / 2, self.t), np.where(cut, (up - low) / 2, self.h)
        z = self.z + (((t - self.t) / self.h)[:, None] @ self.tilt)[:, 0]
        tilt = self.tilt * (h / self.h)[:, :, None]
        return replace(self, t=t, h=h, z=z, tilt=tilt, near=self.near + SLACK)

    def halves(self, c: Boxes | None, axis: IntArray) -> Nodes:
        """Return both halves of each box, cut along its axis.

        `c` has the boxes' bounds; it is None if there are none.
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
            both.append(replace(self, t=t, h=h, z=z, tilt=tilt, near=near))
        return both[0].joined(both[1])


def batches(stack: list[Nodes]) -> Iterator[Nodes]:
    """Yield the nodes of a stack, from its end on, in batches, until it is empty.

    The stack may grow between two batches.
    """
    while stack:
        nodes = stack.pop()
        while stack and len(nodes) < BATCH:
            nodes = nodes.joined(stack.pop())
        if len(nodes) > BATCH:
            stack.append(nodes.take(slice(None, -BATCH)))
            nodes = nodes.take(slice(-BATCH, None))
        if len(nodes):
            yield nodes
