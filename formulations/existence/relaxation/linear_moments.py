"""What the equations of an isotropic Jacobian leave free of its averaged moments.

Every equation times every monomial, averaged, is a linear equation between the moments of
classes of graphs. Solved over the rationals, so that a rank is exact, they give each moment as
a combination of 1 and a few free moments.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from formulations.existence.equations import Frame, Polynomial, solved_for, substituted
from formulations.existence.graphs import ONE, Monomial, by_degree, classes
from nlp.arrays import FloatArray


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
        Each class as a combination of 1 and the free ones. Empty if no moments satisfy the
        equations.
    """

    frame: Frame
    order: int
    classes: tuple[Monomial, ...]
    equations: int
    rank: int
    free: tuple[Monomial, ...]
    solution: Mapping[Monomial, Polynomial]

    @property
    def consistent(self) -> bool:
        """Whether any moments satisfy the equations."""
        return bool(self.solution)

    def coefficients(self) -> FloatArray:
        """Return the solution as floats: a row per class, a column for 1 and each free one."""
        known = (ONE, *self.free)
        return np.array(
            [[float(self.solution[g].get(k, 0)) for k in known] for g in self.classes]
        )

    def limits(self) -> FloatArray:
        """Return limits Y_k of the absolute values of the free moments of every solution.

        The tight-frame equation (i, i) is Σ_j |W_ij|² = 2 P_ii, so |W_ij|² ≤ 2 P_ii.
        """
        square = 2 * float(self.frame.projector(0, 0))
        return np.array([square ** len(graph.w) for graph in self.free])


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
    averaged = (frame.averaged(multiple) for multiple in frame.multiples(order))
    equations = {frozenset(terms.items()): terms for terms in averaged if terms}
    # Short equations first keep the rows of the elimination short.
    solved = eliminate(sorted(equations.values(), key=len))
    consistent = ONE not in solved
    free = [graph for graph in graphs[1:] if graph not in solved] if consistent else []
    solution = {graph: solved.get(graph, {graph: Fraction(1)}) for graph in graphs}
    return LinearMoments(
        frame=frame,
        order=order,
        classes=graphs,
        equations=len(equations),
        rank=len(solved.keys() - {ONE}),
        free=tuple(free),
        solution=solution if consistent else {},
    )


def eliminate(equations: Iterable[Polynomial]) -> dict[Monomial, Polynomial]:
    """Solve linear equations between monomials, those of the highest degree first.

    Parameters
    ----------
    equations
        The polynomials that are zero.

    Returns
    -------
    dict
        For every determined monomial, its value as a combination of the undetermined ones. It
        has the key 1 exactly if the equations imply 1 = 0, a contradiction.
    """
    solved: dict[Monomial, Polynomial] = {}
    for equation in equations:
        rest = substituted(equation, solved)
        if rest:
            last = max(rest, key=by_degree)
            solved[last] = solved_for(last, rest)
    for last in sorted(solved, key=by_degree):
        solved[last] = substituted(solved[last], solved)
    return solved
