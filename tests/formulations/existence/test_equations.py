"""Monomials as graphs, and equations that hold at true isotropic Jacobians of other arms."""

from collections.abc import Callable
from itertools import combinations, combinations_with_replacement, permutations, product
from math import prod

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockedjoint.formulations.existence.equations import (
    Frame,
    Monomial,
    canonical,
    coloured_graphs,
)
from tests.formulations.existence.graph_classes import classes


def value(polynomial, w):
    total = 0j
    for monomial, coefficient in polynomial.items():
        factors = [w[pair] for pair in monomial.w] + [w[pair].conj() for pair in monomial.wbar]
        total += prod(factors, start=complex(coefficient))
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


pairs = st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), max_size=4).map(tuple)
monomials = st.builds(Monomial, pairs, pairs)


@given(monomials, st.permutations(range(7)))
def test_canonical_form_does_not_depend_on_labels_or_conjugation(monomial, order):
    moved = monomial.relabel(tuple(order))
    assert canonical(moved, swap_colours=False) == canonical(monomial, swap_colours=False)
    assert canonical(moved.conjugate()) == canonical(monomial)
    assert canonical(canonical(monomial)) == canonical(monomial)


@given(monomials)
def test_canonical_form_is_a_relabelling(monomial):
    same = {
        monomial.relabel(dict(zip(monomial.vertices, names, strict=True)))
        for names in permutations(range(len(monomial.vertices)))
    }
    assert canonical(monomial, swap_colours=False) in same


def brute_force(joints, edges, loops):
    """Orbits of all balanced monomials, found by trying every permutation and the swap."""
    choose = combinations_with_replacement if loops else combinations
    sides = list(combinations_with_replacement(list(choose(range(joints), 2)), edges))
    orbits: dict[Monomial, set[Monomial]] = {}
    for monomial in (Monomial(w, wbar) for w in sides for wbar in sides):
        orbit = {monomial.relabel(order) for order in permutations(range(joints))}
        least = min(orbit | {member.conjugate() for member in orbit})
        orbits.setdefault(least, set()).update(orbit)
    return orbits


@pytest.mark.parametrize(
    ("joints", "edges", "loops"), [(4, 2, False), (3, 3, False), (3, 2, True)]
)
def test_classes_agree_with_brute_force(joints, edges, loops):
    orbits = brute_force(joints, edges, loops)
    graphs = classes(joints, edges, loops=loops)
    listed = [graph for graph in graphs if graph.degree == 2 * edges]
    assert {canonical(least) for least in orbits} == set(listed)
    assert len(orbits) == len(listed)


def test_orbits_add_up_to_all_monomials():
    """Charge 1 at order 3 on seven joints: 231 pairs of entries times 21 entries."""
    orders = list(permutations(range(7)))
    members = [{graph.relabel(order) for order in orders} for graph in coloured_graphs(7, 2, 1)]
    assert sum(map(len, members)) == len(set().union(*members)) == 231 * 21
