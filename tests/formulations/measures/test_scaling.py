"""Measures of a scaled Jacobian are those of the Jacobian, scaled, or it is refused."""

import numpy as np
import pytest

from lockedjoint.formulations.measures.assessment import measure

J = np.random.default_rng(0).normal(size=(6, 8))
# By which power of the factor each grows.
POWERS = {"worst_case_sigma": 1, "sigma_bound": 1, "condition_number": 0, "gap_percent": 0}
POWERS |= {"isotropy_defect": 4, "residual_sum_of_squares": 4}


@pytest.mark.parametrize("exponent", [-69, -35, -1, 1, 35, 69])
def test_measures_are_scaled(exponent):
    factor = 2.0 ** round(exponent / np.log10(2))  # exact in floating point
    plain, scaled = measure(J), measure(J * factor)
    for name, power in POWERS.items():
        expected = getattr(plain, name) * factor**power
        assert getattr(scaled, name) == pytest.approx(expected, rel=1e-12)
    assert scaled.worst_case_sets == plain.worst_case_sets
    assert scaled.relative_manipulability == pytest.approx(plain.relative_manipulability)
    assert scaled.manipulability > 0


def test_a_zero_matrix_and_a_masked_array_without_masked_entries_are_measured():
    zero = measure(np.zeros((2, 3)))
    assert (zero.worst_case_sigma, zero.manipulability) == (0, 0)
    assert measure(np.ma.masked_array(J)) == measure(J)
