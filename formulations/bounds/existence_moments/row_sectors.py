"""Rows of the moment matrix: the monomials of one charge.

Averaging over a common phase of W makes moments vanish unless both colours occur equally often,
so rows of different charge do not meet.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from formulations.bounds.existence_moments.moment_table import (
    EdgeMultisets,
    Integers,
    MomentTable,
)
from formulations.existence.equations import CHARGE, Equation, Frame, Polynomial, times
from formulations.existence.graphs import Monomial

Matrix: TypeAlias = NDArray[np.float64]


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

    def project(self, table: MomentTable, moments: Matrix, basis: Matrix) -> Matrix:
        """Return basisᵀ·M_k·basis for moment matrices M_k given by their class moments.

        Parameters
        ----------
        table
            The class of every monomial.
        moments
            Class moments, one column per matrix: shape (classes, K).
        basis
            Columns in the rows of this sector: shape (length, r).

        Returns
        -------
        ndarray
            Shape (K, r, r).
        """
        result = np.zeros((moments.shape[1], basis.shape[1], basis.shape[1]))
        for p, q in self.types:
            left = basis[self.offset(p, q) :][: self.size(p, q)]
            left = left.reshape(-1, len(self.multisets.members[q]), basis.shape[1])
            for r, s in self.types:
                right = basis[self.offset(r, s) :][: self.size(r, s)]
                # Row conj(u), column v: the factors W of v meet the factors conj(W) of u.
                w = self.multisets.unions(q, r)
                wbar = self.multisets.unions(p, s)
                for a, part in enumerate(left):
                    found = table.tables[q + r][w[:, :, None], wbar[a][None, None, :]]
                    found = found.reshape(len(part), -1)
                    for k, values in enumerate(moments.T):
                        result[k] += part.T @ (values[found] @ right)
        return result


def equation_rows(sector: RowSector, frame: Frame) -> Iterator[tuple[list[int], list[float]]]:
    """Give every multiple of an equation that fits into a sector, as numbers and coefficients.

    As vectors of rows they are in the kernel of every moment matrix that obeys the equations.

    Parameters
    ----------
    sector
        The rows.
    frame
        The Jacobians whose equations are meant.
    """
    for polynomial, charge in _equations(frame):
        degree = max(monomial.degree for monomial in polynomial)
        for monomial in _monomials(sector, sector.charge - charge, sector.order - degree):
            terms = times(monomial, polynomial)
            yield (
                [sector.number(term) for term in terms],
                [float(value) for value in terms.values()],
            )


def _equations(frame: Frame) -> Iterator[tuple[Polynomial, int]]:
    n = frame.joints
    for kind, charge in CHARGE.items():
        if kind == "row-sum" and not frame.redundant:
            continue
        places = (
            [(i,) for i in range(n)]
            if kind == "row-sum"
            else [(i, j) for i in range(n) for j in range(i, n)]
        )
        for place in places:
            polynomial = frame.polynomial(Equation(kind, place))
            if not polynomial:
                continue
            yield polynomial, charge
            if charge:
                conjugate = {term.conjugate(): value for term, value in polynomial.items()}
                yield conjugate, -charge


def _monomials(sector: RowSector, charge: int, degree: int) -> Iterator[Monomial]:
    edges = sector.multisets.edges
    for total in range(abs(charge), degree + 1, 2):
        p = (total + charge) // 2
        for w in sector.multisets.members[p]:
            for wbar in sector.multisets.members[total - p]:
                yield Monomial(
                    tuple(edges[e] for e in w), tuple(edges[e] for e in wbar)
                )
