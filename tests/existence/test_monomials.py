"""Numbers of monomials against the monomials themselves."""

from collections.abc import Callable
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from formulations.existence.equations import Monomial, canonical, classes
from formulations.existence.moments import EdgeMultisets

MULTISETS = EdgeMultisets(5, 2, True)
CLASSES = classes(5, 2, loops=True)
TABLE = MULTISETS.class_table(CLASSES)
Averages = Callable[
    [EdgeMultisets, tuple[Monomial, ...], NDArray[np.complex128]], NDArray[np.float64]
]

pairs = st.tuples(st.integers(0, 4), st.integers(0, 4))


def number(multisets, edges):
    """Return the number of a multiset of edges by counting them."""
    i, j = multisets.edges
    counts = [edges.count((int(a), int(b))) for a, b in zip(i, j, strict=True)]
    [found] = np.flatnonzero((multisets.multiplicities == counts).all(axis=1))
    return int(found)


@given(st.integers(0, 2), st.data())
def test_the_table_knows_the_class_of_every_monomial(edges, data):
    factors = st.lists(pairs, min_size=edges, max_size=edges)
    monomial = Monomial(tuple(data.draw(factors)), tuple(data.draw(factors)))
    w, wbar = number(MULTISETS, monomial.w), number(MULTISETS, monomial.wbar)
    assert CLASSES[TABLE[w, wbar]] == canonical(monomial)


@pytest.mark.parametrize(("joints", "order", "loops"), [(5, 2, True), (6, 3, False)])
def test_no_monomial_of_charge_0_is_without_class(joints, order, loops):
    multisets = EdgeMultisets(joints, order, loops)
    table = multisets.class_table(classes(joints, order, loops=loops))
    sizes = multisets.multiplicities.sum(axis=1)
    assert ((table >= 0) == (sizes[:, None] == sizes)).all()


def test_rows_are_all_monomials_of_their_charge_and_move_with_the_joints():
    multisets, names = EdgeMultisets(4, 3), np.array([[2, 0, 3, 1], [1, 0, 2, 3]])
    edges = list(zip(*(axis.tolist() for axis in multisets.edges), strict=True))
    linear = {Monomial((a,)) for a in edges}
    cubic = {Monomial((a, b), (c,)) for a in edges for b in edges for c in edges}

    def of(multiset):
        counts = multisets.multiplicities[multiset]
        return tuple(e for e, count in zip(edges, counts, strict=True) for _ in range(count))

    w, wbar = multisets.rows(1)
    rows = [Monomial(of(a), of(b)) for a, b in zip(w, wbar, strict=True)]
    assert len(rows) == len(set(rows))
    assert set(rows) == linear | cubic
    for order, images in zip(names.tolist(), multisets.images((w, wbar), names), strict=True):
        assert [rows[k] for k in images] == [row.relabel(tuple(order)) for row in rows]


@settings(max_examples=10)
@given(seed=st.integers(0, 2**32 - 1))
def test_averages_are_over_all_orders_and_conjugation(averages, seed):
    rng = np.random.default_rng(seed)
    w = rng.standard_normal((5, 5)) + 1j * rng.standard_normal((5, 5))
    w = w + w.T
    found = averages(MULTISETS, CLASSES, w)
    orders = np.array(list(permutations(range(5))))
    for graph, value in zip(CLASSES, found, strict=True):
        product = np.ones(len(orders), dtype=complex)
        for i, j in graph.w:
            product *= w[orders[:, i], orders[:, j]]
        for i, j in graph.wbar:
            product *= w[orders[:, i], orders[:, j]].conj()
        assert value == pytest.approx(product.mean().real, abs=1e-9)
