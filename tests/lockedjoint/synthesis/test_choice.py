"""The best arrangement is the best of all, by every criterion, for known reasons."""

from itertools import permutations, product
from math import factorial

import numpy as np
import pytest

from lockedjoint.formulations import measures
from lockedjoint.formulations.reproduction import reference
from lockedjoint.synthesis.choice import choose_arrangement, evaluate, rank, search
from lockedjoint.synthesis.criteria import CRITERIA, Sampling
from lockedjoint.synthesis.dh import denavit_hartenberg
from lockedjoint.synthesis.family import distinct, every, family, symmetries
from lockedjoint.synthesis.from_jacobian import realise
from lockedjoint.synthesis.links import link_lengths

FEW = Sampling(seed=3, samples=8, radius=0.3)


@pytest.fixture(scope="module")
def four():
    """A planar 4R, and its values in every order with all signs, one by one.

    Half of the signs: half a turn about the end effector flips all joints at once.
    """
    arm = realise(reference.planar_4r(0.3)[:2])
    arrangements = [
        (order, (False, *flips))
        for order in permutations(range(4))
        for flips in product([False, True], repeat=3)
    ]
    values = {one: evaluate(arm.arranged(*one), FEW) for one in arrangements}
    return arm, values


@pytest.mark.parametrize("name", [name for name in CRITERIA if name != "kept"])
def test_the_choice_is_the_best_of_all(four, name):
    """Identical arms are sampled in one arrangement only, the one that comes first."""
    arm, values = four
    kept = distinct(every(arm), symmetries(arm))
    orders, flips = (map(tuple, part.tolist()) for part in (kept.orders, kept.flips))
    first = set(zip(orders, flips, strict=True))
    tried = [one for key, one in values.items() if key in first or not CRITERIA[name].sampled]
    numbers = [one[name] for one in tried]
    best = max(numbers) if CRITERIA[name].larger_is_better else min(numbers)
    chosen = choose_arrangement(arm, name, FEW)
    assert chosen.values[name] == pytest.approx(best, rel=1e-6)
    assert evaluate(chosen.manipulator, FEW) == pytest.approx(chosen.values, nan_ok=True)
    assert np.isnan(chosen.values["kept"])  # of two joints more than rows
    assert (chosen.arrangements, chosen.distinct) == (384, 48)


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
    lengths = link_lengths(arm.points, arm.end_effector)
    assert values["total-length"] == pytest.approx(sum(lengths))
    assert values["largest-link"] == pytest.approx(max(lengths))
    table = denavit_hartenberg(arm)
    assert values["dh-length"] == pytest.approx(np.abs(table.a).sum() + np.abs(table.d).sum())
    near = [arm.jacobian(q) for q in FEW.near(arm.joints)]
    assert values["neighbourhood"] == pytest.approx(min(map(measures.worst_case_sigma, near)))
    before = min(measures.singular_values(matrix)[-1] for matrix in near)
    assert values["neighbourhood-before"] == pytest.approx(before)
    assert np.all(np.linalg.norm(FEW.near(arm.joints), axis=1) <= 0.3)
    scale = np.where(arm.prismatic, arm.size, np.pi)
    there = FEW.anywhere(arm.joints) * scale
    found = [arm.jacobian(q) for q in there]
    after = np.mean([measures.worst_case_sigma(matrix) for matrix in found])
    assert values["workspace"] == pytest.approx(after)
    whole = np.mean([measures.singular_values(matrix)[-1] for matrix in found])
    assert values["workspace-before"] == pytest.approx(whole)
    reach = max(np.linalg.norm(arm.pose(q)[:3, 3] - arm.points[0]) for q in there)
    assert values["reach"] == pytest.approx(reach)
    if not arm.prismatic.any():
        assert values["reach"] <= values["total-length"] + 1e-9


@pytest.mark.parametrize("name", ["clearance", "total-length", "dh-length"])
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
    one, two = (choose_arrangement(arm, "neighbourhood", FEW) for _ in range(2))
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
