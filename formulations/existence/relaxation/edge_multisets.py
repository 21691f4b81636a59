"""Multisets of edges, numbered, so that products and relabellings are array look-ups.

A monomial in the entries of W is a multiset of edges for each of two colours.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, combinations_with_replacement
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from formulations.existence.graphs import Pairs

Integers: TypeAlias = NDArray[np.integer]


@dataclass(frozen=True, eq=False)
class EdgeMultisets:
    """The multisets of at most `order` edges on some joints, numbered for each size.

    Parameters
    ----------
    joints
        Number of joints.
    edges
        All pairs of joints that are edges, (i, j) with i ≤ j.
    members
        For each size p, the edge numbers of the N_p multisets, ascending: shape (N_p, p).
    """

    joints: int
    edges: tuple[tuple[int, int], ...]
    members: tuple[Integers, ...]

    def number(self, members: Integers) -> Integers:
        """Return the numbers of multisets, given as edge numbers in any order: (..., p)."""
        ordered = np.sort(members, axis=-1)
        sizes = len(self.edges) ** np.arange(ordered.shape[-1])[::-1]
        return np.searchsorted(self._keys(ordered.shape[-1]), ordered @ sizes)

    def of_pairs(self, pairs: Pairs) -> int:
        """Return the number of the multiset with these edges."""
        edge = {pair: place for place, pair in enumerate(self.edges)}
        return int(self.number(np.array([edge[pair] for pair in pairs], dtype=np.int64)))

    def unions(self, p: int, q: int) -> Integers:
        """Return the numbers of all unions of p edges with q edges: shape (N_p, N_q)."""
        left, right = self.members[p], self.members[q]
        shape = (len(left), len(right))
        joined = np.concatenate(
            [
                np.broadcast_to(left[:, None], (*shape, p)),
                np.broadcast_to(right[None, :], (*shape, q)),
            ],
            axis=-1,
        )
        return self.number(joined)

    def images(self, members: Integers, orders: Integers) -> Integers:
        """Return the numbers of multisets after relabelling the joints.

        Parameters
        ----------
        members
            Edge numbers, shape (..., p).
        orders
            Permutations of the joints, shape (g, joints): joint i becomes orders[:, i].

        Returns
        -------
        ndarray
            Shape (g, ...).
        """
        edge = np.empty((self.joints, self.joints), dtype=np.int64)
        for place, (i, j) in enumerate(self.edges):
            edge[i, j] = edge[j, i] = place
        i, j = np.array(self.edges).T
        moved = edge[orders[:, i], orders[:, j]]
        return self.number(moved[:, members])

    def _keys(self, p: int) -> Integers:
        return self.members[p] @ (len(self.edges) ** np.arange(p)[::-1])


def edge_multisets(joints: int, order: int, *, loops: bool) -> EdgeMultisets:
    """Return the numbering of the multisets of at most `order` edges.

    Parameters
    ----------
    joints
        Number of joints.
    order
        Largest number of edges in a multiset.
    loops
        Whether (i, i) is an edge.
    """
    choose = combinations_with_replacement if loops else combinations
    edges = tuple(choose(range(joints), 2))
    members = tuple(
        np.array(list(combinations_with_replacement(range(len(edges)), p)), dtype=np.int64)
        for p in range(order + 1)
    )
    return EdgeMultisets(joints, edges, members)
