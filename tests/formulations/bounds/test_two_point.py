"""The two-point bound: what it proves, against other bounds and what is found."""

import json
from importlib.resources import files

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockedjoint.formulations import measures
from lockedjoint.formulations.bounds import two_point
from lockedjoint.formulations.bounds.certified import largest_worst_case
from lockedjoint.formulations.bounds.several_failures import with_one_more_locked
from lockedjoint.formulations.bounds.two_point import TwoPointBound, two_point_bound
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import FreeColumn
from lockedjoint.formulations.joints.models import arm

RECORD = json.loads(
    (files("lockedjoint.formulations.bounds") / "two_point.json").read_text("utf-8")
)


@pytest.mark.slow
def test_six_lines_in_space_are_met_and_on_record(monkeypatch):
    """The mean over failures is attained there, so nothing sharper can be true."""
    # The third round and those after it gain less than the tolerances below.
    monkeypatch.setattr(two_point, "ROUNDS", 2)
    icosahedron, exact = two_point_bound(3, 6), measures.sigma_bound(3, 6, 6, 2)
    assert exact <= icosahedron.singular_value_bound <= exact * 1.005
    [same] = [one for one in RECORD if (one["task_dimension"], one["joints"]) == (3, 6)]
    assert same["trace_limit"] == pytest.approx(icosahedron.trace_limit, rel=1e-3)
    assert set(same) == set(icosahedron.to_dict())


@pytest.mark.parametrize("one", RECORD, ids=lambda one: one["command"][-24:])
def test_the_record_says_one_thing(one):
    m, n = one["task_dimension"], one["joints"]
    names = ("trace_limit", "violation", "blocks", "lift")
    stored = TwoPointBound(m, n, *(one[name] for name in names))
    assert stored.to_dict() == one
    assert one["violation"] < 1e-3
    assert stored.is_proved()
    if (m, n) != (3, 6):  # where the closed form is attained
        bound = largest_worst_case(arm("free-mean", n, m), 2)
        assert bound.value == pytest.approx(stored.singular_value_bound, rel=1e-12)


@pytest.mark.parametrize("one", RECORD[:3], ids=lambda one: one["command"][-24:])
def test_mutants_are_not_proved(one):
    m, excess = one["task_dimension"], one["trace_limit"] - one["task_dimension"]
    mutants = [{"trace_limit": m + excess * factor} for factor in (0.5, 0.99, 0.99999)]
    for k, block in enumerate(one["blocks"]):
        turned = [[-value for value in line] for line in block]
        mutants.append({"blocks": [*one["blocks"][:k], turned, *one["blocks"][k + 1 :]]})
    mutants += [{"violation": 0.0}, {"lift": [0.9 * value for value in one["lift"]]}]
    names = ("trace_limit", "violation", "blocks", "lift")
    for changed in (one | mutant for mutant in mutants):
        assert not TwoPointBound(m, one["joints"], *(changed[k] for k in names)).is_proved()


def test_it_serves_every_arm_of_its_size():
    free = largest_worst_case(arm("free-mean", 8, 3), 2).value
    twice = Arm.of(FreeColumn(3, 2.0, "each"), 8)
    assert largest_worst_case(twice, 2).value == pytest.approx(2 * free)
    assert largest_worst_case(arm("free-mean", 8, 3), 1).kind == "closed form"


@given(st.integers(1, 8), st.integers(2, 10))
def test_one_more_locked_from_one_is_the_mean_over_two(m, more):
    n = m + more
    limit = with_one_more_locked(m, n, n - 1)  # after one failure tr G is at most n − 1
    level = (1 - m / limit) / m
    assert level == pytest.approx(measures.eigenvalue_bound(m, n, 1.0, 2), rel=1e-9)


@given(st.integers(1, 4), st.integers(3, 6), st.integers(2, 3), st.integers(0, 10_000))
def test_one_more_locked_holds(m, more, failures, seed):
    n = m + more
    jacobian = np.random.default_rng(seed).normal(size=(m, n))
    t = measures.worst_case_sigma(jacobian, failures) ** 2 * (1 - 1e-9)

    def trace_of(columns):
        matrix = columns @ columns.T
        return np.trace(np.linalg.solve(matrix - t * np.eye(m), matrix))

    limit = max(trace_of(np.delete(jacobian, one, axis=1)) for one in range(n))
    assert trace_of(jacobian) <= with_one_more_locked(m, n, limit) * (1 + 1e-9)


@pytest.mark.parametrize(("m", "n"), [(3, 8), (3, 9), (3, 12)])
def test_three_locked_joints_gain_by_it(m, n):
    bound = largest_worst_case(arm("free-mean", n, m), 3).value
    assert bound < measures.sigma_bound(m, n, n, 3)


def test_the_zonal_polynomials_are_positive_definite():
    """Their matrices over any unit vectors have no negative eigenvalue."""
    rng = np.random.default_rng(3)
    for m in (2, 3, 6):
        lines = rng.normal(size=(40, m))
        lines /= np.linalg.norm(lines, axis=1, keepdims=True)
        zonal = two_point._zonal(m, np.clip(lines @ lines.T, -1, 1).ravel())
        for values in zonal.T:
            matrix = values.reshape(40, 40)
            assert np.linalg.eigvalsh(matrix)[0] > -1e-9
            np.testing.assert_allclose(np.diag(matrix), 1, atol=1e-9)


def test_pairs_of_columns_are_in_the_allowed_set():
    """cos² ≤ (1 − d)(1 − e)/(d e), from a Jacobian and its t alone."""
    jacobian = np.random.default_rng(5).normal(size=(3, 7))
    t = measures.worst_case_sigma(jacobian, 2) ** 2
    gram = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T - t * np.eye(3), jacobian)
    d = np.diag(gram)
    left = np.outer(1 - d, 1 - d) - gram**2
    np.fill_diagonal(left, 1)
    assert -1e-9 < left.min() < 1e-9  # the worst pair is on its border
    size = measures.trace(jacobian)
    assert t <= size / 3 * (1 - 3 / np.trace(gram)) + 1e-12
