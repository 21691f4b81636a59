"""From a pair of multisets of edges to the class of the monomial, by array look-up.

There are few multisets (1771 of three edges on seven joints) but millions of pairs; a table per
number of edges holds the class of each pair.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from formulations.existence.graphs import Monomial
from formulations.existence.relaxation.edge_multisets import EdgeMultisets, Integers
from nlp.errors import InputError


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
    InputError
        If some monomial belongs to no class or to two.
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
            raise InputError(
                "graphs", graph, "one monomial of each class, this one is a second"
            )
        table[w, wbar] = place
        table[wbar, w] = place
    if any((table < 0).any() for table in tables):
        raise InputError("graphs", len(graphs), "one monomial of each class, some are missing")
    return MomentTable(multisets, len(graphs), tuple(tables))
