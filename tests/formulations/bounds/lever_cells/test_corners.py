"""Norms in closed form are upper bounds, also where singular values agree."""

import numpy as np
import pytest

from lockedjoint.formulations.bounds.lever_cells.corners import high, high3


def with_values(rng, values):
    """A 3×4 matrix with these singular values."""
    left, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    right, _ = np.linalg.qr(rng.normal(size=(4, 3)))
    return (left * np.array(values)) @ right.T


@pytest.mark.parametrize("values", [(2, 1, 0.5), (2, 2, 1), (2, 1, 1), (3, 3, 3), (1, 0, 0)])
def test_closed_form_is_an_upper_bound_and_close(values):
    rng = np.random.default_rng(3)
    found = high3(np.array([with_values(rng, values) for _ in range(200)]))
    assert np.all(found >= max(values))
    assert found == pytest.approx(max(values), rel=2e-7)


def test_closed_form_of_nothing_and_of_the_identity_is_finite():
    found = high3(np.array([np.zeros((3, 3)), np.eye(3), 1e-9 * np.eye(3)]))
    assert found == pytest.approx([0, 1, 1e-9], rel=2e-7, abs=1e-14)


def test_schatten_norm_is_an_upper_bound():
    matrices = np.random.default_rng(4).normal(size=(50, 6, 5))
    greatest = np.linalg.norm(matrices, 2, axis=(1, 2))
    assert np.all(high(matrices) >= greatest)
    assert np.all(high(matrices) <= 5 ** (1 / 8) * greatest)
