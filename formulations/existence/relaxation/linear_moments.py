"""What the equations of an isotropic Jacobian leave free of its averaged moments.

Every equation times every monomial, averaged, is a linear equation between the moments of
classes of graphs. The exact solution gives each moment as a rational combination of 1 and a few
free moments.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from formulations.existence.equations import Frame
from formulations.existence.graphs import Monomial, classes
from formulations.existence.relaxation.exact_elimination import eliminate


@dataclass(frozen=True)
class LinearMoments:
    """Exact solution of the moment equations of one order.

    Parameters
    ----------
    frame
        The Jacobians in question.
    order
        Largest number of edges of each colour.
    classes
        One monomial per class; the first is 1.
    equations
        Number of distinct averaged equations.
    rank
        Rank of these equations in the moments other than E[1] = 1.
    consistent
        Whether any moments satisfy them.
    free
        The classes whose moments are free.
    solution
        For each class the coefficients of 1 and of the free moments. Empty if inconsistent.
    """

    frame: Frame
    order: int
    classes: tuple[Monomial, ...]
    equations: int
    rank: int
    consistent: bool
    free: tuple[Monomial, ...]
    solution: Mapping[Monomial, tuple[Fraction, ...]]

    def coefficients(self) -> NDArray[np.float64]:
        """Return the solution as floats: a row per class, a column for 1 and each free one."""
        rows = [[float(v) for v in self.solution[graph]] for graph in self.classes]
        return np.array(rows).reshape(len(self.classes), 1 + len(self.free))


def averaged_equations(frame: Frame, order: int) -> list[dict[Monomial, Fraction]]:
    """Return the distinct linear equations between class moments: each sum is zero.

    Parameters
    ----------
    frame
        The Jacobians in question.
    order
        Largest number of edges of each colour.
    """
    distinct: dict[tuple[tuple[Monomial, Fraction], ...], None] = {}
    for multiple in frame.multiples(order):
        terms = tuple(sorted(frame.averaged(multiple).items()))
        if terms:
            distinct[terms] = None
    return [dict(terms) for terms in distinct]


def solve_moment_equations(frame: Frame, order: int) -> LinearMoments:
    """Solve the moment equations exactly.

    Parameters
    ----------
    frame
        The Jacobians in question.
    order
        Largest number of edges of each colour.
    """
    graphs = classes(frame.joints, order, loops=frame.diagonal)
    number = {graph: place for place, graph in enumerate(graphs)}
    equations = averaged_equations(frame, order)
    # Short equations first keep the rows of the elimination short.
    rows = sorted(
        ({number[graph]: value for graph, value in terms.items()} for terms in equations),
        key=len,
    )
    result = eliminate(rows)
    free = [c for c in range(1, len(graphs)) if c not in result.solved]
    solution = {}
    if result.consistent:
        for graph, c in number.items():
            row = result.solved.get(c, {c: Fraction(1)})
            solution[graph] = tuple(row.get(k, Fraction(0)) for k in (0, *free))
    return LinearMoments(
        frame=frame,
        order=order,
        classes=graphs,
        equations=len(equations),
        rank=result.rank,
        consistent=result.consistent,
        free=tuple(graphs[c] for c in free) if result.consistent else (),
        solution=solution,
    )
