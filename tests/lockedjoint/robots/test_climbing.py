"""All starts of max-min at once: against differences, and Ipopt from the same starts."""

from dataclasses import replace

import numpy as np
import pytest

from lockedjoint.nlp.problem import LIMIT, SUCCESS
from lockedjoint.nlp.starts import generator
from lockedjoint.robots import climbing, solved_together
from lockedjoint.robots.climbing import climb
from lockedjoint.robots.max_min_values import MaxMinValues
from lockedjoint.robots.posture_search import searched
from lockedjoint.robots.promising_starts import promising_starts
from lockedjoint.robots.search import Search

OFFSETS = ["0.1 0.05 0.3", "0 0.2 0.1", "0.1 0 0.3", "0 0.1 0.2", "0.3 0 0", "0 0.1 0", "0 0 1"]


@pytest.fixture(scope="module", params=["revolute", "rail", "position"])
def arm(request, made):
    kinds = {"j1": {"kind": "prismatic"}} if request.param == "rail" else {}
    task = "position" if request.param == "position" else "all"
    return made.arm(made.urdf(made.serial(OFFSETS, **kinds)), task=task)


def starts(arm, count):
    return promising_starts(arm, [generator(0, k) for k in range(count)])


def test_slacks_are_of_the_statement(arm):
    """λ_min after each failure is above t exactly where the slack of the joint is above 0."""
    values, rng = MaxMinValues(arm), np.random.default_rng(0)
    q = arm.samples(rng, 50)
    whole = [arm.jacobian(point) for point in q]
    least = np.array([np.linalg.svd(matrix)[1][-1] ** 2 for matrix in whole])
    levels = least * rng.uniform(0.05, 0.95, len(q))
    slacks = values.slacks(np.column_stack([q, np.log(levels)]))[:, : arm.size]
    for matrix, level, own in zip(whole, levels, slacks, strict=True):
        left = [np.delete(matrix, f, axis=1) for f in range(arm.size)]
        after = np.array([np.linalg.svd(one)[1][-1] ** 2 for one in left])
        assert ((after > level) == (own > 0)).all()


def test_derivatives_are_those_by_differences(arm):
    values, rng, step = MaxMinValues(arm), np.random.default_rng(1), 1e-6
    q = starts(arm, 8)
    x = np.column_stack([q, np.log(0.8 * arm.worst_case(q)[0] ** 2)])
    y = rng.uniform(0.1, 1.0, values.slacks(x).shape)
    slopes, curved = values.derivatives(x, y)
    for a, d in enumerate(step * np.eye(values.size)):
        ahead, behind = (values.slacks(x + sign * d) for sign in (1, -1))
        assert slopes[:, :, a] == pytest.approx(
            (ahead - behind) / (2 * step), rel=1e-5, abs=1e-5
        )
        pulls = [
            np.einsum("bp,bpa->ba", y, values.derivatives(x + sign * d, y)[0])
            for sign in (1, -1)
        ]
        wanted = (pulls[1] - pulls[0]) / (2 * step)
        scale = np.abs(curved).max()
        assert curved[:, a] == pytest.approx(wanted, abs=1e-6 * scale)


def test_it_ends_where_ipopt_ends(arm):
    """From the same starts; nearly all are as good, and the best is the same."""
    together = searched(arm, Search(starts=30))
    alone = searched(arm, Search(starts=30, ipopt={"max_iter": 150}))
    assert together.best.score == pytest.approx(alone.best.score, abs=1e-7)
    ours, theirs = (np.array([one.score for one in each.records]) for each in (together, alone))
    assert np.mean(ours > theirs - 1e-6) >= 0.8
    assert {record.index for record in together.records} == set(range(30))


def test_a_start_ends_as_it_would_alone_and_within_the_limits(arm):
    points = starts(arm, 20)
    ended, alone = climb(arm, points), climb(arm, points[7:8])
    assert ended.points[7] == pytest.approx(alone.points[0], abs=1e-7)
    assert ended.statuses.count(SUCCESS) >= 18
    lower, upper = arm.bounds
    assert np.all((ended.points >= lower) & (ended.points <= upper))
    sigma = arm.worst_case(ended.points)[0]
    assert np.all(ended.levels <= sigma**2 * (1 + 1e-9))
    converged = np.array(ended.statuses) == SUCCESS
    assert ended.levels[converged] == pytest.approx(sigma[converged] ** 2, rel=1e-6)
    assert not ended.violations.any()


def test_a_start_that_did_not_end_goes_through_ipopt(arm, monkeypatch):
    monkeypatch.setattr(climbing, "_MOST_STEPS", 2)
    found = searched(arm, Search(starts=4))
    assert found.reached
    assert all(record.earlier[0].return_status == LIMIT for record in found.records)
    assert [record.index for record in found.records] == list(range(4))


def test_the_better_of_both_answers_is_kept(arm, monkeypatch):
    found = searched(arm, Search(starts=6))
    worse = solved_together.judge

    def poor(case, run, *more):
        record = worse(case, run, *more)
        return record if not run.solution.earlier else _lowered(record)

    monkeypatch.setattr(solved_together, "judge", poor)
    again = searched(arm, Search(starts=6))
    assert again.best.score >= found.best.score - 1e-9
    assert not again.best.earlier


def _lowered(record):
    return replace(record, score=record.score - 0.01)
