"""What J is worth seen along one of its columns, and the angles that five columns see."""

from fractions import Fraction
from itertools import combinations
from math import sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lockedjoint as lj
from lockedjoint.formulations import condition, measures
from lockedjoint.formulations.atlas.entry import Entry
from lockedjoint.formulations.atlas.proved_closed_forms import closed_form_proves
from lockedjoint.formulations.bounds.certified import largest_worst_case, planar_on_record

GOLDEN = (1 + sqrt(5)) / 2
LIMIT = GOLDEN - sqrt(GOLDEN)
SEEDS = st.integers(0, 2**32 - 1)


def seen_along(jacobian, column):
    """Return the other columns, projected along one of them: one row less."""
    along = jacobian[:, column] / np.linalg.norm(jacobian[:, column])
    rows = np.linalg.svd(along[None])[2][1:]
    return rows @ np.delete(jacobian, column, axis=1)


@given(st.integers(3, 6), st.integers(2, 4), st.integers(1, 2), SEEDS)
def test_seen_along_a_column_an_arm_is_no_worse(m, extra, failures, seed):
    jacobian = np.random.default_rng(seed).standard_normal((m, m + extra))
    traces = []
    for column in range(m + extra):
        seen = seen_along(jacobian, column)
        least = measures.worst_case_sigma(jacobian, failures)
        assert measures.worst_case_sigma(seen, failures) >= least - 1e-12
        ratio = condition.score(jacobian, failures)
        assert condition.score(seen, failures) >= ratio - 1e-12
        traces.append(np.sum(seen**2))
    assert min(traces) <= (1 - 1 / m) * np.sum(jacobian**2) + 1e-9


def largest_angle_seen(columns):
    """Return the least angle at which a column sees two others."""
    angles = []
    for column in range(columns.shape[1]):
        seen = seen_along(columns, column)
        seen = seen / np.linalg.norm(seen, axis=0)
        pairs = combinations(range(seen.shape[1]), 2)
        angles += [np.arccos(min(abs(seen[:, i] @ seen[:, j]), 1.0)) for i, j in pairs]
    return min(angles)


@given(SEEDS, st.floats(0.0, 1.0))
def test_five_columns_see_two_at_no_more_than_the_pentagram_does(seed, size):
    rng = np.random.default_rng(seed)
    columns = pentagram() + size * rng.standard_normal((3, 5))
    assert largest_angle_seen(columns) <= np.arcsin(1 / GOLDEN) + 1e-6
    assert condition.score(columns, 2) <= LIMIT


def pentagram():
    """Return the regular one of Gauss: five unit vectors, each normal to two others."""
    turns = 2 * np.pi * np.arange(5) / 5
    height = 1 / sqrt(sqrt(5))
    flat = sqrt(1 - height**2)
    return np.vstack([flat * np.cos(turns), flat * np.sin(turns), np.full(5, height)])


def test_the_pentagram_attains_the_angle():
    assert np.abs(pentagram().T @ pentagram()).min() < 1e-12
    assert np.sin(largest_angle_seen(pentagram())) == pytest.approx(1 / GOLDEN, rel=1e-9)


def test_the_bound_is_the_pentagram_s_and_is_proved_exactly():
    asked = Entry("free-mean", 3, 5, 2, "condition")
    assert asked.bound.value == pytest.approx(LIMIT, rel=1e-12)
    assert asked.bound.value > LIMIT
    assert closed_form_proves(asked, Fraction(asked.bound.value) ** 2)
    assert not closed_form_proves(asked, Fraction(LIMIT * (1 - 1e-12)) ** 2)
    four = condition.bound(lj.arm("free-mean", 6, 4), 2)
    assert four.value == pytest.approx(LIMIT, rel=1e-12)


@pytest.mark.parametrize(("joints", "failures"), [(7, 3), (8, 3), (9, 3)])
def test_the_planar_record_bounds_arms_in_space(joints, failures):
    planar = planar_on_record((2, joints - 1), failures, "max-min")
    bound = largest_worst_case(lj.arm("free-mean", joints, 3), failures)
    expected = planar.value * sqrt(2 / 3 * joints / (joints - 1))
    assert bound.value == pytest.approx(expected, rel=1e-14)
    assert bound.kind == planar.kind
