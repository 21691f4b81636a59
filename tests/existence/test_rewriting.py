from fractions import Fraction

import pytest

from formulations.existence.derive import rewriting
from formulations.existence.equations import ONE, Frame, Monomial, canonical, classes, combined


def test_seven_joints_order_two_determines_every_moment():
    equations = rewriting(Frame(7, 6), 2)
    assert equations.consistent
    assert len(equations.rules) + len(equations.relations) == 42
    for graph in classes(7, 2):
        assert equations.divide({graph: Fraction(1)})[1].keys() <= {ONE}


def test_seven_joints_order_three_leaves_two_moments_free(seven):
    assert seven.consistent
    assert len(seven.rules) == 734
    assert len(classes(7, 3)) - len(seven.rules) == 26
    assert len(seven.rules) + len(seven.relations) == 757
    free = set(classes(7, 3)) - seven.rules.keys() - seven.relations.keys()
    triangle, edge = ((0, 1), (0, 2), (1, 2)), ((0, 1),) * 3
    assert free == {ONE, Monomial(triangle, triangle), Monomial(edge, edge)}


def test_division_is_an_identity(seven):
    for graph in classes(7, 3)[40::60]:
        quotients, remainder = seven.divide({graph: Fraction(1)})
        multiples = [(value, seven.averaged[m]) for m, value in quotients.items()]
        assert combined([*multiples, (Fraction(1), remainder)]) == {graph: 1}


def test_a_leaf_vanishes_into_smaller_graphs(seven):
    """Σ_j W_0j conj(W_01) = 0 makes the path −1/5 of the double edge: five joints are free."""
    path = canonical(Monomial(((0, 2),), ((0, 1),)))
    assert seven.rewritten[path].keys() == {ONE}
    double = seven.rewritten[Monomial(((0, 1),), ((0, 1),))]
    assert double == {ONE: Fraction(2, 7)}
    assert seven.rewritten[path] == {ONE: Fraction(-2, 35)}


@pytest.mark.parametrize(
    ("frame", "order", "consistent"),
    [
        (Frame(3, 2), 1, False),
        (Frame(5, 4), 1, True),
        (Frame(5, 4), 2, False),
        (Frame(6, 6), 2, True),
        (Frame(6, 6), 3, True),
        (Frame(7, 6), 1, True),
        (Frame(7, 6, diagonal=True), 2, True),
    ],
)
def test_which_equations_alone_are_contradictory(frame, order, consistent):
    assert rewriting(frame, order).consistent is consistent
