"""Searching for postures: the three formulations on robots, judged from outside."""

import json
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

import lockedjoint.formulations.solving.solve as solving
from lockedjoint.formulations import measures
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.nlp.errors import InputError
from lockedjoint.robots import posture_search, solved_together
from lockedjoint.robots.posture import best_posture
from lockedjoint.robots.posture_search import (
    LEAST_REACHED,
    UNSEEN_SHARE,
    is_settled,
    searched,
)
from lockedjoint.robots.promising_starts import promising_starts
from lockedjoint.robots.robot_assessment import measure_robot
from lockedjoint.robots.search import Search
from results.robots.survey import ARMS
from tests.made_robots import real

RESULTS = Path(__file__).parents[3] / "results" / "robots"


@lru_cache
def tiago():
    return best_posture(real("TIAGo,").arm(), Search(starts=8))


@pytest.mark.parametrize("declared", ARMS, ids=lambda one: f"{one.name}, {one.task}")
def test_the_postures_on_record_by_pinocchio_alone(declared, made):
    """Every row of results/robots is as good as it says, within the limits."""
    recorded = json.loads((RESULTS / "postures.json").read_text())
    key = (declared.name, declared.task)
    (found,) = (one for one in recorded if (one["arm"], one["variant"]) == key)
    length, sigma = made.by_pinocchio(declared, found["q"])
    assert length == pytest.approx(found["characteristic_length"])
    assert sigma == pytest.approx(found["worst_case_sigma"], abs=1e-9)
    declared.arm().chain.within_limits(list(found["q"].values()))


def test_max_min_is_better_than_what_it_started_from_and_than_mid_range():
    found, arm = tiago(), real("TIAGo,").arm()
    rng = np.random.default_rng(3)
    drawn = [measures.worst_case_sigma(arm.jacobian(arm.sample(rng))) for _ in range(1000)]
    assert found.assessment.worst_case_sigma > max(drawn)
    assert found.assessment.worst_case_sigma > found.mid_range_sigma
    middle = measure_robot(arm, arm.chain.mid_range)
    assert found.mid_range_sigma == pytest.approx(middle.worst_case_sigma)


def test_no_small_move_improves_on_it():
    """A local maximum, seen without derivatives."""
    found, arm = tiago(), real("TIAGo,").arm()
    point = np.array(list(found.assessment.q.values()))
    lower, upper = arm.bounds
    rng = np.random.default_rng(4)
    for size in (1e-1, 1e-2, 1e-3, 1e-4):
        for _ in range(50):
            near = np.clip(point + size * rng.standard_normal(arm.size), lower, upper)
            sigma = measures.worst_case_sigma(arm.jacobian(near))
            assert sigma <= found.assessment.worst_case_sigma + 1e-6


def test_a_planar_arm_against_every_posture_on_a_grid(made):
    """Four links of length 1 in the plane: brute force, with a Jacobian of its own."""
    found = best_posture(made.planar([1] * 4), Search(starts=6)).assessment

    turns = np.linspace(-2, 2, 65)
    q = np.stack(np.meshgrid(turns, turns, turns, indexing="ij"), axis=-1).reshape(-1, 3)
    heading = np.cumsum(np.column_stack([np.zeros(len(q)), q]), axis=1)
    on_grid = np.max(made.planar_sigmas(heading)[0])
    assert on_grid <= found.worst_case_sigma + 1e-9
    assert on_grid == pytest.approx(found.worst_case_sigma, abs=0.03)


@pytest.mark.parametrize("name", ["residual", "isotropy"])
def test_the_other_formulations(name):
    """As to orientation the Panda can be isotropic, which is optimal there: √(T(n−m)/(mn))."""
    arm = RobotArm(real("Franka").arm().chain, TaskSpace.parse("orientation"))
    found = best_posture(arm, Search(name, starts=6))
    matrix = np.array(found.assessment.jacobian)
    assert measures.isotropy_defect(matrix) < 1e-9 * measures.trace(matrix) ** 2
    lower, upper = arm.bounds
    point = np.array(list(found.assessment.q.values()))
    assert np.all((point >= lower) & (point <= upper))
    assert found.assessment.worst_case_sigma == pytest.approx(np.sqrt(7 * 4 / 21), abs=1e-7)


def test_limits_bind_and_hold(made):
    """With limits narrowed about the best posture found, the answer stays within them."""
    text = made.offset_arm()
    arms = made.arm(text), made.arm(text.replace('"-2"', '"0.4"'))
    free, bound = (best_posture(arm, Search(starts=3)).assessment for arm in arms)
    assert min(bound.q.values()) >= 0.4
    assert bound.worst_case_sigma < free.worst_case_sigma
    assert bound.at_limits


def test_after_a_failure(made):
    """A sub-chain: eight joints, one held; its best posture holds it."""
    text = made.offset_arm(8)
    arm = made.arm(text, locked_at={"j3": 0.7})
    found = best_posture(arm, Search(starts=4)).assessment
    assert found.locked == {"j3": 0.7}
    assert "j3" not in found.q
    whole = made.arm(text, length=found.characteristic_length)
    point = [({"j3": 0.7} | found.q)[name] for name in whole.chain.names]
    kept = np.delete(whole.jacobian(point), 3, axis=1)
    assert measures.worst_case_sigma(kept) == pytest.approx(found.worst_case_sigma, abs=1e-9)


def test_two_failures_at_once(made):
    arm = made.arm(made.offset_arm(8), task="position")
    found = best_posture(arm, Search(failures=2, starts=4)).assessment
    matrix = np.array(found.jacobian)
    assert found.worst_case_sigma == measures.worst_case_sigma(matrix, 2) > 0.1


def test_a_near_structural_arm_reaches_what_direct_search_reaches(made):
    """With offsets of 20 µm; Nelder–Mead on σ, from what was found and from a random one."""
    offsets = ["0 0 0", "0.00002 0 0", "0 0 0", "0 0 0.4", "0 0 0.4", "0 0 0", "0 0 0"]
    arm = made.arm(made.urdf(made.serial(offsets)), point=(0, 0, 0.1))
    found = best_posture(arm, Search(starts=20))
    (failure,) = found.assessment.structural
    assert (failure.joint, failure.kind) == ("j3", "near-structural")
    assert found.reached_best > 0
    best = found.assessment.worst_case_sigma
    lower, upper = arm.bounds

    def loss(point):
        return -measures.worst_case_sigma(arm.jacobian(np.clip(point, lower, upper))) / best

    rng = np.random.default_rng(8)
    point = np.array(list(found.assessment.q.values()))
    for start in (point, min((arm.sample(rng) for _ in range(64)), key=loss)):
        answer = minimize(loss, start, method="Nelder-Mead", options={"maxiter": 200})
        assert -answer.fun < 1.001


def test_the_isotropy_that_seven_joints_cannot_have_is_not_claimed(made):
    """Twenty-one equations in seven unknowns."""
    arm = made.arm(made.offset_arm())
    with pytest.raises(InputError, match="a matter of 18 independent equations"):
        best_posture(arm, Search("isotropy", starts=2))
    panda = real("Franka", "position").arm()
    with pytest.raises(InputError, match=r"not found from 2 starts.*Infeasible_Problem"):
        best_posture(panda, Search("isotropy", starts=2))


def test_a_start_that_did_not_converge_is_not_the_best(made, monkeypatch):
    """The first stops early at a posture of its own, with a score that looks better."""
    arm = made.arm(made.offset_arm(), task="position")
    usual = best_posture(arm, Search(starts=3)).assessment
    judge = solving.judge

    def judged(*arguments):
        record = judge(*arguments)
        if record.index:
            return record
        status = replace(record.status, return_status="Restoration_Failed")
        return replace(record, status=status, score=9.0, variables=np.zeros(arm.size))

    for method in (solving, solved_together):
        monkeypatch.setattr(method, "judge", judged)
    found = best_posture(arm, Search(starts=3))
    assert found.reached_best > 0
    assert any(found.assessment.q.values())
    assert found.assessment.worst_case_sigma <= usual.worst_case_sigma + 1e-9
    assert best_posture(arm, Search(starts=1)).reached_best == 0


def test_the_search_goes_on_until_optima_are_unlikely_to_be_unseen(made):
    """As many starts as the rule wants, the same for any workers; the best of all."""
    arm = made.planar([1.0, 0.7, 0.4, 0.9])
    found = best_posture(arm)
    assert found.settled
    assert found.reached_best >= LEAST_REACHED
    assert found.unseen_share <= UNSEEN_SHARE
    assert (found.optima + 1) / (found.starts - 1) == pytest.approx(found.unseen_share)
    assert found.starts == 100 or (found.optima + 1) / (found.starts / 2 - 1) > UNSEEN_SHARE
    few = best_posture(arm, Search(starts=5, seed=1))
    assert not few.settled
    assert few.assessment.worst_case_sigma <= found.assessment.worst_case_sigma + 1e-9
    draws = arm.samples(np.random.default_rng(3), 4)
    rng = np.random.default_rng(3)
    assert draws.tolist() == [arm.sample(rng).tolist() for _ in range(4)]


def test_an_interrupt_before_more_starts_keeps_what_was_found(made, monkeypatch):
    arm, chosen = made.planar([1.0, 0.7, 0.4, 0.9]), iter([True])

    def once(*arguments):
        if next(chosen, False):
            return promising_starts(*arguments)
        raise KeyboardInterrupt

    monkeypatch.setattr(posture_search, "_STAGES", (5, 10))
    monkeypatch.setattr(posture_search, "promising_starts", once)
    found = best_posture(arm)
    assert (found.starts, found.complete) == (5, False)
    assert found.assessment.worst_case_sigma > found.mid_range_sigma


def test_few_optima_may_be_unseen(made):
    arm, share = made.planar([1.0, 0.7, 0.4, 0.9]), UNSEEN_SHARE
    for failures in (1, 2):
        search = Search(failures=failures, starts=40)
        outcome = searched(arm, search)
        for tried in (share * 0.9, share * 1.1):  # so many starts that this share is unseen
            count = round((len(outcome.scores) + 1) / tried) + 1
            records = (outcome.records * count)[:count]
            more = replace(outcome, records=records)
            assert more.unseen_share == pytest.approx(tried, rel=0.08)
            assert is_settled(more) == (tried < share)


def test_ten_starts_have_to_reach_the_best(made):
    """Of hundreds whose other optima are all known."""
    arm = made.planar([1.0, 0.7, 0.4, 0.9])
    outcome = searched(arm, Search(failures=2, starts=40))
    others = tuple(one for one in outcome.records if one not in outcome.reached)
    assert others
    for best in (9, 10):
        records = (outcome.reached * 10)[:best] + others * 50
        more = replace(outcome, records=records)
        assert (len(more.reached), is_settled(more)) == (best, best == 10)
