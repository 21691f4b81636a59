"""From a pair of multisets of edges to the class of the monomial, by array look-up.

A monomial is a multiset of edges of each colour. There are few multisets (1771 of three edges
on seven joints) but millions of pairs; a table per number of edges holds the class of each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, combinations_with_replacement, permutations
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from formulations.existence.graphs import Monomial, Pairs

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
    """Number the multisets of at most `order` edges.

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


@dataclass(frozen=True, eq=False)
class MomentTable:
    """The class of every monomial with equally many edges of both colours.

    Parameters
    ----------
    multisets
        The numbering of multisets of edges.
    number_of_classes
        Number of classes.
    tables
        For each size p, the class of (multiset of W, multiset of conj(W)): shape (N_p, N_p).
    """

    multisets: EdgeMultisets
    number_of_classes: int
    tables: tuple[Integers, ...]

    def averages(self, matrix: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the class moments of a given W: averaged over joint orders and conjugation.

        Parameters
        ----------
        matrix
            A complex symmetric W, joints×joints.
        """
        i, j = np.array(self.multisets.edges).T
        entries = matrix[i, j]
        sums = np.zeros(self.number_of_classes)
        counts = np.zeros(self.number_of_classes)
        for members, table in zip(self.multisets.members, self.tables, strict=True):
            values = entries[members].prod(axis=-1)
            products = np.outer(values, values.conj()).real
            sums += np.bincount(table.ravel(), products.ravel(), self.number_of_classes)
            counts += np.bincount(table.ravel(), minlength=self.number_of_classes)
        return sums / counts


def moment_table(graphs: Sequence[Monomial], multisets: EdgeMultisets) -> MomentTable:
    """Tabulate the classes by relabelling one monomial of each in every way.

    Parameters
    ----------
    graphs
        One monomial per class, of at most the order of the multisets.
    multisets
        The numbering of multisets of edges.

    Raises
    ------
    ValueError
        If some monomial belongs to no class or to two: the classes are not what they claim.
    """
    sizes = [len(members) for members in multisets.members]
    tables = [np.full((size, size), -1, dtype=np.int32) for size in sizes]
    orders = np.array(list(permutations(range(multisets.joints))))
    for place, graph in enumerate(graphs):
        table = tables[len(graph.w)]
        w, wbar = (
            multisets.images(multisets.members[len(pairs)][multisets.of_pairs(pairs)], orders)
            for pairs in (graph.w, graph.wbar)
        )
        if not np.isin(table[w, wbar], (-1, place)).all():
            raise ValueError(f"the monomial {graph} belongs to two classes")
        table[w, wbar] = place
        table[wbar, w] = place
    if any((table < 0).any() for table in tables):
        raise ValueError("a monomial belongs to no class")
    return MomentTable(multisets, len(graphs), tuple(tables))
