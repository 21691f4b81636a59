"""Basin hopping: starts go on to better optima, and the patience grows where there are many."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from lockedjoint.formulations.atlas.collection import improved, page_of
from lockedjoint.formulations.atlas.entry import entry
from lockedjoint.formulations.io.table import Table, row_from
from lockedjoint.formulations.solving.effort import Effort
from results.basin_hopping import basin_hopping
from results.basin_hopping.basin_hopping import GROWTH, PATIENCE, STUDY, searched
from results.second_search import second_search
from results.second_search.hops import BasinHopping
from results.second_search.second_search import SecondSearchRow, from_starts
from results.second_search.smoothed import SmoothedSearch
from results.second_search.stopping import least_starts, settled

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


def test_a_start_ends_after_hops_without_gain(page, monkeypatch):
    smoothed = SmoothedSearch.of(page.entry)
    hops = []

    def hop(self, jacobian, rng):
        # The first two gain, the third is not of the entry, the others are worse.
        hops.append(jacobian)
        factor = {1: 0.92, 2: 0.94, 3: 1.5}.get(len(hops), 0.5)
        return factor * page.jacobian

    monkeypatch.setattr(SmoothedSearch, "answer", lambda *_: 0.9 * page.jacobian)
    monkeypatch.setattr(BasinHopping, "_hop", hop)
    monkeypatch.setattr(type(page.entry), "holds", lambda _, found: np.max(found) < 1.2)
    found = BasinHopping(page.entry, smoothed, 5).answer(np.random.default_rng(0))
    assert found == pytest.approx(0.94 * page.jacobian)
    assert len(hops) == 2 + 5


def test_it_ends_when_the_optima_ask_for_more_starts_than_it_has(page):
    search = SmoothedSearch.of(page.entry)
    row, _ = from_starts(page, search, 4, 0, np.inf, most=least_starts(2))
    whole, _ = from_starts(page, search, 4, 0, np.inf)
    assert whole.settled
    assert whole.optima == 3
    assert not row.settled
    assert row.optima == 3
    assert row.starts < least_starts(2)


def test_the_patience_grows_until_the_rule_holds(page, monkeypatch):
    patiences = []

    def answer(self, rng):
        patiences.append(self.patience)
        # All starts end at other values, until the patience is the second one.
        factor = 1 - 1e-3 * len(patiences) if self.patience == PATIENCE else 1.0
        return factor * page.jacobian

    monkeypatch.setattr(BasinHopping, "answer", answer)
    monkeypatch.setattr(type(page.entry), "holds", lambda *_: True)
    row, better = searched(page, 8, 0)
    few = patiences.count(PATIENCE)
    # With six optima the rule asks for more than 70 starts.
    assert few == 6
    assert patiences[few:] == [GROWTH * PATIENCE] * 8
    assert row.settled
    assert (row.patience, row.starts, row.optima, row.reached) == (80, 8, 1, 8)
    assert better == []


def test_the_row_and_the_pages_are_of_the_best(page):
    worse = improved(page.entry, poor(page)[1], replace(page.found, by="me"), None)
    row, better = searched(worse, 8, 0)
    assert row.settled
    assert settled(row.starts, row.optima, row.reached)
    assert row.value == float(worse.value)
    assert row.above == row.best - row.value > 1e-3
    assert row.best == pytest.approx(float(page.value), abs=1e-9)
    assert [float(one.value) for one in better] == pytest.approx([float(page.value)])
    assert "basin hopping with a patience of 20" in better[0].found.statement


def test_no_time_is_a_row_that_is_not_settled(page, monkeypatch):
    monkeypatch.setattr(basin_hopping, "LIMIT_SECONDS", 0.0)
    monkeypatch.setattr(BasinHopping, "answer", lambda *_: 2 * page.jacobian)
    row, better = searched(page, 4, 0)
    assert (row.starts, row.optima, row.reached, row.settled) == (4, 0, 0, False)
    assert np.isnan(row.best)
    assert np.isnan(row.above)
    assert better == []


def test_its_entries_are_those_at_which_the_second_search_did_not_settle(tmp_path, monkeypatch):
    names = (NAME, "free-mean_2x7_k2", "free-mean_2x7_k3")
    pages = [page_of(entry(name)) for name in names]
    rows = []
    for page, held in zip(pages, (False, True, False), strict=True):
        row, _ = from_starts(page, SmoothedSearch.of(page.entry), 1, 0, 0.0)
        rows.append(replace(row, settled=held))
    table = Table(SecondSearchRow, rows).csv()
    (tmp_path / "second_search.csv").write_text(table, encoding="utf-8")
    monkeypatch.setattr(basin_hopping, "_SECOND_SEARCH", tmp_path)
    assert second_search.STUDY.read(tmp_path)["second_search"] == rows
    done = STUDY.run(tmp_path / "out", Effort(0, None, 1, lambda _: None))
    assert done.complete
    assert {row.entry for row in done.rows} == {NAME, "free-mean_2x7_k3"}
    text = (tmp_path / "out" / "basin_hopping.md").read_text(encoding="utf-8")
    assert "did not settle at 2 entries" in text
    assert "for 2 the stopping rule held" in text
    assert "rule did not hold" not in text
    assert row_from(type(done.rows[0]), done.rows[0]) == done.rows[0]
