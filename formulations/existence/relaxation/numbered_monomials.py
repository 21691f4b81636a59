"""Monomials as numbers, so that products and relabellings are array look-ups.

A monomial in the entries of W is a multiset of edges for each of two colours. Averaging over a
common phase of W makes moments vanish unless both colours occur equally often, so rows of the
moment matrix of different charge do not meet: a `RowSector` has the monomials of one charge.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, combinations_with_replacement
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from formulations.existence.certificate import Pairs
from formulations.existence.graphs import Monomial

Integers: TypeAlias = NDArray[np.integer]


@dataclass(frozen=True, eq=False)
class EdgeMultisets:
    """The multisets of at most `order` edges on some joints, numbered for each size.

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
    def edges(self) -> tuple[tuple[int, int], ...]:
        """All pairs of joints that are edges, (i, j) with i ≤ j."""
        choose = combinations_with_replacement if self.loops else combinations
        return tuple(choose(range(self.joints), 2))

    @cached_property
    def members(self) -> tuple[Integers, ...]:
        """For each size p the edge numbers of the N_p multisets, ascending: shape (N_p, p)."""
        edges = range(len(self.edges))
        return tuple(
            np.array(list(combinations_with_replacement(edges, p)), dtype=np.int64)
            for p in range(self.order + 1)
        )

    def number(self, members: Integers) -> Integers:
        """Return the numbers of multisets, given as edge numbers in any order: (..., p)."""
        p = members.shape[-1]
        digits = len(self.edges) ** np.arange(p)[::-1]
        return np.searchsorted(self.members[p] @ digits, np.sort(members, axis=-1) @ digits)

    def of_pairs(self, pairs: Pairs) -> int:
        """Return the number of the multiset with these edges."""
        return int(self.number(np.array([self.edges.index(p) for p in pairs], dtype=np.int64)))

    def unions(self, p: int, q: int) -> Integers:
        """Return the numbers of all unions of p edges with q edges: shape (N_p, N_q)."""
        left, right = self.members[p][:, None], self.members[q][None, :]
        shape = (len(self.members[p]), len(self.members[q]))
        parts = [np.broadcast_to(left, (*shape, p)), np.broadcast_to(right, (*shape, q))]
        return self.number(np.concatenate(parts, axis=-1))

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
        i, j = np.array(self.edges).T
        edge[i, j] = edge[j, i] = np.arange(len(self.edges))
        moved = edge[orders[:, i], orders[:, j]]
        return self.number(moved[:, members])


@dataclass(frozen=True, eq=False)
class RowSector:
    """The monomials of one charge with at most as many edges as the multisets, numbered.

    Parameters
    ----------
    multisets
        The numbering of multisets of edges.
    charge
        Number of factors W minus number of factors conj(W), not negative.
    """

    multisets: EdgeMultisets
    charge: int

    @property
    def types(self) -> list[tuple[int, int]]:
        """Numbers of factors W and conj(W), ascending by degree."""
        least = range((self.multisets.order - self.charge) // 2 + 1)
        return [(q + self.charge, q) for q in least]

    def size(self, p: int, q: int) -> int:
        """Return the number of monomials with p factors W and q factors conj(W)."""
        return len(self.multisets.members[p]) * len(self.multisets.members[q])

    def offset(self, p: int, q: int) -> int:
        """Return the number of the first monomial of a type."""
        return sum(self.size(*other) for other in self.types if other < (p, q))

    @property
    def length(self) -> int:
        """Number of rows."""
        return sum(self.size(*kind) for kind in self.types)

    def number(self, monomial: Monomial) -> int:
        """Return the number of a monomial."""
        p, q = len(monomial.w), len(monomial.wbar)
        w, wbar = self.multisets.of_pairs(monomial.w), self.multisets.of_pairs(monomial.wbar)
        return self.offset(p, q) + w * len(self.multisets.members[q]) + wbar

    def images(self, p: int, q: int, orders: Integers) -> Integers:
        """Return where relabellings of the joints take the monomials of a type.

        Numbers are counted from the type's offset; shape (number of orders, size).
        """
        w = self.multisets.images(self.multisets.members[p], orders)
        wbar = self.multisets.images(self.multisets.members[q], orders)
        flat = w[:, :, None] * len(self.multisets.members[q]) + wbar[:, None, :]
        return flat.reshape(len(orders), -1)
