"""Monomials as arrays, linear equations in floating point, blocks against the whole matrix."""

from dataclasses import replace
from itertools import combinations_with_replacement, permutations, product

import numpy as np
import pytest

from formulations.existence.derive import solve_moment_equations
from formulations.existence.equations import CHARGE, Frame, Monomial, canonical
from formulations.existence.relaxation import EdgeMultisets, moment_blocks
from formulations.existence.tableaux import adapted_bases, standard_tableaux

NONE = np.zeros(0)


def monomials(multisets, charge, degree):
    """Return all monomials of a charge up to a degree, in the order of the rows."""
    edges = list(zip(*(axis.tolist() for axis in multisets.edges), strict=True))
    factors = [
        tuple(e for e, count in zip(edges, counts, strict=True) for _ in range(count))
        for counts in multisets.multiplicities
    ]
    rows = zip(*multisets.rows(charge), strict=True)
    found = [Monomial(factors[w], factors[wbar]) for w, wbar in rows]
    return [monomial for monomial in found if monomial.degree <= degree]


def multiples_of_equations(multisets, frame, charge):
    """Return every multiple of an equation or its conjugate among the rows, as row vectors."""
    every = {c: monomials(multisets, abs(c), multisets.order) for c in range(-3, 4)}
    for c in (-3, -2, -1):
        every[c] = [monomial.conjugate() for monomial in every[c]]
    place = {row: k for k, row in enumerate(every[charge])}
    vectors = []
    entries = list(combinations_with_replacement(range(frame.joints), 2))
    equations = [*product(("square", "tight-frame"), entries)]
    if frame.redundant:
        equations += [("row-sum", (joint,)) for joint in range(frame.joints)]
    for kind, indices in equations:
        terms, own = frame.polynomial(kind, indices), CHARGE[kind]
        conjugate = {term.conjugate(): value for term, value in terms.items()}
        for polynomial, sign in ((terms, 1), (conjugate, -1)):
            degree = max((term.degree for term in terms), default=multisets.order + 1)
            for factor in every.get(charge - sign * own, []):
                if factor.degree + degree <= multisets.order:
                    vectors.append(np.zeros(len(place)))
                    for term, value in polynomial.items():
                        vectors[-1][place[factor * term]] = float(value)
    return np.array(vectors).reshape(-1, len(place))


def values_of(rows, w):
    return np.array(
        [
            np.prod([w[e] for e in row.w]) * np.prod([w[e].conj() for e in row.wbar])
            for row in rows
        ]
    )


def repeated_eigenvalues(blocks, charge, free):
    """Return the eigenvalues of the blocks of a charge, as often as they have tableaux."""
    return np.concatenate(
        [
            np.repeat(np.linalg.eigvalsh(block.at(free)), len(standard_tableaux(block.shape)))
            for block in blocks
            if block.charge == charge
        ]
    )


def assert_eigenvalues_but_for_zeros(matrix, others):
    zeros = np.zeros(len(matrix) - len(others))
    expected = np.sort(np.concatenate([zeros, others]))
    np.testing.assert_allclose(np.linalg.eigvalsh(matrix), expected, atol=1e-10)


@pytest.mark.parametrize(
    ("frame", "order"),
    [(Frame(7, 6), 2), (Frame(6, 6), 2), (Frame(7, 6, True), 2), (Frame(3, 2), 1)],
)
def test_the_solution_of_the_equations_is_the_whole_one(frame, order):
    moments = solve_moment_equations(frame, order)
    place = {graph: k for k, graph in enumerate(moments.classes)}
    averaged = {frozenset(frame.averaged(m).items()) for m in frame.multiples(order)}
    averaged.discard(frozenset())
    matrix = np.zeros((len(averaged), len(place)))
    for row, terms in zip(matrix, averaged, strict=True):
        for graph, value in terms:
            row[place[graph]] = float(value)
    assert moments.equations == len(averaged)
    assert moments.rank == np.linalg.matrix_rank(matrix[:, 1:])
    assert moments.consistent == (np.linalg.matrix_rank(matrix) == moments.rank)
    if moments.consistent:
        assert moments.coefficients.shape == (len(place), 1 + len(moments.free))
        assert len(moments.free) == len(place) - 1 - moments.rank
        np.testing.assert_allclose(matrix @ moments.coefficients, 0, atol=1e-12)
        known = [0, *(place[graph] for graph in moments.free)]
        np.testing.assert_array_equal(moments.coefficients[known], np.eye(len(known)))


@pytest.fixture(scope="module")
def square():
    moments = solve_moment_equations(Frame(6, 6), 2)
    return moments, moment_blocks(moments)


@pytest.mark.parametrize("charge", [0, 1, 2])
def test_blocks_have_the_eigenvalues_of_the_whole_matrix(square, charge):
    moments, blocks = square
    free = np.random.default_rng(charge).standard_normal(len(moments.free))
    values = moments.coefficients @ [1.0, *free]
    by_class = dict(zip(moments.classes, values, strict=True))
    rows = monomials(EdgeMultisets(6, 2), charge, 2)
    whole = np.array([[by_class[canonical(u.conjugate() * v)] for v in rows] for u in rows])
    assert_eigenvalues_but_for_zeros(whole, repeated_eigenvalues(blocks, charge, free))


@pytest.mark.parametrize("charge", [0, 1, 2])
def test_blocks_of_a_true_solution_are_its_averages(solution_6r, averages, square, charge):
    moments, w = square[0], solution_6r(charge)
    multisets = EdgeMultisets(6, 2)
    own = averages(multisets, moments.classes, w)[:, None]
    blocks = moment_blocks(replace(moments, free=(), coefficients=own))
    rows = monomials(multisets, charge, 2)
    orders = [np.array(order) for order in permutations(range(6))]
    values = np.array([values_of(rows, w[np.ix_(order, order)]) for order in orders])
    direct = (values.conj().T @ values).real / len(orders)
    found = repeated_eigenvalues(blocks, charge, NONE)
    assert_eigenvalues_but_for_zeros(direct, found)
    assert found.min() > 0


@pytest.mark.parametrize("charge", [0, 1, 2])
def test_what_vanishes_in_the_blocks_is_what_the_equations_say(order_2, charge):
    multisets, frame = EdgeMultisets(7, 2), Frame(7, 6)
    vanishing = multiples_of_equations(multisets, frame, charge)
    bases = adapted_bases(*multisets.exchanges(multisets.rows(charge)))
    left = {
        shape: basis.shape[1] - int(np.linalg.matrix_rank(vanishing @ basis, tol=1e-8))
        for (shape,), basis in bases.items()
    }
    found = {block.shape: block.size for block in order_2.blocks if block.charge == charge}
    assert found == {shape: size for shape, size in left.items() if size}


def test_multiples_of_equations_vanish_at_solutions(solution_6r, solution_simplex):
    for frame, w in (
        (Frame(6, 6), solution_6r(1)),
        (Frame(7, 6, diagonal=True), solution_simplex(1)),
    ):
        multisets = EdgeMultisets(frame.joints, 2, frame.diagonal)
        for charge in (0, 2):
            rows = monomials(multisets, charge, 2)
            vanishing = multiples_of_equations(multisets, frame, charge)
            assert np.abs(vanishing @ values_of(rows, w)).max() < 1e-12
            # At a matrix that is no solution they do not vanish.
            assert np.abs(vanishing @ values_of(rows, w + 0.1)).max() > 1e-3
