"""Relative manipulability after failures: its bound, its invariance, what it is blind to."""

from itertools import combinations
from math import comb, sqrt

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sympy import Matrix

import lockedjoint as lj
from lockedjoint.formulations import manipulability, measures
from lockedjoint.formulations.atlas.collection import page_of
from lockedjoint.formulations.atlas.entry import entry
from lockedjoint.formulations.joints.joint import NotInModelError

SEEDS = st.integers(0, 2**32 - 1)
SHAPES = st.sampled_from([(2, 3, 1), (2, 5, 3), (3, 6, 2), (6, 7, 1), (6, 8, 2), (6, 9, 1)])


def random_matrix(m, n, seed):
    return np.random.default_rng(seed).standard_normal((m, n))


@pytest.fixture(scope="module")
def seven():
    return lj.solve("manipulability", "unit-revolute", joints=7, starts=4)


@given(SHAPES, SEEDS)
def test_no_jacobian_beats_the_bound(shape, seed):
    m, n, failures = shape
    bound = manipulability.bound(lj.arm("free-mean", n, m), failures).value
    mean = sqrt(comb(n - failures, m) / comb(n, m))
    assert bound == pytest.approx(mean) if failures == 1 else bound <= mean * (1 + 1e-15)
    assert 0 <= manipulability.score(random_matrix(m, n, seed), failures) <= bound


@given(SHAPES, SEEDS)
def test_no_change_of_the_task_s_coordinates_changes_it(shape, seed):
    m, n, failures = shape
    jacobian, change = random_matrix(m, n, seed), random_matrix(m, m, seed + 1)
    change += 3 * np.sign(np.linalg.det(change)) * np.eye(m)
    if np.linalg.cond(change) < 1e4:
        before = measures.relative_manipulability(jacobian, failures)
        after = measures.relative_manipulability(change @ jacobian, failures)
        np.testing.assert_allclose(after, before, atol=1e-8)


SMALL = st.sampled_from([(2, 4, 1), (2, 4, 2), (2, 5, 3), (3, 5, 2), (3, 6, 2)])


@given(SMALL, st.integers(0, 10_000))
def test_the_mean_of_its_squares_is_the_same_for_every_jacobian(shape, seed):
    """Cauchy and Binet, in whole numbers."""
    m, n, failures = shape
    jacobian = np.random.default_rng(seed).integers(-9, 10, (m, n))
    whole = Matrix(jacobian @ jacobian.T).det()
    left = [np.delete(jacobian, sets, axis=1) for sets in combinations(range(n), failures)]
    total = sum(Matrix(one @ one.T).det() for one in left)
    assert total == comb(n - m, failures) * whole
    if whole:
        ratios = measures.relative_manipulability(jacobian, failures)
        mean = comb(n - failures, m) / comb(n, m)
        assert np.mean(ratios**2) == pytest.approx(mean, rel=1e-9)


def test_seven_revolute_joints_attain_it(seven):
    assert seven.best.score == pytest.approx(sqrt(1 / 7), abs=1e-9)
    assert len(seven.reached) == 4
    ratios = measures.relative_manipulability(seven.best.jacobian)
    np.testing.assert_allclose(ratios, sqrt(1 / 7), atol=1e-7)


def test_that_contradicts_no_theorem(seven):
    """What attains it is optimal up to a change of coordinates that leaves the model."""
    limit = lj.bound("max-min", seven.arm).value
    for record in seven.reached:
        jacobian = record.jacobian
        assert measures.worst_case_sigma(jacobian) < limit < sqrt(1 / 3)
        assert not measures.is_optimally_failure_tolerant(jacobian, 1e-2)
        values, vectors = np.linalg.eigh(jacobian @ jacobian.T)
        isotropic = (vectors / np.sqrt(values)) @ vectors.T @ jacobian
        assert measures.is_optimally_failure_tolerant(isotropic, 1e-6)
        assert manipulability.score(isotropic) == pytest.approx(record.score, abs=1e-9)
        scaled = isotropic * sqrt(14 / measures.trace(isotropic))
        with pytest.raises(NotInModelError):
            seven.arm.variables(scaled)


def test_eight_null_space_columns_a_sixteenth_turn_apart_are_the_best_found_for_two():
    """With n − m = k = 2 a ratio is the area between two null-space columns: sin(π/8)/4."""
    angles = np.arange(8) * np.pi / 8
    null = np.array([np.cos(angles), np.sin(angles)]) / 2
    jacobian = np.linalg.svd(null)[2][2:]
    score = manipulability.score(jacobian, 2)
    assert score == pytest.approx(np.sin(np.pi / 8) / 4, abs=1e-12)
    best = page_of(entry("unit-revolute_6x8_k2_manipulability"))
    assert float(best.value) == pytest.approx(score, abs=1e-12)


def null_space_of_nine():
    """Return the axes and the diagonals of a cube's faces, a tight frame, shape (3, 9)."""
    axes = sqrt(3 / 7) * np.eye(3)
    turned = [np.roll([1.0, sign, 0.0], shift) for shift in range(3) for sign in (1, -1)]
    return np.hstack([axes, np.transpose(turned) / sqrt(7)])


def test_two_of_nine_leave_less_than_the_mean_says():
    null = null_space_of_nine()
    assert np.abs(null @ null.T - np.eye(3)).max() < 1e-15
    nine = np.linalg.svd(null)[2][3:]
    assert manipulability.score(nine, 2) == pytest.approx(sqrt(3) / 7, rel=1e-12)
    bound = manipulability.bound(lj.arm("free-mean", 9, 6), 2).value
    assert bound == pytest.approx(1 / sqrt(15), rel=1e-12)
    assert bound > 1 / sqrt(15) > sqrt(3) / 7


@given(st.integers(2, 4), st.integers(0, 4), SEEDS, st.floats(0.0, 1.0))
def test_more_lines_than_symmetric_tensors_leave_no_more_than_their_bound(r, more, seed, size):
    n = r * (r + 1) // 2 + 1 + more
    rng = np.random.default_rng(seed)
    null = rng.standard_normal((r, n))
    if (r, n) == (3, 9):  # near the best ones
        null = null_space_of_nine() + size * null
    jacobian = np.linalg.svd(null)[2][r:]
    limit = r * sqrt((r - 1) / ((r + 2) * n * (n - r)))
    bound = manipulability.bound(lj.arm("free-mean", n, n - r), 2).value
    assert manipulability.score(jacobian, 2) <= bound <= limit * (1 + 1e-13)


def test_no_failure_leaves_anything_where_too_many_lock():
    left = measures.relative_manipulability(random_matrix(6, 7, 0), 2)
    np.testing.assert_array_equal(left, np.zeros(21))


def test_the_program_says_what_is_measured():
    """Its constraints at a start: the squares of what NumPy measures, minus t."""
    arm = lj.arm("unit-revolute", 8)
    point = arm.sample(np.random.default_rng(0))
    problem = manipulability.build(arm, 2)
    start = problem.complete_start(point)
    squares = measures.relative_manipulability(arm.jacobian(point), 2) ** 2
    assert start[-1] == pytest.approx(squares.min())
    [left] = [one for one in problem.constraints if one.name == "manipulability left"]
    values = ca.Function("left", [problem.variables], [left.expression])(start)
    np.testing.assert_allclose(values.full().ravel(), squares - squares.min(), atol=1e-12)
