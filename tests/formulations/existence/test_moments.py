"""The moment equations solved, against linear algebra and the averages of true solutions."""

from fractions import Fraction
from itertools import permutations

import numpy as np
import pytest

from lockedjoint.formulations.existence.derive import rewriting
from lockedjoint.formulations.existence.equations import ONE, Frame, solved_for, substituted
from tests.formulations.existence.graph_classes import classes


def solved(frame, order):
    """Return the classes, those whose moments stay free, and all as combinations of these."""
    equations = rewriting(frame, order)
    graphs = classes(frame.joints, order, loops=frame.diagonal)
    assert equations.consistent
    rest = {graph: solved_for(graph, one) for graph, (one, _) in equations.relations.items()}
    free = [graph for graph in graphs if graph not in equations.rules.keys() | rest.keys()]
    rewritten = (substituted({graph: Fraction(1)}, equations.rewritten) for graph in graphs)
    values = [substituted(one, rest) for one in rewritten]
    return graphs, free, np.array([[float(v.get(k, 0)) for k in free] for v in values])


@pytest.mark.parametrize(
    ("frame", "order"), [(Frame(7, 6), 2), (Frame(6, 6), 2), (Frame(7, 6, True), 2)]
)
def test_the_solution_of_the_equations_is_the_whole_one(frame, order):
    graphs, free, coefficients = solved(frame, order)
    place = {graph: k for k, graph in enumerate(graphs)}
    averaged = {frozenset(frame.averaged(m).items()) for m in frame.multiples(order)}
    averaged.discard(frozenset())
    matrix = np.zeros((len(averaged), len(place)))
    for row, terms in zip(matrix, averaged, strict=True):
        for graph, value in terms:
            row[place[graph]] = float(value)
    assert np.linalg.matrix_rank(matrix) == np.linalg.matrix_rank(matrix[:, 1:])
    assert free[0] == ONE
    assert len(free) == len(place) - np.linalg.matrix_rank(matrix)
    np.testing.assert_allclose(matrix @ coefficients, 0, atol=1e-12)
    np.testing.assert_array_equal(coefficients[[place[one] for one in free]], np.eye(len(free)))


def assert_solved_by(solution, w):
    """Check that the averages of W over all orders of the joints are such moments."""
    graphs, free, coefficients = solution
    orders = np.array(list(permutations(range(len(w))))).T
    values = {}
    for graph in graphs:
        terms = [np.ones(orders.shape[1]), *(w[orders[i], orders[j]] for i, j in graph.w)]
        terms += [w[orders[i], orders[j]].conj() for i, j in graph.wbar]
        values[graph] = float(np.mean(np.prod(terms, axis=0).real))
    known = coefficients @ [values[one] for one in free]
    np.testing.assert_allclose(known, list(values.values()), atol=1e-9)


@pytest.mark.parametrize("order", [2, pytest.param(3, marks=pytest.mark.long)])
def test_isotropic_6r_satisfies_the_equations_and_no_other_matrix(
    solution_6r, printed_6r, order
):
    solution = solved(Frame(6, 6), order)
    for w in (printed_6r, solution_6r(0)):
        assert_solved_by(solution, w)
    with pytest.raises(AssertionError):
        assert_solved_by(solution, 1.001 * solution_6r(0))


def test_rotated_simplices_satisfy_the_equations_with_the_diagonal_kept(solution_simplex):
    w = solution_simplex(0)
    assert np.abs(np.diag(w)).max() > 0.1
    assert_solved_by(solved(Frame(7, 6, diagonal=True), 2), w)


@pytest.mark.parametrize(("joints", "rows", "order"), [(3, 2, 1), (5, 4, 2)])
def test_small_impossible_cases(joints, rows, order):
    assert not rewriting(Frame(joints, rows), order).consistent
    assert rewriting(Frame(joints, rows, True), order).consistent
    if order > 1:
        assert rewriting(Frame(joints, rows), order - 1).consistent
