"""What the equations of an isotropic Jacobian leave free of its averaged moments.

Every equation times every monomial, averaged, is a linear equation between the moments of
classes of graphs. Solved over the rationals, so that a rank is exact, they give each moment as
a combination of 1 and a few free moments.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from formulations.existence.equations import Frame, Polynomial
from formulations.existence.graphs import Monomial, classes

Row: TypeAlias = dict[int, Fraction]


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
    free
        The classes whose moments are free.
    solution
        For each class the coefficients of 1 and of the free moments. Empty if no moments
        satisfy the equations.
    """

    frame: Frame
    order: int
    classes: tuple[Monomial, ...]
    equations: int
    rank: int
    free: tuple[Monomial, ...]
    solution: Mapping[Monomial, tuple[Fraction, ...]]

    @property
    def consistent(self) -> bool:
        """Whether any moments satisfy the equations."""
        return bool(self.solution)

    def coefficients(self) -> NDArray[np.float64]:
        """Return the solution as floats: a row per class, a column for 1 and each free one."""
        rows = [[float(v) for v in self.solution[graph]] for graph in self.classes]
        return np.array(rows).reshape(len(self.classes), 1 + len(self.free))


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
    equations = _averaged_equations(frame, order)
    rows = [{number[graph]: value for graph, value in terms.items()} for terms in equations]
    # Short equations first keep the rows of the elimination short.
    solved = eliminate(sorted(rows, key=len))
    consistent = 0 not in solved
    free = [c for c in range(1, len(graphs)) if c not in solved] if consistent else []
    solution = {}
    if consistent:
        for graph, c in number.items():
            row = solved.get(c, {c: Fraction(1)})
            solution[graph] = tuple(row.get(k, Fraction(0)) for k in (0, *free))
    return LinearMoments(
        frame=frame,
        order=order,
        classes=graphs,
        equations=len(equations),
        rank=len(solved.keys() - {0}),
        free=tuple(graphs[c] for c in free),
        solution=solution,
    )


def _averaged_equations(frame: Frame, order: int) -> list[Polynomial]:
    """Return the distinct linear equations between class moments: each sum is zero."""
    averaged = (frame.averaged(multiple) for multiple in frame.multiples(order))
    distinct = dict.fromkeys(tuple(sorted(terms.items())) for terms in averaged if terms)
    return [dict(terms) for terms in distinct]


def eliminate(rows: Iterable[Mapping[int, Fraction]]) -> dict[int, Row]:
    """Solve the equations Σ_c row[c]·x_c = 0 in which x_0 = 1, the last unknowns first.

    Parameters
    ----------
    rows
        Coefficients of the unknowns, by number; unknown 0 is the constant 1.

    Returns
    -------
    dict
        For every determined unknown, its value as a combination of x_0 and the undetermined
        unknowns. It has the key 0 exactly if the equations imply x_0 = 0, a contradiction.
    """
    leading: dict[int, Row] = {}
    for given in rows:
        row = dict(given)
        while row:
            last = max(row)
            if last not in leading:
                scale = row.pop(last)
                # Kept solved for its last unknown: x_last = Σ leading[last][c]·x_c.
                leading[last] = {c: -value / scale for c, value in row.items()}
                break
            _add(row, leading[last], row.pop(last))
    solved: dict[int, Row] = {}
    for last in sorted(leading):
        solved[last] = {}
        for c, value in leading[last].items():
            _add(solved[last], solved.get(c, {c: Fraction(1)}), value)
    return solved


def _add(row: Row, other: Mapping[int, Fraction], factor: Fraction) -> None:
    """Add a multiple of another row in place, and drop what cancels."""
    for c, value in other.items():
        total = row.get(c, 0) + factor * value
        if total:
            row[c] = Fraction(total)
        else:
            row.pop(c, None)
