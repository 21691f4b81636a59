"""The paper's matrices are what their equations say; the families of optima near them."""

import numpy as np
import pytest

from lockedjoint.formulations import measures
from lockedjoint.formulations.joints.arm import Arm
from lockedjoint.formulations.joints.kinds import UnitRevolute
from lockedjoint.formulations.measures.canonical import group_equivalent
from lockedjoint.formulations.reproduction import eight_joints, reference
from lockedjoint.nlp.errors import InputError

ARM = Arm.of(UnitRevolute(), 8)


@pytest.mark.parametrize("m", range(1, 12))
def test_simplex_is_optimally_failure_tolerant_and_printed(m):
    simplex = reference.simplex_jacobian(m)
    assert measures.is_optimally_failure_tolerant(simplex, 1e-14)
    assert measures.worst_case_sigma(simplex) == pytest.approx(np.sqrt(1 / (m + 1)), abs=1e-14)
    assert measures.sigma_bound(m, m + 1, m) == pytest.approx(np.sqrt(1 / (m + 1)), abs=1e-14)
    prints = {2: "PLANAR_3R", 3: "POSITIONAL_4R", 6: "CANONICAL_6X7"}
    if m in prints:
        printed = getattr(reference, prints[m])[:m]
        np.testing.assert_allclose(printed, simplex, atol=1e-15)


@pytest.mark.parametrize(("m", "n"), [(1, 2), (2, 5), (3, 4), (3, 9), (6, 7), (6, 11), (7, 30)])
def test_harmonic_frame_is_optimally_failure_tolerant(m, n):
    harmonic = reference.harmonic_jacobian(m, n)
    assert harmonic.shape == (m, n)
    np.testing.assert_allclose(harmonic @ harmonic.T, np.eye(m), atol=1e-14)
    assert measures.worst_case_sigma(harmonic) == pytest.approx(np.sqrt((n - m) / n), abs=1e-14)


@pytest.mark.parametrize("m", [1, 2, 3, 6])
def test_harmonic_frame_of_one_redundant_joint_is_the_simplex(m):
    pair = [reference.harmonic_jacobian(m, m + 1), reference.simplex_jacobian(m)]
    if m < 6:
        assert group_equivalent(pair, tolerance=1e-9) == [[0, 1]]
    grams = [np.sort(np.abs(matrix.T @ matrix).ravel()) for matrix in pair]
    np.testing.assert_allclose(*grams, atol=1e-14)


@pytest.fixture(scope="module")
def angles():
    return eight_joints.solve_near(
        ARM, ARM.variables(reference.nearest_unit_revolute(reference.OPTIMAL_8R))
    )


def test_printed_8r_belongs_to_a_family_of_three_dimensions(angles):
    assert measures.is_optimally_failure_tolerant(ARM.jacobian(angles), 1e-12)
    assert ARM.size - sum(eight_joints.local_ranks(ARM, angles)) == 24 - 17 - 4 == 3
    assert eight_joints.fills_tangent_space(ARM, angles)
    assert eight_joints.least_slope(ARM, angles) == pytest.approx(0.0692, abs=1e-3)


def test_seven_joints_have_no_solution_to_be_near():
    arm = Arm.of(UnitRevolute(), 7)
    near = reference.nearest_unit_revolute(reference.NEARLY_OPTIMAL_7R)
    with pytest.raises(InputError, match="far from any solution"):
        eight_joints.solve_near(arm, arm.variables(near))
