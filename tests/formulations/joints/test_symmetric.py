"""Arms that a map of finite order carries into themselves, checked column by column."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockedjoint.formulations import max_min, measures
from lockedjoint.formulations.joints import models
from lockedjoint.formulations.joints.arm import SymmetricArm
from lockedjoint.formulations.measures import remaining_singular_values
from lockedjoint.formulations.solving.polish import polish
from lockedjoint.nlp.solver import Solver

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
def test_the_distinct_sets_have_every_value_of_all_sets(size, seed, locked):
    symmetric, _, jacobian = drawn(size, seed)
    if locked > jacobian.shape[1] - jacobian.shape[0]:
        return

    def left(sets):
        return remaining_singular_values(jacobian, sets)[:, -1]

    few = left(symmetric.distinct_sets(locked))
    for value in left(measures.locked_sets(jacobian, locked)):
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
