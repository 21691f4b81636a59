"""The equations hold where they must: at true isotropic Jacobians of other arms."""

from collections.abc import Callable
from itertools import combinations_with_replacement, permutations

import numpy as np
import pytest
from numpy.typing import NDArray

from formulations.existence.equations import Equation, Frame
from formulations.existence.graphs import ONE, Monomial

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
    rows = [Equation("row-sum", (i,)) for i in range(frame.joints)] if frame.redundant else []
    entries = list(combinations_with_replacement(range(frame.joints), 2))
    return [
        *rows,
        *(Equation("square", entry) for entry in entries),
        *(Equation("tight-frame", entry) for entry in entries),
    ]


def isotropic_six():
    """Z and W of an isotropic 6R with unit revolute joints: v = e_i and ω = ±e_(i+1)."""
    e = np.eye(3)
    z = np.array([e[i] + s * 1j * e[(i + 1) % 3] for i in range(3) for s in (1, -1)]).T
    z /= np.sqrt(2)
    return z, np.round(2 * (z.T @ z)) / 2


def rotated_simplex(seed):
    """Z and W of the 6×7 simplex (the free-column optimum) in a random frame."""
    complement = np.linalg.svd(np.ones((1, 7)))[2][1:]
    rotation = np.linalg.qr(np.random.default_rng(seed).standard_normal((6, 6)))[0]
    j = rotation @ complement
    z = j[:3] + 1j * j[3:]
    return z, z.T @ z


def test_isotropic_six_is_a_true_unit_revolute_solution():
    z, w = isotropic_six()
    j = np.vstack([z.real, z.imag])
    np.testing.assert_allclose(j @ j.T, np.eye(6), atol=1e-15)
    np.testing.assert_allclose(np.diag(z.T @ z), 0, atol=1e-15)
    np.testing.assert_allclose(w, z.T @ z, atol=1e-15)
    frame = Frame(6, 6)
    assert all(value(frame.polynomial(equation), w) == 0 for equation in places(frame))


@pytest.mark.parametrize("seed", range(5))
def test_rotated_simplex_satisfies_everything_but_the_diagonal(seed):
    _, w = rotated_simplex(seed)
    kept = Frame(7, 6, diagonal=True)
    assert max(abs(value(kept.polynomial(equation), w)) for equation in places(kept)) < 1e-14
    dropped = Frame(7, 6)
    assert (
        max(abs(value(dropped.polynomial(equation), w)) for equation in places(dropped)) > 0.01
    )
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
        expected = sides[equation.kind](*equation.place)
        assert value(frame.polynomial(equation), w) == pytest.approx(expected)


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


def test_true_solution_satisfies_every_averaged_multiple():
    """Averages over all orders of six joints, in halves: exact in floating point."""
    _, w = isotropic_six()
    orders = np.array(list(permutations(range(6))))
    frame = Frame(6, 6)

    def mean(graph):
        term = np.ones(len(orders), dtype=complex)
        for i, j in graph.w:
            term = term * w[orders[:, i], orders[:, j]]
        for i, j in graph.wbar:
            term = term * w[orders[:, i], orders[:, j]].conj()
        return float(term.real.sum() / len(orders))

    known: dict[Monomial, float] = {}
    for multiple in frame.multiples(3):
        averaged = frame.averaged(multiple)
        for graph in averaged:
            if graph not in known:
                known[graph] = mean(graph)
        total = sum(float(value) * known[graph] for graph, value in averaged.items())
        assert abs(total) < 1e-12
    assert known[ONE] == 1
    assert len(known) > 500
