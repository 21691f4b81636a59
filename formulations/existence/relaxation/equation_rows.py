"""Rows of the moment matrix that the equations of an isotropic Jacobian send to zero."""

from __future__ import annotations

from collections.abc import Iterator

from formulations.existence.equations import CHARGE, Equation, Frame
from formulations.existence.graphs import Monomial
from formulations.existence.polynomials import Polynomial, times
from formulations.existence.relaxation.row_sectors import RowSector


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
                yield Monomial(tuple(edges[e] for e in w), tuple(edges[e] for e in wbar))
