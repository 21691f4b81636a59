"""The judge is judged against the paper's numbers, other formulas and invariances."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lockedjoint.formulations import measures
from lockedjoint.formulations.measures.assessment import measure
from lockedjoint.formulations.reproduction import reference

PLANAR_3R = reference.PLANAR_3R  # eq. (12)


entries = st.floats(-3, 3, allow_subnormal=False).map(lambda x: round(x, 3))
jacobians = st.tuples(st.integers(2, 4), st.integers(1, 3)).flatmap(
    lambda size: arrays(float, (size[0], size[0] + size[1]), elements=entries)
)


def test_eqs_12_to_15():
    assert measures.locked_singular_values(PLANAR_3R) == pytest.approx([np.sqrt(1 / 3)] * 3)
    np.testing.assert_allclose(measures.singular_values(PLANAR_3R), [1, 1])
    np.testing.assert_allclose(measures.range_contributions(PLANAR_3R), 2 / 3)
    np.testing.assert_allclose(measures.null_space_contributions(PLANAR_3R), 1 / 3)
    assert measures.is_optimally_failure_tolerant(PLANAR_3R)
    worst = measures.worst_case(PLANAR_3R)
    column = PLANAR_3R[:, worst.joints[0]]
    assert abs(worst.direction @ column) == pytest.approx(np.linalg.norm(column))


@pytest.mark.parametrize("alpha", [0, 0.3, np.pi / 4, 1.2])
def test_planar_4r_family(alpha):
    """Eq. (17) for every α; two failures: 0.38268 at π/4, 0 at 0."""
    jacobian = reference.planar_4r(alpha)[:2]
    np.testing.assert_allclose(measures.locked_singular_values(jacobian), np.sqrt(0.5))
    two = measures.worst_case_sigma(jacobian, failures=2)
    expected = np.sqrt((1 - max(abs(np.cos(alpha)), abs(np.sin(alpha)))) / 2)
    assert two == pytest.approx(expected, abs=1e-12)
    if alpha == np.pi / 4:
        assert two == pytest.approx(0.38268, abs=5e-6)


@given(jacobians, st.integers(0, 1000))
def test_nothing_changes_with_frame_order_and_signs(jacobian, seed):
    rng = np.random.default_rng(seed)
    m, n = jacobian.shape
    frame = np.linalg.qr(rng.normal(size=(m, m)))[0]
    other = (frame @ jacobian * rng.choice([-1, 1], n))[:, rng.permutation(n)]
    for name in ("worst_case_sigma", "isotropy_defect", "manipulability"):
        measure = getattr(measures, name)
        assert measure(other) == pytest.approx(measure(jacobian), abs=1e-8)


@given(jacobians)
def test_against_eigenvalues_of_the_downdated_gram_matrix(jacobian):
    """σ² of J without F is λ_min(JJᵀ − J_F J_Fᵀ): no column is ever removed here."""
    m, n = jacobian.shape
    bound = measures.sigma_bound(m, n, measures.trace(jacobian))  # eq. (6)
    assert measures.worst_case_sigma(jacobian) <= bound + 1e-9
    gram = jacobian @ jacobian.T
    for failures in (1, 2):
        expected = [
            np.linalg.eigvalsh(gram - jacobian[:, list(f)] @ jacobian[:, list(f)].T)[0]
            for f in combinations(range(n), failures)
        ]
        found = measures.locked_singular_values(jacobian, failures) ** 2
        np.testing.assert_allclose(found, np.maximum(expected, 0), atol=1e-8)


@given(jacobians, st.integers(1, 2))
def test_the_worst_joints_and_direction_realise_the_worst_case(jacobian, failures):
    worst = measures.worst_case(jacobian, failures)
    kept = np.delete(jacobian, worst.joints, axis=1)
    assert np.linalg.norm(kept.T @ worst.direction) == pytest.approx(worst.sigma, abs=1e-8)
    assert np.linalg.norm(worst.direction) == pytest.approx(1)


@given(jacobians)
def test_contributions_add_up(jacobian):
    """R_i + N_i = 1 and Σ R_i = rank; R is the diagonal of J⁺J."""
    ranges = measures.range_contributions(jacobian)
    np.testing.assert_allclose(ranges + measures.null_space_contributions(jacobian), 1)
    if measures.singular_values(jacobian)[-1] > 1e-6:
        projector = np.linalg.pinv(jacobian) @ jacobian
        np.testing.assert_allclose(ranges, np.diag(projector), atol=1e-6)


@given(jacobians, st.integers(0, 1000))
def test_the_least_sum_of_squares_over_frames_is_the_defect(jacobian, seed):
    """fᵀf depends on the frame; ½‖·‖_F² bounds it below, and the eigenframe doubles it."""
    m = jacobian.shape[0]
    defect = measures.isotropy_defect(jacobian)
    frame = np.linalg.qr(np.random.default_rng(seed).normal(size=(m, m)))[0]
    assert measures.residual_sum_of_squares(frame @ jacobian) >= defect - 1e-9
    eigenframe = np.linalg.eigh(jacobian @ jacobian.T)[1].T
    doubled = measures.residual_sum_of_squares(eigenframe @ jacobian)
    assert doubled == pytest.approx(2 * defect, rel=1e-6, abs=1e-9)


def test_the_tolerance_is_relative_to_the_mean_eigenvalue():
    """Stretching one row of a frame with JJᵀ = 4I by 1 + ε moves its entry by 8ε."""
    stretched = 2 * reference.simplex_jacobian(3) * np.array([[1 + 1e-3], [1], [1]])
    gram = stretched @ stretched.T
    mean = np.trace(gram) / 3
    relative = np.max(np.abs(gram - mean * np.eye(3))) / mean
    assert measures.is_optimally_failure_tolerant(stretched, 1.01 * relative)
    assert not measures.is_optimally_failure_tolerant(stretched, 0.99 * relative)
    assert not measures.is_optimally_failure_tolerant(np.zeros((2, 3)))


def test_singular_jacobians_are_measured_without_warnings():
    found = measure(np.zeros((2, 3)))
    assert found.condition_number == np.inf
    assert np.all(np.isnan(found.relative_manipulability))
    assert measures.condition_number(np.ones((3, 5))) == np.inf, "no ratio to a rounding error"
    dependent = measures.relative_manipulability([[1, 2, 3], [2, 4, 6]])
    assert np.all(np.isnan(dependent)), "no ratio of rounding errors"


def test_every_failure_that_ties_is_named():
    """At a simplex all failures leave the same; of the planar 4R some pairs do."""
    simplex = reference.simplex_jacobian(6)
    found = measure(simplex)
    assert found.worst_case_joints == list(range(7))
    assert found.worst_case_sets == [[joint] for joint in range(7)]
    assert found.locked_sigmas == pytest.approx([np.sqrt(1 / 7)] * 7)
    one_short = simplex * np.array([1, 1, 0.9, 1, 1, 1, 1])
    assert measure(one_short).worst_case_joints != list(range(7))
    double = reference.planar_4r(np.pi / 4)[:2]
    sets = measure(double, failures=2).worst_case_sets
    sigmas = measures.locked_singular_values(double, 2)
    assert len(sets) == np.sum(np.isclose(sigmas, sigmas.min(), rtol=1e-6))
