"""The equations hold where they must: at true isotropic Jacobians of other arms."""

from collections.abc import Callable
from itertools import combinations_with_replacement, product

import numpy as np
import pytest
from numpy.typing import NDArray

from formulations.existence.equations import Frame

Matrix = NDArray[np.complex128]


def value(polynomial, w):
    total = 0j
    for monomial, coefficient in polynomial.items():
        term = complex(coefficient)
        for pair in monomial.w:
            term *= w[pair]
        for pair in monomial.wbar:
            term *= w[pair].conjugate()
        total += term
    return total


def places(frame):
    rows = [("row-sum", (i,)) for i in range(frame.joints)] if frame.redundant else []
    entries = list(combinations_with_replacement(range(frame.joints), 2))
    return [*rows, *product(("square", "tight-frame"), entries)]


def test_an_isotropic_6r_satisfies_everything(printed_6r):
    frame = Frame(6, 6)
    w = np.round(2 * printed_6r) / 2  # its entries are halves: no rounding
    np.testing.assert_allclose(w, printed_6r, atol=1e-15)
    assert all(value(frame.polynomial(*equation), w) == 0 for equation in places(frame))


@pytest.mark.parametrize("seed", range(5))
def test_a_rotated_simplex_satisfies_everything_but_the_diagonal(seed, solution_simplex):
    w = solution_simplex(seed)
    kept, dropped = Frame(7, 6, diagonal=True), Frame(7, 6)
    assert max(abs(value(kept.polynomial(*one), w)) for one in places(kept)) < 1e-13
    assert max(abs(value(dropped.polynomial(*one), w)) for one in places(dropped)) > 0.01
    assert np.abs(np.diag(w)).max() > 0.01


def test_equations_are_the_matrix_identities_at_any_matrix():
    generator = np.random.default_rng(0)
    half = generator.standard_normal((7, 7)) + 1j * generator.standard_normal((7, 7))
    w = half + half.T
    np.fill_diagonal(w, 0)
    product = w @ w.conj()
    tight = product + product.conj() - 4 * (np.eye(7) - 1 / 7)
    sides: dict[str, Callable[..., complex]] = {
        "row-sum": lambda i: w.sum(axis=1)[i],
        "square": lambda i, j: (w @ w)[i, j],
        "tight-frame": lambda i, j: tight[i, j],
    }
    frame = Frame(7, 6)
    for equation in places(frame):
        kind, place = equation
        expected = sides[kind](*place)
        assert value(frame.polynomial(*equation), w) == pytest.approx(expected)


def test_multiples_stay_within_the_order_and_are_balanced():
    frame = Frame(7, 6)
    for multiple in frame.multiples(2):
        for monomial in frame.averaged(multiple):
            assert len(monomial.w) == len(monomial.wbar)
            assert monomial.degree <= 4


def test_2430_different_averaged_multiples_at_order_three():
    frame = Frame(7, 6)
    assert len({frozenset(frame.averaged(m).items()) for m in frame.multiples(2)}) == 85
    assert len({frozenset(frame.averaged(m).items()) for m in frame.multiples(3)}) == 2430
