"""The second search: its columns, slopes and stopping rule, and values that are known."""

from dataclasses import replace
from itertools import count, cycle

import numpy as np
import pytest

from lockedjoint.formulations.atlas.collection import improved, page_of
from lockedjoint.formulations.atlas.entry import entry
from lockedjoint.formulations.joints import models
from lockedjoint.formulations.measures import worst_case_sigma
from lockedjoint.nlp.errors import InputError
from results.second_search.columns import Columns
from results.second_search.second_search import searched
from results.second_search.smoothed import SmoothedSearch
from results.second_search.stopping import OFTEN, least_starts, settled, unseen_share
from results.second_search.tally import Limits, tally

# Step of finite differences, and how far they may be from slopes of size one.
STEP = 1e-6
NEAR = 1e-6
MODELS = (
    ("free", 3),
    ("free-mean", 2),
    ("unit-revolute", 6),
    ("lever-revolute", 6),
    ("lever-revolute-each", 6),
    ("rotor:4,counter-rotor:3", 6),
    ("lever-revolute:5,prismatic:2", 6),
)
# An entry of each kind of value, small ones.
ENTRIES = (
    "free-mean_2x5_k2",
    "free_3x7_k3",
    "free-mean_3x5_k2_condition",
    "unit-revolute_6x9_k2_manipulability",
    "lever-revolute_6x7_k1_isotropy",
)


@pytest.mark.parametrize(("model", "m"), MODELS)
def test_columns_are_those_of_the_model(model, m):
    arm = models.arm(model, None if ":" in model else 7, m)
    columns = Columns.of(arm)
    rng = np.random.default_rng(3)
    for _ in range(5):
        jacobian = columns.jacobian(columns.sample(rng))
        assert arm.admits(jacobian)
        assert not arm.admits(1.1 * jacobian)
        assert columns.jacobian(columns.point(jacobian)) == pytest.approx(jacobian, abs=1e-7)


@pytest.mark.parametrize("name", ENTRIES)
def test_slopes_agree_with_finite_differences(name):
    search = SmoothedSearch.of(entry(name))
    point = search.columns.sample(np.random.default_rng(5))
    moves = STEP * np.eye(point.size)

    zero = np.zeros((len(search.columns.jacobian(point)),) * 2)

    def loss(at):
        return search.loss(at, 0.1, zero, 10.0)[0]

    def levels(at):
        return search.levels.values(search.columns.jacobian(at))

    jacobian, by_point = search.columns.with_slopes(point)
    for value, slopes in (
        (loss, search.loss(point, 0.1, zero, 10.0)[1]),
        (levels, (search.levels.slopes(jacobian) @ by_point).T),
    ):
        numeric = [(value(point + move) - value(point - move)) / (2 * STEP) for move in moves]
        size = max(1.0, float(np.max(np.abs(slopes))))
        assert np.array(numeric) == pytest.approx(slopes, abs=NEAR * size)


def test_known_optima_are_found():
    # Eq. (6) of the paper for planar arms: √((n − 2)/2).
    for joints in (3, 5):
        search = SmoothedSearch.of(entry(f"free-mean_2x{joints}_k1"))
        found = search.answer(np.random.default_rng(1))
        assert worst_case_sigma(found) == pytest.approx(np.sqrt((joints - 2) / 2), abs=1e-9)


@pytest.mark.parametrize(
    "name", ["free-mean_3x5_k2_isotropy", "lever-revolute_6x7_k1_isotropy"]
)
def test_an_isotropic_answer_is_isotropic(name):
    search = SmoothedSearch.of(entry(name))
    for seed in range(3):
        found = search.answer(np.random.default_rng(seed))
        gram = found @ found.T
        even = np.trace(gram) / len(gram) * np.eye(len(gram))
        assert gram == pytest.approx(even, abs=1e-12)


def test_the_rule_asks_for_more_starts_where_there_are_more_optima():
    assert settled(starts=20, optima=1, reached=20)
    assert not settled(starts=20, optima=1, reached=4)  # not often enough at the best
    # w(N − 1)/(N − w − 2) < w + ½ with w = 5: N > 67.
    assert not settled(starts=67, optima=5, reached=20)
    assert settled(starts=68, optima=5, reached=20)
    assert not settled(starts=12, optima=10, reached=5)


def test_prismatic_columns_leave_less_to_the_lever_arms_of_an_isotropic_answer():
    # JJᵀ = (5/3)I: of the trace 5 of the linear rows two prismatic joints have 2.
    asked = entry("lever-revolute-5+prismatic-2_6x7_k1_isotropy")
    found = SmoothedSearch.of(asked).answer(np.random.default_rng(0))
    assert asked.holds(found)
    assert np.sum(found[:3, :5] ** 2) == pytest.approx(3)
    assert worst_case_sigma(found) == pytest.approx(0.174607167, abs=1e-8)


def test_the_unseen_share_is_that_of_the_prior():
    assert unseen_share(starts=1, optima=1) == unseen_share(starts=20, optima=0) == 1
    assert unseen_share(starts=20, optima=20) == 1
    assert unseen_share(starts=200, optima=19) == pytest.approx(380 / 39800)


def worse(page):
    """Return the page of the second best optimum of an entry, which starts find sooner."""
    search = SmoothedSearch.of(page.entry)
    answers = (search.answer(np.random.default_rng(seed)) for seed in count())
    found = next(one for one in answers if page.entry.score(one) < float(page.value) - 1e-3)
    return improved(page.entry, found, replace(page.found, by="me"), None)


def test_an_entry_is_searched_until_the_rule_holds_and_a_better_page_is_returned():
    page = page_of(entry("free-mean_2x9_k2"))
    row, better = searched(worse(page), least=6, seed=0)
    assert row.settled
    assert settled(row.answers, row.optima, row.reached)
    assert row.starts == row.answers >= 6
    assert row.unseen_percent == 100 * unseen_share(row.answers, row.optima)
    assert row.best == pytest.approx(float(page.value), abs=1e-9)
    assert row.above == row.best - row.value > 1e-3
    assert float(better.value) == pytest.approx(float(page.value), abs=1e-9)
    assert better.history[-1]["found"]["by"] == "me"
    assert better.found.statement.startswith("second search")
    # Only starts at the best count, and a value that is on record is not written again.
    again, nothing = searched(page, least=6, seed=0)
    assert nothing is None
    assert again.reached == row.reached < row.starts


def test_answers_that_are_not_of_the_entry_do_not_count(monkeypatch):
    page = page_of(entry("free-mean_2x7_k3"))
    monkeypatch.setattr("results.second_search.second_search.LIMIT_SECONDS", 0.0)
    monkeypatch.setattr(SmoothedSearch, "answer", lambda *_: 2 * page.jacobian)
    row, better = searched(page, least=4, seed=0)
    assert (row.starts, row.answers, row.optima, row.reached) == (4, 0, 0, 0)
    assert row.unseen_percent == 100
    assert not row.settled
    assert better is None


def test_the_rule_is_on_answers_not_on_starts(monkeypatch):
    page = page_of(entry("free-mean_2x7_k3"))
    answers = cycle([page.jacobian, 2 * page.jacobian])
    monkeypatch.setattr(SmoothedSearch, "answer", lambda *_: next(answers))
    row, _ = searched(page, least=4, seed=0)
    # (N − 1)/(N − 3) < 1 + ½: N > 7.
    assert (row.starts, row.answers) == (15, 8)


def test_lever_arms_of_an_isotropic_jacobian_are_known_beside_prismatic_joints_only():
    for joints in (
        "unit-revolute:3,lever-revolute:4,prismatic:1",
        "lever-revolute:3,prismatic:4",
    ):
        with pytest.raises(InputError, match="one kind and fewer, or slower"):
            Columns.of(models.arm(joints), isotropic=True)
    # Never more than the joints allow, though then no Jacobian is isotropic.
    for joints, total in (("lever-revolute:8", 8), ("lever-revolute(length=0.5):8", 2)):
        columns = Columns.of(models.arm(joints), isotropic=True)
        jacobian = columns.jacobian(columns.sample(np.random.default_rng(0)))
        assert np.sum(jacobian[:3] ** 2) == pytest.approx(total)


def test_the_rule_needs_a_number_of_starts_that_grows_with_the_square_of_the_optima():
    # The least N with w(N − 1)/(N − w − 2) < w + ½, by trying.
    for optima in range(1, 12):
        least = next(
            starts
            for starts in count(optima + 3)
            if optima * (starts - 1) / (starts - optima - 2) < optima + 0.5
        )
        assert least_starts(optima) == least
        assert settled(least, optima, OFTEN)
        assert not settled(least - 1, optima, OFTEN)
        assert not settled(least, optima, OFTEN - 1)


def test_a_polish_that_does_not_reach_enough_is_the_only_one(monkeypatch):
    # So few sets that after the first polish others have lower levels.
    monkeypatch.setattr("results.second_search.smoothed._SETS_PER_VARIABLE", 2)
    search = SmoothedSearch.of(entry("free-mean_3x9_k3"))
    point = search.columns.sample(np.random.default_rng(1))
    once = SmoothedSearch._polished_once
    polishes = []

    def counted(self, begin, chosen):
        end = once(self, begin, chosen)
        jacobian = self.columns.jacobian(end)
        polishes.append((chosen.least(jacobian), search.levels.least(jacobian)))
        return end

    monkeypatch.setattr(SmoothedSearch, "_polished_once", counted)
    whole = search.polished(point)
    (chosen, every), number = polishes[0], len(polishes)
    assert number > 1
    assert every < chosen - 1e-3
    # The levels that the polish was for count: the others rise later.
    never = min(level for level, _ in polishes) - 1e-6
    assert every < never
    for enough, expected in ((chosen + 1e-6, 1), (never, number)):
        polishes.clear()
        end = search.polished(point, enough)
        assert len(polishes) == expected
        assert np.array_equal(end, whole) == (expected == number)


class Scripted:
    """A search whose answers are a Jacobian times factors; numbers fail where one is None."""

    def __init__(self, jacobian, factors):
        self.jacobian = jacobian
        self.factors = iter(factors)

    def answer(self, _):
        factor = next(self.factors)
        if factor is None:
            raise np.linalg.LinAlgError
        return factor * self.jacobian


def scripted_tally(monkeypatch, factors, limits):
    page = page_of(entry("free-mean_2x7_k3"))
    monkeypatch.setattr(type(page.entry), "holds", lambda *_: True)
    search = Scripted(page.jacobian, factors)
    return tally(page.entry, search, (0,), limits, float(page.value))


def test_a_start_whose_numbers_fail_has_no_answer(monkeypatch):
    done = scripted_tally(monkeypatch, cycle([None, 1.0]), Limits(1, np.inf))
    assert (done.starts, done.answers, done.reached, done.settled) == (16, 8, 8, True)


def test_starts_end_where_the_optima_ask_for_more_or_there_are_the_most(monkeypatch):
    # With six optima the rule asks for more than 70 starts.
    many = (1 - 1e-3 * k for k in count(1))
    done = scripted_tally(monkeypatch, many, Limits(1, np.inf, 70))
    assert (done.starts, done.optima, done.reached, done.settled) == (6, 6, 0, False)
    assert least_starts(5) <= 70 < least_starts(6)
    # The best is never reached.
    done = scripted_tally(monkeypatch, cycle([0.9]), Limits(1, np.inf, 70))
    assert (done.starts, done.optima, done.settled) == (70, 1, False)
