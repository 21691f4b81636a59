"""The best arrangement is the best of all, by every criterion, for known reasons."""

from itertools import permutations, product
from math import factorial

import numpy as np
import pytest

import lockedjoint as lj
from lockedjoint.formulations.reproduction import reference
from lockedjoint.synthesis import choice, criteria
from lockedjoint.synthesis.choice import choose_arrangement, evaluate
from lockedjoint.synthesis.criteria import CRITERIA, Sampling
from lockedjoint.synthesis.family import family
from lockedjoint.synthesis.from_jacobian import realise
from lockedjoint.synthesis.links import clearance, link_lengths
from lockedjoint.synthesis.local_search import search
from lockedjoint.synthesis.ranking import rank

FEW = Sampling(seed=3, samples=8, radius=0.3)


def longest_lever(arm):
    """A user's own criterion, which sums over the joints in their order."""
    return float(np.linalg.norm(arm.points - arm.end_effector, axis=1) @ np.arange(arm.joints))


@pytest.fixture
def known(monkeypatch):
    """The criteria, and a user's own for the time of a test, of which the largest is best."""
    monkeypatch.setattr(criteria, "_known", dict(CRITERIA))
    monkeypatch.setattr(criteria, "CRITERIA", criteria._known)
    monkeypatch.setattr(choice, "CRITERIA", criteria._known)
    lj.register_criterion("lever", longest_lever, larger_is_better=True)
    return criteria._known


@pytest.mark.parametrize("name", ["clearance", "total-length", "lever"])
def test_the_choice_is_the_best_of_all(known, name):
    """Of a planar 4R in every order with all signs, one by one.

    Half of the signs: half a turn about the end effector flips all joints at once.
    """
    arm = realise(reference.planar_4r(0.3)[:2])
    values = [
        evaluate(arm.arranged(order, (False, *flips)), FEW)[name]
        for order in permutations(range(4))
        for flips in product([False, True], repeat=3)
    ]
    best = max(values) if known[name].larger_is_better else min(values)
    chosen = choose_arrangement(arm, name, FEW)
    assert chosen.values[name] == pytest.approx(best, rel=1e-6)
    again = evaluate(chosen.manipulator, FEW, tuple(chosen.values))
    assert again == pytest.approx(chosen.values, nan_ok=True)
    assert np.isnan(chosen.values["kept"])  # of two joints more than rows
    assert (chosen.arrangements, chosen.distinct) == (384, 48)


def test_a_function_chooses_among_the_shortest(optimum):
    arm = realise(optimum)
    chosen = choose_arrangement(arm, longest_lever, FEW, shortlist=20)
    shortest = rank(arm, "total-length", FEW).arrangements[:20]
    values = [longest_lever(arm.arranged(order)) for order in shortest.orders.tolist()]
    assert chosen.criterion == "longest_lever"
    assert chosen.values["longest_lever"] == pytest.approx(min(values))
    assert longest_lever(chosen.manipulator) == pytest.approx(min(values))
    assert "the 20 shortest of all 5040" in chosen.method


@pytest.mark.parametrize(
    ("name", "judge", "said"),
    [
        ("kept", longest_lever, "no other criterion has"),
        ("", longest_lever, "a name"),
        ("mine", 3, "a function of a Manipulator"),
    ],
)
def test_what_is_no_criterion_is_refused(name, judge, said):
    with pytest.raises(lj.InputError, match=said):
        lj.register_criterion(name, judge)
    assert "mine" not in CRITERIA


def test_a_function_without_a_number_is_refused(optimum):
    with pytest.raises(lj.InputError, match="a finite number for every manipulator"):
        choose_arrangement(realise(optimum), lambda _: np.nan, FEW, shortlist=2)


def test_seven_joints_in_every_order(optimum):
    arm = realise(optimum)
    chosen = choose_arrangement(arm, "total-length")
    totals = [
        link_lengths(arm.points[list(order)], arm.end_effector).sum()
        for order in permutations(range(7))
    ]
    assert chosen.values["total-length"] == pytest.approx(min(totals), rel=1e-9)
    assert chosen.distinct == 5040
    np.testing.assert_allclose(chosen.manipulator.jacobian(), optimum[:, chosen.order])


def test_values_mean_what_they_say(arm):
    values = evaluate(arm, FEW)
    assert set(values) == {"clearance", "total-length", "kept"}
    lengths = link_lengths(arm.points, arm.end_effector)
    assert values["total-length"] == pytest.approx(sum(lengths))
    assert values["clearance"] == clearance(arm.points, arm.end_effector)


@pytest.mark.parametrize("name", ["clearance", "total-length"])
def test_the_search_finds_what_trying_all_finds(optimum, name):
    arm, wanted = realise(optimum), CRITERIA[name]

    def cost(these):
        return wanted.cost(family(arm, these), FEW)

    found = search(arm, cost, seed=0, keep=5, starts=12)
    values = cost(found)
    assert np.all(np.diff(values) >= 0)
    best = choose_arrangement(arm, name, FEW).values[name]
    assert values[0] == pytest.approx(-best if wanted.larger_is_better else best, rel=1e-9)


def test_many_joints_are_searched_and_a_seed_says_all():
    arm = realise(reference.harmonic_jacobian(2, 9))
    one, two = (choose_arrangement(arm, longest_lever, FEW) for _ in range(2))
    assert one.to_dict() == two.to_dict()
    assert "seeded local search" in one.method
    assert one.distinct == factorial(9) * 2**9 // 36  # 18 turns, 18 reflections
    assert one.values["total-length"] < sum(link_lengths(arm.points, arm.end_effector))


@pytest.mark.parametrize("name", ["clearance", "kept"])
def test_progress_has_shares_and_parts_change_no_value(name):
    """Arrangements are judged in parts, each of which is told; together they are as good."""
    arm, told = realise(reference.planar_4r(0.3)[:2, :3]), []
    ranked = rank(arm, name, FEW, 8, told.append)
    shares = [step.share for step in told]
    assert shares == sorted(shares)
    assert 0.0 == shares[0] <= shares[-1] < 1.0
    assert len(shares) > 1
    together = CRITERIA[name].evaluate(family(arm, ranked.arrangements), FEW)
    assert ranked.values == pytest.approx(together)


def test_a_criterion_that_raises_is_one_sentence_and_others_are_not_asked(monkeypatch):
    def broken(_):
        raise ValueError("no idea")

    known = dict(criteria._known)
    monkeypatch.setattr(criteria, "_known", known)
    monkeypatch.setattr(criteria, "CRITERIA", known)
    monkeypatch.setattr(choice, "CRITERIA", known)
    made = realise(reference.planar_4r(0.3)[:2])
    lj.register_criterion("broken", broken)
    with pytest.raises(lj.InputError, match="broken is ValueError: no idea"):
        rank(made, "broken")
    assert set(choice.given(made).values) == set(criteria.BUILT_IN)
