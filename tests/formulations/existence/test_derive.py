"""The division and its certificate; what docs/nonexistence.md says is true."""

import re
from fractions import Fraction
from importlib.resources import files
from itertools import permutations
from pathlib import Path

import pytest

from lockedjoint.formulations.existence.derive import rewriting, squared_polynomials
from lockedjoint.formulations.existence.equations import (
    ONE,
    Frame,
    Monomial,
    canonical,
    class_sums,
    collected,
    combined,
    hermitian_product,
)
from tests.formulations.existence.graph_classes import classes

TRIANGLE = Monomial(((0, 1), (0, 2), (1, 2)), ((0, 1), (0, 2), (1, 2)))


def test_derivation_is_byte_identical_to_the_copies_on_file(derived, committed):
    packaged = files("lockedjoint.formulations.existence") / "certificate.json"
    assert derived.to_json().encode() == committed.read_bytes() == packaged.read_bytes()


def moved(polynomial, order):
    return collected((m.relabel(order), value) for m, value in polynomial.items())


def test_squares_have_the_type_of_their_tableau():
    """Antisymmetric in the columns, and killed by symmetrising any four joints."""
    for polynomial in squared_polynomials():
        for i, j in ((0, 3), (3, 6), (1, 4), (2, 5)):
            swap = tuple({i: j, j: i}.get(k, k) for k in range(7))
            negative = {m: -value for m, value in polynomial.items()}
            assert moved(polynomial, swap) == negative
        for four in ((0, 1, 2, 3), (0, 1, 4, 6), (3, 4, 5, 6)):
            orders = [dict(zip(four, images, strict=True)) for images in permutations(four)]
            images = [tuple(order.get(k, k) for k in range(7)) for order in orders]
            assert not combined((Fraction(1), moved(polynomial, image)) for image in images)


@pytest.mark.parametrize(("factor", "contradicts"), [(1, False), (2, True)])
def test_which_second_squares_would_do(seven, factor, contradicts):
    p1, q = squared_polynomials()
    other = combined([(Fraction(factor - 3), p1), (Fraction(1), q)])
    p, r = (seven.divide(class_sums(hermitian_product(s, s)))[1] for s in (p1, other))
    assert (p[ONE] / p[TRIANGLE] > r[ONE] / r[TRIANGLE]) is contradicts


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


@pytest.fixture(scope="module")
def page():
    return (Path(__file__).parents[3] / "docs" / "nonexistence.md").read_text()


@pytest.mark.long
def test_the_program_on_the_page_proves_the_identity(page, lockedjoint):
    code = re.search(r"```python\n(.*?)```", page, re.DOTALL)[1]
    said = "The identity holds: no optimally failure-tolerant 7R Jacobian exists.\n"
    assert lockedjoint.python(code) == said


@pytest.mark.parametrize(
    ("graph", "value"),
    [
        (Monomial(((0, 1),), ((0, 1),)), Fraction(2, 7)),
        (Monomial(((0, 2),), ((0, 1),)), Fraction(-2, 35)),
        (Monomial(((0, 1),), ((2, 3),)), Fraction(1, 35)),
        (Monomial(((0, 1), (0, 1)), ((0, 1), (0, 1))), Fraction(2, 21)),
        (Monomial(((0, 1), (0, 2)), ((0, 1), (0, 2))), Fraction(58, 735)),
        (Monomial(((0, 1), (2, 3)), ((0, 1), (2, 3))), Fraction(61, 735)),
    ],
)
def test_the_table_of_averages(graph, value, page):
    equations = rewriting(Frame(7, 6), 2)
    assert equations.divide({canonical(graph): Fraction(1)})[1] == {ONE: value}
    assert str(value).replace("-", "−") in page


def test_the_two_affine_functions_of_tau(seven):
    p, q = (seven.divide(class_sums(hermitian_product(s, s)))[1] for s in squared_polynomials())
    (triangle,) = p.keys() - {ONE}
    assert (p[ONE], p[triangle] / 35) == (Fraction(32488, 7203), Fraction(-40, 7))
    assert (q[ONE], q[triangle] / 35) == (Fraction(-748288, 36015), Fraction(864, 35))
    assert 108 * p[ONE] + 25 * q[ONE] == Fraction(-33248, 1029)
    # τ has an upper bound below its lower one.
    assert -35 * p[ONE] / p[triangle] == Fraction(28427, 36015)
    assert -35 * q[ONE] / q[triangle] == Fraction(163688, 194481)
