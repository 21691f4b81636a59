"""Arms that a map of finite order carries into themselves, and searches from and for them."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockedjoint.formulations import max_min, measures
from lockedjoint.formulations.atlas.collection import improved, page_of, read_page
from lockedjoint.formulations.atlas.entry import entry
from lockedjoint.formulations.joints import models
from lockedjoint.formulations.measures import remaining_singular_values
from lockedjoint.formulations.solving.polish import polish
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.solver import Solver
from results.atlas.search import main, search
from results.atlas.symmetric_arm import SymmetricArm
from results.second_search.hops import moved
from results.second_search.smoothed import SmoothedSearch

SIZES = st.sampled_from([("free-mean", 2, 7), ("free-mean", 3, 8), ("unit-revolute", 6, 9)])


def drawn(size, seed):
    model, m, n = size
    rng = np.random.default_rng(seed)
    symmetric = SymmetricArm.drawn(models.arm(model, n, m), rng)
    point = symmetric.sample(rng)
    return symmetric, point, symmetric.jacobian(point)


@given(SIZES, st.integers(0, 500))
def test_every_whole_orbit_is_carried_into_itself(size, seed):
    symmetric, _, jacobian = drawn(size, seed)
    one = np.eye(len(jacobian))
    power = np.linalg.matrix_power(np.array(symmetric.symmetry), symmetric.order)
    assert min(np.abs(power - one).max(), np.abs(power + one).max()) < 1e-8
    whole = jacobian.shape[1] // symmetric.order * symmetric.order
    images = np.array(symmetric.symmetry) @ jacobian[:, :whole]
    for image in images.T:
        assert min(np.abs(jacobian.T - s * image).max(axis=1).min() for s in (1, -1)) < 1e-8


@given(SIZES, st.integers(0, 500))
def test_the_columns_are_of_the_model(size, seed):
    symmetric, point, jacobian = drawn(size, seed)
    assert point.size == symmetric.size < symmetric.arm.size
    scaled = jacobian * np.sqrt(symmetric.arm.largest_trace / measures.trace(jacobian))
    again = symmetric.arm.jacobian(symmetric.arm.variables(scaled))
    np.testing.assert_allclose(again, scaled, atol=1e-9)


@given(SIZES, st.integers(0, 500), st.integers(1, 3))
def test_the_distinct_sets_have_every_value_of_all_sets(size, seed, failures):
    symmetric, _, jacobian = drawn(size, seed)
    if failures > jacobian.shape[1] - jacobian.shape[0]:
        return

    def left(sets):
        return remaining_singular_values(jacobian, sets)[:, -1]

    few = left(symmetric.distinct_sets(failures))
    for value in left(measures.locked_sets(jacobian, failures)):
        assert np.abs(few - value).min() < 1e-9


def test_a_formulation_is_stated_for_it():
    rng = np.random.default_rng(3)
    symmetric = SymmetricArm.drawn(models.arm("free-mean", 6, 3), rng)
    turn = ((-0.5, -(0.75**0.5), 0), (0.75**0.5, -0.5, 0), (0, 0, 1))
    symmetric = replace(symmetric, symmetry=turn, order=3)
    solution = Solver(max_min.build(symmetric)).solve(symmetric.sample(rng))
    jacobian = symmetric.jacobian(solution.variables[: symmetric.size])
    assert solution.status.success
    # The bound σ√((n − m)/n) with σ² = n/m is attained: the best 6 columns can be so symmetric.
    assert measures.worst_case_sigma(jacobian) == pytest.approx(1.0, abs=1e-6)


def test_polish_on_fewer_sets_ends_where_it_does_on_all():
    rng = np.random.default_rng(1)
    symmetric = SymmetricArm.drawn(models.arm("unit-revolute", 9), rng)
    while 9 % symmetric.order:
        symmetric = SymmetricArm.drawn(symmetric.arm, rng)
    start = symmetric.sample(rng)
    few, _ = polish(symmetric, start, 2, sets=symmetric.distinct_sets(2))
    every, _ = polish(symmetric, start, 2)
    values = [measures.worst_case_sigma(symmetric.jacobian(one), 2) for one in (few, every)]
    assert values[0] == pytest.approx(values[1], rel=1e-6)


@pytest.mark.parametrize("model", ["lever-revolute", "unit-revolute:6,prismatic:1"])
def test_other_joints_have_no_symmetric_arm(model):
    with pytest.raises(InputError, match="all free columns or all unit revolute"):
        SymmetricArm.drawn(models.arm(model, 7), np.random.default_rng(0))


@pytest.mark.parametrize(
    "name",
    [
        "free-mean_2x5_k2_isotropy",
        "free-mean_2x7_k3",
        "free-mean_2x7_k3_condition",
        "lever-revolute-each_6x8_k2",
        "unit-revolute_6x8_k2",
        "unit-revolute_6x9_k2_manipulability",
    ],
)
def test_hops_start_at_the_best_and_are_no_random_starts(name, monkeypatch):
    monkeypatch.setattr("results.atlas.search.STARTS", 2)
    page = page_of(entry(name))
    movable = page.entry.task_dimension == 2 and page.entry.formulation != "isotropy"
    near = page.jacobian + 1e-4 * page.jacobian[:, ::-1] * movable
    near *= np.sqrt(page.entry.arm.largest_trace / measures.trace(near))
    worse = improved(page.entry, near, replace(page.found, by="me"), None)
    better = next(search(page.entry, worse, 1e-6, "hops"))
    assert float(better.value) == pytest.approx(float(page.value), abs=1e-7)
    assert better.found.seeds == page.found.seeds + 1
    assert better.found.starts == page.found.starts
    if better.value == worse.value:
        assert (better.found.by, better.found.statement) == ("me", worse.found.statement)
    else:
        stated = page.entry.formulation
        assert better.found.statement == f"{stated}, hops from the best, polished"
        assert better.history[-1]["found"]["by"] == "me"


def test_a_hop_moves_all_joints_or_draws_some_anew():
    columns = SmoothedSearch.of(entry("unit-revolute_6x9_k2")).columns
    best = columns.sample(np.random.default_rng(0))
    all_moved, drawn_anew = 0, set()
    for seed in range(100):
        change = moved(best, columns, np.random.default_rng(seed)) - best
        joints = np.abs(change.reshape(9, 6)).max(axis=1)
        if np.all(joints > 0):
            all_moved += 1
            assert 1e-3 < np.std(change) < 1
        else:
            drawn_anew.add(np.count_nonzero(joints))
    assert 40 < all_moved < 80
    assert drawn_anew == {1, 2, 3}


def test_hops_find_the_best_again_from_a_worse_optimum(monkeypatch):
    # The second best optimum of 2×7 columns of which three lock; the best is one hop away.
    monkeypatch.setattr("results.atlas.search.STARTS", 12)
    page = page_of(entry("free-mean_2x7_k3"))
    smoothed = SmoothedSearch.of(page.entry)
    answers = (smoothed.answer(np.random.default_rng(seed)) for seed in count())
    second = next(one for one in answers if page.entry.score(one) < float(page.value) - 1e-3)
    found = replace(page.found, by="me", reached_best=7)
    worse = improved(page.entry, second, found, None)
    better = next(search(page.entry, worse, 1e-6, "hops"))
    assert float(better.value) == pytest.approx(float(page.value), abs=1e-9)
    assert better.found.reached_best == 0
    assert better.found.by == "lockedjoint"


def test_an_uneven_jacobian_is_no_isotropic_one():
    page = page_of(entry("lever-revolute_6x7_k1_isotropy"))
    arm = page.entry.arm
    assert page.entry.holds(page.jacobian)
    for seed in range(5):
        start = arm.variables(page.jacobian)
        moved = start + 1e-7 * np.random.default_rng(seed).standard_normal(start.size)
        uneven = arm.jacobian(np.clip(moved, *arm.bounds))
        assert np.isfinite(page.entry.score(uneven))
        assert not page.entry.holds(uneven)


def test_symmetric_starts_find_an_entry_anew():
    asked = entry("unit-revolute_6x10_k3")
    best = float(page_of(asked).value)
    page = next(search(asked, None, 1e-6, "symmetric"))
    assert page.found.starts == page.found.reached_best == 0
    assert "symmetric under a map of order" in page.found.statement
    # Of 840 random starts one ends there.
    assert float(page.value) == pytest.approx(best, rel=1e-2)
    again = next(search(asked, page_of(asked), 1e-6, "symmetric"))
    assert float(again.value) >= best
    assert again.found.seeds == page_of(asked).found.seeds + 1


@pytest.mark.parametrize(
    ("name", "kind", "allowed"),
    [
        ("free-mean_2x5_k2", "nearest", "hops"),
        ("lever-revolute_6x9_k2", "symmetric", "free-mean or unit-revolute"),
        ("free-mean_2x5_k2_manipulability", "symmetric", "free-mean or unit-revolute"),
    ],
)
def test_other_searches_and_entries_are_refused(name, kind, allowed):
    with pytest.raises(InputError, match=allowed):
        search(entry(name), page_of(entry(name)), 1.0, kind)
    with pytest.raises(InputError, match="has a Jacobian"):
        search(entry("free-mean_2x5_k2"), None, 1.0, "hops")
    for minutes in (0.0, -1.0, np.nan):
        with pytest.raises(InputError, match="minutes"):
            search(
                entry("free-mean_2x5_k2"), page_of(entry("free-mean_2x5_k2")), minutes, "hops"
            )


def test_the_script_writes_a_page_that_it_goes_on_from(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("results.atlas.search.STARTS", 2)
    name, seeds = "free-mean_2x5_k2", page_of(entry("free-mean_2x5_k2")).found.seeds
    for more in (1, 2):
        assert main([name, "--from", "hops", "--minutes", "1e-6", "--out", str(tmp_path)]) == 0
        assert read_page(tmp_path / f"{name}.json").found.seeds == seeds + more
    with pytest.raises(SystemExit) as ended:
        main(["nothing", "--out", str(tmp_path)])
    assert ended.value.code == 2
    assert "entry" in capsys.readouterr().err
