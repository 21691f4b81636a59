"""Fifth statement: the condition number after failures, its bound and its exact value."""

from fractions import Fraction
from math import cos, pi, sqrt, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lockedjoint as lj
from lockedjoint.formulations import condition, measures
from lockedjoint.formulations.atlas.collection import page_of
from lockedjoint.formulations.atlas.entry import Entry, entry
from lockedjoint.formulations.atlas.improve import improve
from lockedjoint.formulations.atlas.proved_value import proved_value, ratio_exceeds

SEEDS = st.integers(0, 2**32 - 1)
SHAPES = [(1, 3, 1), (2, 3, 1), (2, 5, 2), (2, 5, 3), (3, 5, 1), (3, 6, 2), (6, 8, 2)]


def lines(n):
    angles = np.pi * np.arange(n) / n
    return np.vstack([np.cos(angles), np.sin(angles)])


@given(st.sampled_from(SHAPES), SEEDS)
def test_no_jacobian_beats_the_bound(shape, seed):
    m, n, failures = shape
    jacobian = np.random.default_rng(seed).standard_normal((m, n))
    bound = condition.bound(lj.arm("free-mean", n, m), failures)
    assert bound.certified
    left = [
        np.delete(jacobian, joints, 1) for joints in measures.locked_sets(jacobian, failures)
    ]
    conditions = [np.linalg.cond(one) for one in left]
    assert condition.score(jacobian, failures) == pytest.approx(1 / max(conditions), rel=1e-6)
    assert condition.score(jacobian, failures) <= bound.value


@pytest.mark.parametrize("n", [3, 4, 7, 12])
def test_lines_at_equal_angles_attain_it_after_one_failure_and_with_two_left(n):
    arm = lj.arm("free-mean", n, 2)
    one, last = (condition.bound(arm, k).value for k in (1, n - 2))
    assert one == pytest.approx(sqrt((n - 2) / n), rel=1e-12)
    assert condition.score(lines(n)) == pytest.approx(one, rel=1e-12)
    assert condition.score(lines(n), n - 2) == pytest.approx(tan(pi / (2 * n)), rel=1e-9)
    assert last == pytest.approx(tan(pi / (2 * n)), rel=1e-12)


def test_isotropic_columns_of_equal_norm_keep_one_minus_m_over_n():
    columns = page_of(entry("free_3x7_k1")).jacobian
    assert condition.score(columns) == pytest.approx(sqrt(4 / 7), abs=1e-7)
    limit = condition.bound(lj.arm("free-mean", 7, 3)).value
    assert sqrt(4 / 7) < limit < 1.02 * sqrt(4 / 7)


def test_the_icosahedron_is_the_best_known_after_two_failures():
    best = page_of(entry("free-mean_3x6_k2_condition"))
    six = page_of(entry("free-mean_3x6_k2")).jacobian
    closed = sqrt((1 - 1 / sqrt(5)) / 2)
    assert condition.score(six, 2) == pytest.approx(closed, abs=1e-7)
    assert float(best.value) == pytest.approx(closed, abs=1e-9)


def test_equal_angles_are_not_best_for_five_lines_and_two_failures():
    wide = 2 * cos(pi / 5) / 3
    assert condition.score(lines(5), 2) == pytest.approx(sqrt((1 - wide) / (1 + wide)))
    assert float(page_of(entry("free-mean_2x5_k2_condition")).value) > 0.559


def test_the_ratio_is_decided_exactly():
    # Columns (0, 1) and (1, 1) have eigenvalues (3 ± √5)/2: the ratio of roots is 0.3819660112…
    unit = 1 << 60
    columns = [[unit, 0], [0, unit], [unit, unit]]
    assert ratio_exceeds(columns, Fraction(38196601124, 10**11), 1)
    assert not ratio_exceeds(columns, Fraction(38196601126, 10**11), 1)


@given(SEEDS, st.floats(0.1, 10))
def test_the_proved_value_is_just_below_the_measured_one(seed, size):
    asked = Entry("free-mean", 3, 7, 2, condition.NAME)
    jacobian = np.random.default_rng(seed).standard_normal((3, 7))
    jacobian *= np.sqrt(7) / np.linalg.norm(jacobian)
    measured = condition.score(size * jacobian, 2)
    if measured > 1e-4:
        assert measured - 1e-8 <= float(proved_value(asked, jacobian)) <= measured * (1 + 1e-14)


def test_two_solvers_agree():
    outcome = lj.solve("condition", "free-mean", joints=4, task_dimension=2, starts=4)
    assert outcome.best.score == pytest.approx(sqrt(1 / 2), abs=1e-7)
    page = next(improve(entry("free-mean_2x5_k2_condition"), None, 1e-6))
    assert (page.found.starts, page.found.statement) == (20, "condition, polished")
    assert page.found.reached_best >= 15
    size = {"joints": 5, "task_dimension": 2, "failures": 2}
    stated = lj.solve("condition", "free-mean", starts=2, seed=1, **size)
    assert stated.best.score <= float(page.value) + 1e-7
