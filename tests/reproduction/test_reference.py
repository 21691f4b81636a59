"""The paper's matrices are what their equations say."""

from __future__ import annotations

import numpy as np
import pytest

from formulations import measures
from formulations.measures.canonical import group_equivalent
from formulations.reproduction import reference

MATRICES = ["PLANAR_3R", "POSITIONAL_4R", "CANONICAL_6X7", "NEARLY_OPTIMAL_7R", "OPTIMAL_8R"]


@pytest.mark.parametrize("name", MATRICES)
def test_matrices_cannot_be_changed(name: str) -> None:
    matrix = getattr(reference, name)
    with pytest.raises(ValueError, match="read-only"):
        matrix[0, 0] = 2.0


@pytest.mark.parametrize("m", range(1, 12))
def test_simplex_is_optimally_failure_tolerant_and_printed(m: int) -> None:
    simplex = reference.simplex_jacobian(m)
    assert measures.is_optimally_failure_tolerant(simplex, 1e-14)
    assert measures.worst_case_sigma(simplex) == pytest.approx(np.sqrt(1 / (m + 1)), abs=1e-14)
    prints = {2: "PLANAR_3R", 3: "POSITIONAL_4R", 6: "CANONICAL_6X7"}
    if m in prints:
        printed = getattr(reference, prints[m])[:m]
        np.testing.assert_allclose(printed, simplex, atol=1e-15)


@pytest.mark.parametrize(("m", "n"), [(1, 2), (2, 5), (3, 4), (3, 9), (6, 7), (6, 11), (7, 30)])
def test_harmonic_frame_is_optimally_failure_tolerant(m: int, n: int) -> None:
    harmonic = reference.harmonic_jacobian(m, n)
    assert harmonic.shape == (m, n)
    np.testing.assert_allclose(harmonic @ harmonic.T, np.eye(m), atol=1e-14)
    assert measures.worst_case_sigma(harmonic) == pytest.approx(np.sqrt((n - m) / n), abs=1e-14)


@pytest.mark.parametrize("m", [1, 2, 3, 6])
def test_harmonic_frame_of_one_redundant_joint_is_the_simplex(m: int) -> None:
    pair = [reference.harmonic_jacobian(m, m + 1), reference.simplex_jacobian(m)]
    if m < 6:
        assert group_equivalent(pair, tolerance=1e-9) == [[0, 1]]
    grams = [np.sort(np.abs(matrix.T @ matrix).ravel()) for matrix in pair]
    np.testing.assert_allclose(*grams, atol=1e-14)


@pytest.mark.parametrize("alpha", [0.0, 0.4, 2.0, -5.0])
def test_planar_family_is_orthogonal(alpha: float) -> None:
    rows = reference.planar_4r(alpha)
    np.testing.assert_allclose(rows @ rows.T, np.eye(4), atol=1e-15)


def test_printed_decimals_are_kept() -> None:
    assert str(reference.SINGULAR_VALUES_7R[2]) == "1.5250"
