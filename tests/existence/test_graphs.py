from itertools import combinations, combinations_with_replacement, permutations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from formulations.existence.equations import ONE, Monomial, canonical, classes, coloured_graphs

pairs = st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), max_size=4).map(tuple)
monomials = st.builds(Monomial, pairs, pairs)


@pytest.mark.parametrize(("order", "count"), [(0, 1), (1, 4), (2, 43), (3, 760)])
def test_class_counts_for_seven_joints(order, count):
    assert len(classes(7, order)) == count


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
    listed = [
        graph for graph in classes(joints, edges, loops=loops) if graph.degree == 2 * edges
    ]
    assert {canonical(least) for least in orbits} == set(listed)
    assert len(orbits) == len(listed)


def test_orbits_add_up_to_all_monomials():
    """Charge 1 at order 3 on seven joints: 231 pairs of entries times 21 entries."""
    orders = list(permutations(range(7)))
    members = [{graph.relabel(order) for order in orders} for graph in coloured_graphs(7, 2, 1)]
    assert sum(map(len, members)) == len(set().union(*members)) == 231 * 21


def test_monomials_multiply_and_know_their_size():
    product = Monomial(w=((3, 1),)) * Monomial(w=((0, 2),), wbar=((5, 4),))
    assert product == Monomial(((0, 2), (1, 3)), ((4, 5),))
    assert product.degree == 3
    assert product.vertices == (0, 1, 2, 3, 4, 5)
    assert product * ONE == product
    assert hash(product) == hash(Monomial(((1, 3), (2, 0)), ((4, 5),)))
