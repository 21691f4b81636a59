"""Frames followed down trees: what is left of the boxes that hold them."""

from dataclasses import dataclass

import numpy as np

from lockedjoint.formulations.bounds.lever_cells import arms, centres
from lockedjoint.formulations.bounds.lever_cells.nodes import ANY, Nodes
from lockedjoint.formulations.bounds.lever_cells.regions import Region, Tally, longest_edge

#: How much boxes are widened, in parts of their sides, when a frame is looked for.
WIDER = 1e-9


@dataclass(frozen=True)
class Moved:
    """A frame whose columns have got the order and the signs of the centre nearest to it.

    a : the number of the centre. W : the frame, (3,7). order, signs : column j of the old one,
    times its sign, is column order[j].
    """

    a: int
    W: np.ndarray
    order: np.ndarray
    signs: np.ndarray

    def row(self, old):
        """Seven numbers n of the old columns, as numbers of the new ones."""
        new = np.empty(7)
        new[self.order] = self.signs * old
        return new


def moved(of_centres, W):
    """Move a frame (3,7) to the centre nearest to it, and say how far it is, squared."""
    squared = of_centres.squared_distances(W.T @ W)
    i, j = np.unravel_index(squared.argmin(), squared.shape)
    a, order = divmod(int(i), 5040)
    order, signs = centres.ORDERS[order], centres.SIGNS[j]
    new = np.empty((3, 7))
    new[:, order] = signs * W
    return Moved(a, new, order, signs), float(squared[i, j])


def place(chart, W):
    """The tangent coordinates of a frame (3,7) in a chart."""
    K = np.linalg.solve(W @ chart.W.T, W @ chart.F.T)
    return chart.B @ K.ravel()


def holding(nodes, t, signs=None):
    """The boxes in which t is; with signs only those that are for these or for all."""
    inside = (np.abs(t - nodes.t) <= nodes.h * (1 + WIDER) + 1e-13).all(1)
    if signs is not None:
        inside &= (nodes.signs == ANY) | (nodes.signs == signs)
    return nodes.take(inside)


def down_region(region: Region, t, smallest, sphere=False):
    """Boxes that hold a frame, when all of them are small; none if they were dropped before.

    They are cut until their sides are below twice the smallest.
    """
    nodes, tally = Nodes.cube(region.chart.greatest), Tally()
    while len(nodes):
        nodes, c = region.remaining(nodes, tally, sphere)
        nodes_left = holding(nodes, t)
        if not len(nodes_left) or nodes_left.h.max() < smallest:
            return nodes_left
        nodes = holding(nodes.halves(c, longest_edge(nodes, c)), t)
    return nodes


def down_arms(region: Region, t, n, limit, smallest):
    """The same for an arm with null vector n, in the tree for a limit of lever arms."""
    signs = int(np.flatnonzero((np.sign(n) * np.sign(n[0]) == centres.SIGNS).all(1))[0])
    nodes, tally = Nodes.cube(region.chart.greatest), Tally()
    while len(nodes) and nodes.h.max() >= smallest:
        nodes, c = region.remaining(nodes, tally, sphere=False)
        if c is None:
            nodes = nodes.halves(None, longest_edge(nodes, None))
        else:
            first, *others = arms._looked_at(limit, nodes, c, tally)
            for other in others:
                first = first.joined(other)
            nodes = first
        nodes = holding(nodes, t, signs)
    return nodes, tally
