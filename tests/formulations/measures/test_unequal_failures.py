"""Unequal failures: model and measures against every outcome enumerated, and the bounds."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockedjoint.formulations import measures
from lockedjoint.formulations.bounds.unequal_failures import assess_failures, fallible_bound
from lockedjoint.formulations.measures import unequal_failures
from lockedjoint.formulations.measures.unequal_failures import FailureModel


def outcomes(values):
    """Every pattern of failed joints with its probability."""
    for pattern in product((False, True), repeat=len(values)):
        factors = [p if failed else 1 - p for p, failed in zip(values, pattern, strict=True)]
        yield tuple(i for i, failed in enumerate(pattern) if failed), np.prod(factors)


@st.composite
def cases(draw):
    """A Jacobian with columns of unequal lengths and a failure model that it can have."""
    m, redundancy = draw(st.integers(1, 3)), draw(st.integers(1, 3))
    n = m + redundancy
    count = draw(st.integers(1, redundancy))
    levels = st.sampled_from([0.0, 0.01, 0.1, 0.3, 0.9])
    values = draw(st.lists(levels, min_size=n, max_size=n))
    for place in range(count):  # some joints must be able to fail
        values[place] = values[place] or 0.2
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    jacobian = rng.normal(size=(m, n)) * rng.choice([0.1, 1.0, 3.0], size=n)
    return jacobian, FailureModel(tuple(values), count)


def left(jacobian, joints):
    kept = np.delete(jacobian, joints, axis=1)
    m = jacobian.shape[0]
    return np.linalg.svd(kept)[1][m - 1] if kept.shape[1] >= m else 0.0


@given(cases())
def test_the_expectation_is_that_over_all_outcomes(case):
    jacobian, failures = case
    every = [(joints, p) for joints, p in outcomes(failures.probabilities) if p > 0]
    exactly = [(joints, p) for joints, p in every if len(joints) == failures.failures]
    mean = sum(p * left(jacobian, joints) for joints, p in exactly) / sum(p for _, p in exactly)
    assert unequal_failures.expected_sigma(jacobian, failures) == pytest.approx(mean)
    covered = [(joints, p) for joints, p in every if len(joints) <= failures.failures]
    overall = sum(p * left(jacobian, joints) for joints, p in covered)
    assert unequal_failures.overall_expected_sigma(jacobian, failures) == pytest.approx(overall)
    total = sum(p for _, p in covered)
    assert unequal_failures.covered_probability(failures) == pytest.approx(total)


@given(cases())
def test_no_failure_is_worse_than_the_weighted_worst_case(case):
    jacobian, failures = case
    value, worst = unequal_failures.weighted_worst_case(jacobian, failures)
    weights = failures.weights()
    assert left(jacobian, worst) == pytest.approx(weights[worst] * value, abs=1e-12)
    for joints, weight in weights.items():
        assert left(jacobian, joints) >= weight * value - 1e-9


@given(cases())
def test_orders_among_the_measures(case):
    """Worst ≤ expected; over fewer failures the worst case is better; weights only raise it."""
    jacobian, failures = case
    worst = unequal_failures.possible_worst_case_sigma(jacobian, failures)
    expected = unequal_failures.expected_sigma(jacobian, failures)
    assert measures.worst_case_sigma(jacobian, failures.failures) <= worst + 1e-12
    assert worst <= expected + 1e-12
    assert worst <= unequal_failures.weighted_worst_case(jacobian, failures)[0] + 1e-12


@given(cases(), st.integers(0, 1000))
def test_joints_keep_their_probabilities_when_they_change_places(case, seed):
    jacobian, failures = case
    order = np.random.default_rng(seed).permutation(failures.joints)
    moved = FailureModel(tuple(failures.probabilities[i] for i in order), failures.failures)
    for measure in (
        unequal_failures.expected_sigma,
        unequal_failures.overall_expected_sigma,
        unequal_failures.possible_worst_case_sigma,
        lambda matrix, model: unequal_failures.weighted_worst_case(matrix, model)[0],
    ):
        expected = measure(jacobian, failures)
        assert measure(jacobian[:, order], moved) == pytest.approx(expected, abs=1e-9)


@given(cases())
def test_equal_probabilities_are_eq_5(case):
    jacobian, failures = case
    alike = FailureModel.equally_likely(failures.joints, failures.failures)
    plain = measures.worst_case_sigma(jacobian, alike.failures)
    assert unequal_failures.weighted_worst_case(jacobian, alike)[0] == pytest.approx(plain)
    mean = np.mean(measures.locked_singular_values(jacobian, alike.failures))
    assert unequal_failures.expected_sigma(jacobian, alike) == pytest.approx(mean)


@given(cases())
def test_no_jacobian_beats_the_bounds(case):
    jacobian, failures = case
    found = assess_failures(jacobian, failures)
    slack = 1e-9 * np.linalg.norm(jacobian)
    assert found["possible_worst_sigma"] <= found["possible_worst_bound"] + slack
    assert found["weighted_worst_sigma"] <= found["weighted_worst_bound"] * (1 + 1e-9) + slack
    assert found["expected_sigma"] <= found["expected_bound"] + slack
    # Nor the bound that knows the trace alone.
    m, n = jacobian.shape
    size, fallible = measures.trace(jacobian), len(failures.fallible)
    level = fallible_bound(m, n, fallible, size, failures.failures)
    worst = unequal_failures.possible_worst_case_sigma(jacobian, failures)
    assert worst**2 <= level + 1e-9 * size


@given(st.integers(1, 4), st.integers(1, 4), st.data())
def test_if_all_may_fail_it_is_the_bound_for_several_failures(m, more, data):
    n, k = m + more, data.draw(st.integers(1, more))
    level = fallible_bound(m, n, n, 2.0, k)
    assert level == pytest.approx(measures.sigma_bound(m, n, 2.0, k) ** 2)
    fewer = fallible_bound(m, n, max(n - 1, k), 2.0, k)
    assert fewer >= level - 1e-12


def test_enough_joints_that_never_fail_attain_it():
    """All fallible columns parallel, the others make JJᵀ less one of them isotropic."""
    level, columns = 4.0, np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    jacobian = np.column_stack([columns, np.diag([np.sqrt(level - 2), np.sqrt(level)])])
    found = assess_failures(jacobian, FailureModel.equally_likely(5, never=(3, 4)))
    assert found["possible_worst_sigma"] == pytest.approx(np.sqrt(level))
    assert found["possible_worst_bound"] == pytest.approx(np.sqrt(level))


probabilities = st.lists(
    st.one_of(st.just(0.0), st.floats(0.001, 0.95)), min_size=3, max_size=6
).filter(lambda values: sum(value > 0 for value in values) >= 2)


@given(probabilities, st.integers(1, 2))
def test_shares_are_conditional_probabilities_and_weights_are_over_the_largest(values, count):
    exact = {joints: p for joints, p in outcomes(values) if len(joints) == count and p > 0}
    total, model = sum(exact.values()), FailureModel(tuple(values), count)
    shares, weights = model.shares(), model.weights()
    assert list(shares) == list(weights) == sorted(exact)
    assert max(weights.values()) == 1
    for joints, share in shares.items():
        assert share == pytest.approx(exact[joints] / total)
        assert weights[joints] == pytest.approx(share / max(shares.values()))


def test_joints_that_never_fail():
    model = FailureModel.equally_likely(5, 2, never=(0, 3))
    assert model.fallible == (1, 2, 4)
    assert model == FailureModel((0.5,) * 5, 2).sparing([3, 0])
    assert dict(model.shares()) == pytest.approx({(1, 2): 1 / 3, (1, 4): 1 / 3, (2, 4): 1 / 3})
