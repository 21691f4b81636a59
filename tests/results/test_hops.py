"""Basin hopping: a start goes on from its optimum to better ones nearby."""

from itertools import count

import numpy as np
import pytest

from lockedjoint.formulations.atlas.collection import page_of
from lockedjoint.formulations.atlas.entry import entry
from results.second_search.hops import BasinHopping
from results.second_search.smoothed import SmoothedSearch

# An entry with few joints and several optima: some starts of the second search are at the best.
NAME = "free-mean_2x9_k2"


@pytest.fixture
def page():
    return page_of(entry(NAME))


def poor(page):
    """Return the first seed from which the second search ends below the best, and where."""
    smoothed = SmoothedSearch.of(page.entry)
    answers = ((seed, smoothed.answer(np.random.default_rng(seed))) for seed in count())
    return next(
        (seed, found)
        for seed, found in answers
        if page.entry.score(found) < float(page.value) - 1e-3
    )


def test_a_start_goes_on_from_a_poor_optimum_to_the_best(page):
    smoothed = SmoothedSearch.of(page.entry)
    seed, before = poor(page)
    found = BasinHopping(page.entry, smoothed, 20).answer(np.random.default_rng(seed))
    assert page.entry.holds(found)
    assert page.entry.score(found) > page.entry.score(before) + 1e-3
    assert page.entry.score(found) == pytest.approx(float(page.value), abs=1e-9)


def test_without_patience_it_is_the_second_search(page):
    smoothed = SmoothedSearch.of(page.entry)
    found = BasinHopping(page.entry, smoothed, 0).answer(np.random.default_rng(4))
    assert np.array_equal(found, smoothed.answer(np.random.default_rng(4)))


def hops_from(page, monkeypatch, first, factors, patience):
    """Return the factors from which hops began, and the one at the end.

    Hop k leads to the page's Jacobian times factor k. Above 1.2 it is none of the entry.
    """
    begun = []

    def hop(self, jacobian, rng):
        begun.append(jacobian[0, 0] / page.jacobian[0, 0])
        return factors[len(begun) - 1] * page.jacobian

    monkeypatch.setattr(SmoothedSearch, "answer", lambda *_: first * page.jacobian)
    monkeypatch.setattr(BasinHopping, "_hop", hop)
    limit = 1.2 * page.jacobian[0, 0]
    monkeypatch.setattr(type(page.entry), "holds", lambda _, found: found[0, 0] < limit)
    search = BasinHopping(page.entry, SmoothedSearch.of(page.entry), patience)
    found = search.answer(np.random.default_rng(0))
    return begun, found[0, 0] / page.jacobian[0, 0]


def test_hops_begin_from_the_best_and_end_after_some_without_gain(page, monkeypatch):
    # Hop 4 gains too little to go on for, but is kept; hop 3 is none of the entry.
    factors = [0.92, 0.94, 1.5, 0.94 + 1e-8, 0.5, 0.6, 0.7]
    begun, end = hops_from(page, monkeypatch, 0.9, factors, 4)
    assert begun == pytest.approx([0.9, 0.92, 0.94, 0.94, 0.94 + 1e-8, 0.94 + 1e-8], abs=1e-12)
    assert end == pytest.approx(0.94 + 1e-8, abs=1e-12)


def test_an_answer_that_is_none_of_the_entry_gets_no_hops(page, monkeypatch):
    begun, end = hops_from(page, monkeypatch, 1.5, [0.9], 4)
    assert begun == []
    assert end == pytest.approx(1.5)


def test_a_hop_ends_early_far_below_and_stays_where_numbers_fail(page, monkeypatch):
    smoothed = SmoothedSearch.of(page.entry)
    search = BasinHopping(page.entry, smoothed, 1)
    asked = []

    def polished(self, start, enough):
        asked.append(enough)
        raise np.linalg.LinAlgError

    monkeypatch.setattr(SmoothedSearch, "polished", polished)
    monkeypatch.setattr(SmoothedSearch, "answer", lambda *_: page.jacobian)
    assert np.array_equal(search.answer(np.random.default_rng(0)), page.jacobian)
    assert asked == pytest.approx([np.log(float(page.value)) - 1e-3], abs=1e-6)
