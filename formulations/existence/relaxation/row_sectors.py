"""Rows of the moment matrix: the monomials of one charge.

Averaging over a common phase of W makes moments vanish unless both colours occur equally often,
so rows of different charge do not meet.
"""

from __future__ import annotations

from dataclasses import dataclass

from formulations.existence.graphs import Monomial
from formulations.existence.relaxation.edge_multisets import EdgeMultisets, Integers


@dataclass(frozen=True, eq=False)
class RowSector:
    """The monomials of degree at most `order` with one charge, numbered.

    Parameters
    ----------
    multisets
        The numbering of multisets of edges.
    charge
        Number of factors W minus number of factors conj(W), not negative.
    order
        Largest degree.
    """

    multisets: EdgeMultisets
    charge: int
    order: int

    @property
    def types(self) -> list[tuple[int, int]]:
        """Numbers of factors W and conj(W), ascending by degree."""
        return [(q + self.charge, q) for q in range((self.order - self.charge) // 2 + 1)]

    def size(self, p: int, q: int) -> int:
        """Return the number of monomials with p factors W and q factors conj(W)."""
        return len(self.multisets.members[p]) * len(self.multisets.members[q])

    def offset(self, p: int, q: int) -> int:
        """Return the number of the first monomial of a type."""
        return sum(self.size(*other) for other in self.types[: self.types.index((p, q))])

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
