from fractions import Fraction
from itertools import permutations

import pytest

from formulations.existence.derive import (
    TABLEAU,
    squared_polynomials,
    symmetrised,
)
from formulations.existence.equations import (
    ONE,
    Monomial,
    class_sums,
    collected,
    combined,
    hermitian_product,
)

TRIANGLE = Monomial(((0, 1), (0, 2), (1, 2)), ((0, 1), (0, 2), (1, 2)))
TRIANGLES = 35


def test_derivation_is_byte_identical_to_the_committed_copy(derived, committed):
    assert derived.to_json().encode() == committed.read_bytes()


def test_weights_and_constant(derived):
    assert [square.weight for square in derived.squares] == [108, 25]
    assert derived.constant == Fraction(33248, 1029)
    assert len(derived.multipliers) == 351
    assert max(m.coefficient.denominator for m in derived.multipliers) <= 8820


def test_symmetrised_monomials_have_48_and_96_terms_of_coefficient_one():
    p1, q = squared_polynomials()
    p2 = combined([(Fraction(1), q), (Fraction(-3), p1)])
    assert (len(p1), len(p2), len(q)) == (48, 96, 144)
    assert {abs(value) for value in (*p1.values(), *p2.values())} == {1}
    assert {len(monomial.w) - len(monomial.wbar) for monomial in q} == {1}


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


@pytest.mark.parametrize(
    ("factor", "contradicts"), [(1, False), (2, True), (3, True), (4, True)]
)
def test_which_second_squares_would_do(seven, factor, contradicts):
    p1, q = squared_polynomials()
    other = combined([(Fraction(factor - 3), p1), (Fraction(1), q)])
    p, r = (seven.divide(class_sums(hermitian_product(s, s)))[1] for s in (p1, other))
    assert (p[ONE] / p[TRIANGLE] > r[ONE] / r[TRIANGLE]) is contradicts


def test_an_entry_alone_has_no_part_of_the_type():
    """Pairs of joints carry the types (7), (6,1) and (5,2) only."""
    assert symmetrised(TABLEAU, Monomial(((0, 3),))) == {}
