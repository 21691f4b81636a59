"""Third statement: the best worst case among exactly isotropic Jacobians."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockedjoint.formulations import isotropy, measures
from lockedjoint.formulations.atlas.collection import page_of
from lockedjoint.formulations.atlas.entry import entry
from lockedjoint.formulations.bounds.isotropic import isotropic_unit_bound
from lockedjoint.formulations.joints.joint import NotInModelError
from lockedjoint.formulations.joints.models import arm
from lockedjoint.nlp.multistart import multistart


def run(built, starts, failures=1):
    """The solutions from some starts."""
    build = partial(isotropy.build, built, failures)
    results = multistart(build, built.sample, starts=starts, rng=0).results
    return [one.solution for one in results]


def scores(solutions, failures=1):
    return np.array([isotropy.score(one.outputs["jacobian"], failures) for one in solutions])


@pytest.mark.parametrize(
    ("model", "n", "m"),
    [("free", 3, 2), ("free", 6, 3), ("free-mean", 5, 3), ("unit-revolute", 8, 6)],
)
def test_meets_the_equations_and_the_bound_where_it_can(model, n, m):
    built = arm(model, n, m)
    bound = measures.sigma_bound(m, n, built.largest_trace)
    for solution in run(built, 3):
        assert solution.status.success
        assert measures.is_optimally_failure_tolerant(solution.outputs["jacobian"])
        assert scores([solution]) == pytest.approx([bound], abs=1e-7)


def test_unit_revolute_7r_is_seen_to_be_infeasible():
    for solution in run(arm("unit-revolute", 7), 5):
        assert solution.status.return_status == "Infeasible_Problem_Detected"
        assert solution.violation > 0.05
        assert scores([solution]) == -np.inf


def test_free_lever_arms_of_bounded_length_are_infeasible_too():
    """Isotropy forces mean |v|² = 1, so |v_i| ≤ 1 leaves unit revolute joints only.

    Ipopt's point may meet the equations by breaking a bound: the model has the last word.
    """
    built = arm("lever-revolute-each", 7)
    for solution in run(built, 4):
        assert not solution.status.success
        if np.isfinite(scores([solution])):
            with pytest.raises(NotInModelError):
                built.variables(solution.outputs["jacobian"])


def test_free_lever_arms_give_isotropic_7r():
    built = arm("lever-revolute", 7)
    found = run(built, 20)
    values = scores(found)
    assert np.sum(np.abs(values - 0.480383041) < 1e-6) >= 18
    jacobian = found[int(np.argmax(values))].outputs["jacobian"]
    built.variables(jacobian)
    np.testing.assert_allclose(jacobian @ jacobian.T, 7 / 3 * np.eye(6), atol=1e-8)
    longest = np.max(np.sum(jacobian[:3] ** 2, axis=0))
    assert measures.worst_case_sigma(jacobian) == pytest.approx(np.sqrt(4 / 3 - longest))


def test_score_refuses_what_is_not_isotropic():
    jacobian = np.random.default_rng(0).normal(size=(3, 5))
    assert isotropy.score(jacobian) == -np.inf
    frame = np.linalg.qr(jacobian.T)[0].T
    assert isotropy.score(frame) == measures.worst_case_sigma(frame)


@pytest.mark.parametrize(
    ("m", "n", "failures", "square"),
    [
        (2, 5, 2, 5 / 2 - 1 - np.cos(np.pi / 5)),  # lines at equal angles
        (2, 6, 3, 3 - 1.5 - np.sqrt(3) / 2),  # three lines, each twice
        (3, 7, 2, 7 / 3 - 1 - 1 / np.sqrt(3)),  # diagonals and axes of a cube
    ],
)
def test_several_failures_of_unit_columns(m, n, failures, square):
    built = arm("free", n, m)
    best = scores(run(built, 4, failures), failures).max()
    assert best == pytest.approx(np.sqrt(square), abs=1e-8)
    limit = isotropy.bound(built, failures).value
    assert best - 1e-12 <= limit <= np.sqrt(square) * (1 + 1e-12)


def test_several_failures_agree_with_max_min_where_the_best_is_isotropic():
    best = scores(run(arm("free-mean", 6, 2), 6, 2), 2).max()
    assert best == pytest.approx(float(page_of(entry("free-mean_2x6_k2")).value), abs=1e-8)


@given(st.sampled_from([2, 3, 4]), st.integers(2, 4), st.integers(0, 2**32 - 1))
def test_no_union_of_bases_beats_the_bound(m, bases, seed):
    rng = np.random.default_rng(seed)
    drawn = [np.linalg.qr(rng.standard_normal((m, m)))[0] for _ in range(bases)]
    jacobian = np.hstack(drawn)
    for failures in range(1, m * bases - m + 1):
        limit = isotropic_unit_bound(m, m * bases, min(failures, 4))
        assert measures.worst_case_sigma(jacobian, min(failures, 4)) ** 2 <= limit + 1e-12
