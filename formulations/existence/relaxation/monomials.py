"""Monomials as numbers, so that products, relabellings and classes are array look-ups.

A monomial in the entries of W and its conjugate is a pair (w, wbar) of multisets of edges. The
*key* of a multiset has the multiplicities of its edges as digits. No multiplicity exceeds the
order of the relaxation, so the key of a union is the sum of the keys.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement, permutations

import numpy as np

from formulations.existence.graphs import Monomial
from formulations.existence.relaxation.tableaux import IntArray


@dataclass(frozen=True, eq=False)
class EdgeMultisets:
    """The N multisets of at most `order` edges on some joints, numbered by ascending keys.

    Parameters
    ----------
    joints
        Number of joints.
    order
        Largest number of edges in a multiset.
    loops
        Whether (i, i) is an edge.
    """

    joints: int
    order: int
    loops: bool = False

    @cached_property
    def edges(self) -> tuple[IntArray, IntArray]:
        """The edges (i, j), i ≤ j: an array of all i and one of all j."""
        return np.triu_indices(self.joints, 0 if self.loops else 1)

    @cached_property
    def edge_keys(self) -> IntArray:
        """The key of every edge (i, j): shape (joints, joints), symmetric."""
        keys = np.zeros((self.joints, self.joints), dtype=np.int64)
        keys[self.edges] = (self.order + 1) ** np.arange(len(self.edges[0]))
        return keys | keys.T

    @cached_property
    def keys(self) -> IntArray:
        """The keys of all multisets, ascending: shape (N,)."""
        digits = self.edge_keys[self.edges]
        choices = (
            np.array(list(combinations_with_replacement(digits, size)), dtype=np.int64)
            for size in range(self.order + 1)
        )
        return np.sort(np.concatenate([choice.sum(axis=1) for choice in choices]))

    @cached_property
    def multiplicities(self) -> IntArray:
        """How often each multiset has each edge: shape (N, edges)."""
        return self.keys[:, None] // self.edge_keys[self.edges] % (self.order + 1)

    def number(self, keys: IntArray | int) -> IntArray:
        """Return the numbers of the multisets that have these keys."""
        return np.searchsorted(self.keys, keys)

    def rows(self, charge: int) -> tuple[IntArray, IntArray]:
        """Return the monomials of degree up to `order` with `charge` more W than conj(W)."""
        sizes = self.multiplicities.sum(axis=1)
        more, degree = sizes[:, None] - sizes, sizes[:, None] + sizes
        w, wbar = np.nonzero((more == charge) & (degree <= self.order))
        return w, wbar

    def images(self, rows: tuple[IntArray, IntArray], names: IntArray) -> IntArray:
        """Return to which row relabelling the joints by ``names[g]`` takes each: (g, rows)."""
        i, j = self.edges
        image = self.number(self.edge_keys[names[:, i], names[:, j]] @ self.multiplicities.T)
        (w, wbar), count = rows, len(self.keys)
        return np.searchsorted(w * count + wbar, image[:, w] * count + image[:, wbar])

    def class_table(self, classes: Sequence[Monomial]) -> IntArray:
        """Return the class of every monomial with as many W as conj(W), else −1: (N, N).

        `classes` has one monomial of each class; it is relabelled in every way.
        """
        table = np.full((len(self.keys), len(self.keys)), -1)
        names = np.array(list(permutations(range(self.joints))))
        for place, graph in enumerate(classes):
            w, wbar = (
                self.number(sum(self.edge_keys[names[:, i], names[:, j]] for i, j in pairs))
                for pairs in (graph.w, graph.wbar)
            )
            table[w, wbar] = table[wbar, w] = place
        return table
