"""Basin hopping: starts go on to better optima, and the patience grows where there are many."""

from dataclasses import replace

import numpy as np
import pytest

from lockedjoint.formulations.atlas.collection import improved, page_of, read_page
from lockedjoint.formulations.atlas.entry import entry
from lockedjoint.formulations.io.table import Table
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.nlp.errors import FileError
from results.atlas.search import symmetric_climb
from results.basin_hopping import basin_hopping
from results.basin_hopping.basin_hopping import (
    DRAWS,
    GROWTH,
    MOST_STARTS,
    PATIENCE,
    RANDOM,
    STUDY,
    SYMMETRIC,
    SYMMETRIC_PATIENCE,
    searched,
)
from results.basin_hopping.symmetric import SymmetricStarts
from results.second_search.hops import BasinHopping
from results.second_search.second_search import SecondSearchRow
from results.second_search.second_search import searched as searched_before
from results.second_search.smoothed import SmoothedSearch
from results.second_search.stopping import settled
from results.second_search.tally import Limits, tally
from tests.results.test_hops import NAME, poor


@pytest.fixture
def page():
    return page_of(entry(NAME))


@pytest.fixture
def scripted(monkeypatch, page):
    """Return a function that replaces the starts' answers by scaled Jacobians of the page.

    The factor is a function of the search and of the number of starts so far. What it returns
    is the list of starts: their searches, and a random number of each.
    """

    def replaced(factor):
        calls = []

        def answer(self, rng):
            calls.append((self, rng.random()))
            return factor(self, len(calls)) * page.jacobian

        monkeypatch.setattr(BasinHopping, "answer", answer)
        monkeypatch.setattr(type(page.entry), "holds", lambda *_: True)
        return calls

    return replaced


def test_the_patience_grows_where_there_are_many_optima(page, scripted):
    # All starts end at other values, until the patience is the second one.
    calls = scripted(lambda search, k: 1 - 1e-3 * k * (search.patience == PATIENCE))
    rows, better = searched(page, 1, 0)
    patiences = [search.patience for search, _ in calls]
    # With six optima the rule asks for more than 70 starts.
    assert patiences == [PATIENCE] * 6 + [GROWTH * PATIENCE] * 8
    assert [(row.patience, row.starts, row.optima) for row in rows] == [(20, 6, 6), (80, 8, 1)]
    assert [(row.reached, row.settled) for row in rows] == [(0, False), (8, True)]
    assert better is None
    # Other random numbers with each patience, and with each seed.
    scripted(lambda *_: 1.0)
    searched(page, 1, 1)
    assert len({number for _, number in calls}) == len(calls)


def test_the_patience_grows_where_the_best_is_not_reached(page, scripted):
    calls = scripted(lambda search, _: 0.9 if search.patience == PATIENCE else 1.0)
    rows, _ = searched(page, 1, 0)
    assert [row.starts for row in rows] == [MOST_STARTS, 8]
    assert [search.patience for search, _ in calls].count(PATIENCE) == MOST_STARTS
    assert [row.settled for row in rows] == [False, True]
    # More starts may be asked for than the rule gets otherwise.
    scripted(lambda *_: 1.0)
    rows, _ = searched(page, 80, 0)
    assert [(row.starts, row.settled) for row in rows] == [(80, True)]


def test_what_is_found_with_a_small_patience_counts_with_the_next(page, scripted, monkeypatch):
    # The first patience finds the best once and ends; the others are 1e-3 below it.
    worse = improved(page.entry, poor(page)[1], replace(page.found, by="me"), None)
    scripted(lambda _, k: 1.0 if k == 1 else 1 - 1e-3 - 1e-5 * min(k, 7))
    seconds = iter(np.arange(0, 1e6, 50.0))
    monkeypatch.setattr("results.second_search.tally.process_time", lambda: next(seconds))
    rows, better = searched(worse, 1, 0)
    first, second, symmetric = rows
    assert first.best == pytest.approx(float(page.value), abs=1e-9)
    assert (first.starts, first.reached, first.optima) == (6, 1, 6)
    assert first.cpu_seconds == 350
    # 20 minutes are 24 steps of this clock: after seven of the first, those left.
    assert (second.patience, second.starts) == (80, 17)
    assert (second.reached, second.settled) == (0, False)
    # Then 20 minutes more for starts that begin from symmetric Jacobians.
    assert [row.begins for row in rows] == [RANDOM, RANDOM, SYMMETRIC]
    assert (symmetric.patience, symmetric.starts) == (80, 24)
    assert (symmetric.reached, symmetric.settled) == (0, False)
    for row in rows:
        assert row.above == row.best - row.value
        assert (row.value, row.mark) == (float(worse.value), worse.mark)
    assert float(better.value) == pytest.approx(float(page.value), abs=1e-9)
    # These starts are not counted as random starts of the entry.
    assert (better.found.starts, better.found.reached_best) == (worse.found.starts, 0)
    assert better.found.statement == "second search, with basin hopping, from random starts"
    assert better.history[-1]["found"]["by"] == "me"
    assert len(better.history) == 1


def test_symmetric_starts_get_time_and_random_numbers_of_their_own(page, scripted, monkeypatch):
    # Random starts are all poor. Symmetric ones have six optima first, and then the best alone.
    worse = improved(page.entry, poor(page)[1], replace(page.found, by="me"), None)

    def factor(search, k):
        if search.begin is None:
            return 0.9
        return 0.9 + 1e-3 * (k % 7) if search.patience == SYMMETRIC_PATIENCE else 1.0

    calls = scripted(factor)
    seconds = iter(np.arange(0, 1e6, 10.0))
    monkeypatch.setattr("results.second_search.tally.process_time", lambda: next(seconds))
    rows, better = searched(worse, 1, 0)
    random = [search for search, _ in calls if search.begin is None]
    symmetric = [search for search, _ in calls if search.begin is not None]
    assert [row.begins for row in rows] == [RANDOM, RANDOM, SYMMETRIC, SYMMETRIC]
    assert [row.patience for row in rows] == [20, 80, 80, 320]
    assert len(random) == sum(row.starts for row in rows if row.begins == RANDOM)
    assert {search.patience for search in symmetric} == {80, 320}
    for search in symmetric:
        assert isinstance(search.begin, SymmetricStarts)
        assert (search.begin.asked, search.begin.draws) == (page.entry, DRAWS)
    assert len({number for _, number in calls}) == len(calls)
    assert rows[-1].settled
    assert float(better.value) == pytest.approx(float(page.value), abs=1e-9)
    assert better.found.statement == "second search, with basin hopping, from symmetric starts"


def test_a_better_jacobian_is_found_and_returned(page):
    worse = improved(page.entry, poor(page)[1], replace(page.found, by="me"), None)
    rows, better = searched(worse, 1, 0)
    assert rows[-1].settled
    assert settled(rows[-1].answers, rows[-1].optima, rows[-1].reached)
    assert rows[-1].best == pytest.approx(float(page.value), abs=1e-9)
    assert float(better.value) == pytest.approx(float(page.value), abs=1e-9)


def test_no_answers_are_a_row_that_is_not_settled(page, monkeypatch):
    monkeypatch.setattr(basin_hopping, "LIMIT_SECONDS", 0.0)
    monkeypatch.setattr(BasinHopping, "answer", lambda *_: 2 * page.jacobian)
    rows, better = searched(page, 4, 0)
    assert [row.begins for row in rows] == [RANDOM, SYMMETRIC]
    for row in rows:
        assert (row.starts, row.answers, row.optima, row.reached) == (4, 0, 0, 0)
        assert not row.settled
        assert np.isnan(row.best)
        assert np.isnan(row.above)
    assert better is None


def test_entries_without_symmetric_starts_end_when_their_time_is_spent(monkeypatch):
    monkeypatch.setattr(basin_hopping, "LIMIT_SECONDS", 0.0)
    page = page_of(entry("rotor_6x8_k2"))
    monkeypatch.setattr(BasinHopping, "answer", lambda *_: 0.5 * page.jacobian)
    (row,), _ = searched(page, 1, 0)
    assert (row.begins, row.starts) == (RANDOM, 1)


def test_symmetric_starts_begin_from_the_best_of_their_climbs(page):
    drawn = np.random.default_rng(5)
    climbs = [symmetric_climb(page.entry, drawn) for _ in range(30)]
    scores = [page.entry.score(climb[0]) for climb in climbs if climb is not None]
    begin = SymmetricStarts(page.entry, 30)
    found = begin.answer(np.random.default_rng(5))
    assert page.entry.holds(found)
    assert page.entry.score(found) == max(scores) > min(scores)
    # The hops go on from there, without the symmetry.
    search = BasinHopping(page.entry, SmoothedSearch.of(page.entry), 40, begin)
    later = search.answer(np.random.default_rng(5))
    assert page.entry.score(later) > max(scores) + 1e-3
    alone = BasinHopping(page.entry, SmoothedSearch.of(page.entry), 0, begin)
    assert np.array_equal(alone.answer(np.random.default_rng(5)), found)


def test_symmetric_starts_that_cannot_climb_have_no_answer(page, monkeypatch):
    monkeypatch.setattr("results.basin_hopping.symmetric.symmetric_climb", lambda *_: None)
    search = BasinHopping(
        page.entry, SmoothedSearch.of(page.entry), 3, SymmetricStarts(page.entry, 2)
    )
    done = tally(page.entry, search, (0,), Limits(3, 0.0), float(page.value))
    assert (done.starts, done.answers) == (3, 0)


def test_a_symmetric_start_finds_what_1460_random_ones_did_not():
    page = page_of(entry("unit-revolute_6x9_k3"))
    found = SymmetricStarts(page.entry, 300).answer(np.random.default_rng(2))
    assert page.entry.holds(found)
    assert page.entry.score(found) == pytest.approx(float(page.value), abs=1e-9)


def test_a_start_whose_numbers_fail_has_no_answer(page, scripted):
    def factor(_, k):
        if k % 2:
            raise np.linalg.LinAlgError
        return 1.0

    scripted(factor)
    (row,), _ = searched(page, 1, 0)
    assert (row.starts, row.answers, row.reached, row.settled) == (16, 8, 8, True)


def test_the_finding_counts_entries_not_rows(page, scripted):
    scripted(lambda *_: 1.0)
    (row,), _ = searched(page, 1, 0)
    better = replace(row, entry="better", above=1e-3, begins=SYMMETRIC)
    reached = replace(row, entry="reached", above=1e-12, settled=False)
    missed = replace(reached, entry="missed", above=-0.1, reached=0)
    rows = [better, reached, replace(reached, patience=80), missed]
    assert STUDY.finding({"basin_hopping": rows}) == (
        "For 3 entries the stopping rule of the second search did not hold. Basin hopping "
        "reached the best value known for 2 of them, and for 1 the rule held, for 1 of these "
        "with symmetric starts. For 1 entries its Jacobian was better than that of the "
        "atlas before, by more than 1e-9."
    )


def test_its_entries_are_those_at_which_the_second_search_did_not_settle(tmp_path, monkeypatch):
    names = (NAME, "free-mean_2x7_k2", "free-mean_2x7_k3")
    best = [page_of(entry(name)) for name in names]
    worse = improved(best[0].entry, poor(best[0])[1], replace(best[0].found, by="me"), None)
    rows = []
    for page, held in zip(best, (False, True, False), strict=True):
        row, _ = searched_before(page, 1, 0)
        rows.append(replace(row, settled=held))
    monkeypatch.setattr(basin_hopping, "_SECOND_SEARCH", tmp_path)
    with pytest.raises(FileError, match="the second search's table"):
        next(STUDY.compute(Effort(0, None, 1, lambda _: None), tmp_path))
    table = Table(SecondSearchRow, rows).csv()
    (tmp_path / "second_search.csv").write_text(table, encoding="utf-8")
    monkeypatch.setattr(basin_hopping, "read_atlas", lambda: [worse, *best[1:]])
    done = STUDY.run(tmp_path / "out", Effort(3, 9, 1, lambda _: None))
    assert done.complete
    assert {row.entry for row in done.rows} == {NAME, "free-mean_2x7_k3"}
    assert min(row.starts for row in done.rows if row.settled) >= 9
    text = (tmp_path / "out" / "basin_hopping.md").read_text(encoding="utf-8")
    assert "For 2 entries the stopping rule" in text
    assert "the best value known for 2 of them, and for 2 the rule held. For 1 entries" in text
    assert "did not hold\n" not in text
    written = read_page(tmp_path / "out" / "better" / f"{NAME}.json")
    assert float(written.value) == pytest.approx(float(best[0].value), abs=1e-9)
    # With another seed the starts are others.
    again, _ = searched(best[2], 9, 0)
    theirs = [row.best for row in done.rows if row.entry == "free-mean_2x7_k3"]
    assert [row.best for row in again] != theirs
