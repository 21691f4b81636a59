from __future__ import annotations

from collections.abc import Callable
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from formulations.existence.graphs import Monomial, canonical, classes
from formulations.existence.relaxation.moment_matrix import class_tables
from formulations.existence.relaxation.numbered_monomials import EdgeMultisets, Integers
from nlp.errors import InputError

MULTISETS = EdgeMultisets(5, 2, True)
CLASSES = classes(5, 2, loops=True)
TABLES = class_tables(CLASSES, MULTISETS)
Averages = Callable[
    [EdgeMultisets, tuple[Integers, ...], NDArray[np.complex128]], NDArray[np.float64]
]

pairs = st.tuples(st.integers(0, 4), st.integers(0, 4))


@given(st.integers(0, 2), st.data())
def test_the_table_knows_the_class_of_every_monomial(edges: int, data: st.DataObject) -> None:
    factors = st.lists(pairs, min_size=edges, max_size=edges)
    monomial = Monomial(tuple(data.draw(factors)), tuple(data.draw(factors)))
    w, wbar = MULTISETS.of_pairs(monomial.w), MULTISETS.of_pairs(monomial.wbar)
    assert CLASSES[TABLES[edges][w, wbar]] == canonical(monomial)


def test_classes_are_as_large_as_their_orbits() -> None:
    counts = sum(np.bincount(t.ravel(), minlength=len(CLASSES)) for t in TABLES)
    orders = list(permutations(range(5)))
    for graph, count in zip(CLASSES, counts, strict=True):
        orbit = {graph.relabel(order) for order in orders}
        assert count == len(orbit | {member.conjugate() for member in orbit})


def test_unions_are_products() -> None:
    unions = MULTISETS.unions(1, 1)
    for a, left in enumerate(MULTISETS.edges):
        for b, right in enumerate(MULTISETS.edges):
            assert unions[a, b] == MULTISETS.of_pairs((left, right))


@settings(max_examples=10)
@given(seed=st.integers(0, 2**32 - 1))
def test_averages_are_over_all_orders_and_conjugation(averages: Averages, seed: int) -> None:
    rng = np.random.default_rng(seed)
    w = rng.standard_normal((5, 5)) + 1j * rng.standard_normal((5, 5))
    w = w + w.T
    found = averages(MULTISETS, TABLES, w)
    orders = np.array(list(permutations(range(5))))
    for graph, value in zip(CLASSES, found, strict=True):
        product = np.ones(len(orders), dtype=complex)
        for i, j in graph.w:
            product *= w[orders[:, i], orders[:, j]]
        for i, j in graph.wbar:
            product *= w[orders[:, i], orders[:, j]].conj()
        assert value == pytest.approx(product.mean().real, abs=1e-9)


def test_wrong_classes_are_refused() -> None:
    with pytest.raises(InputError, match="some are missing"):
        class_tables(CLASSES[:-1], MULTISETS)
    with pytest.raises(InputError, match="this one is a second"):
        class_tables((*CLASSES, CLASSES[3].relabel((2, 3, 4, 0, 1))), MULTISETS)
