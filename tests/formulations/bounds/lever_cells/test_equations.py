"""What matrices of SO(4) fulfil, and multipliers as rows of numbers."""

import numpy as np
import pytest

from lockedjoint.formulations.bounds.lever_cells.equations import (
    EQUATIONS,
    MULTIPLIER_COUNT,
    PAIR_I,
    PAIR_J,
    RIGHT,
    Multipliers,
    ends,
    polynomial,
)
from lockedjoint.nlp.errors import InputError


def orthogonal(rng, determinant):
    """A random matrix of O(4) with this determinant."""
    Q, _ = np.linalg.qr(rng.normal(size=(4, 4)))
    Q[0] *= determinant * np.sign(np.linalg.det(Q))
    return Q


def residual(matrix):
    """What is left of the 37 equations."""
    o = matrix.ravel()
    return np.einsum("i,eij,j->e", o, EQUATIONS, o) - RIGHT


def test_equations_hold_for_rotations_and_not_for_reflections():
    rng = np.random.default_rng(0)
    for _ in range(20):
        assert np.abs(residual(orthogonal(rng, 1.0))).max() < 1e-13
        reflected = residual(orthogonal(rng, -1.0))
        assert np.abs(reflected[:19]).max() < 1e-13  # of orthogonal matrices
        assert np.abs(reflected[19:]).max() > 0.1  # of minors


def test_equations_do_not_hold_for_matrices_that_are_not_orthogonal():
    rng = np.random.default_rng(1)
    stretched = orthogonal(rng, 1.0) @ np.diag([1.0, 1.0, 1.0, 1.1])
    assert np.abs(residual(stretched)).max() > 0.05


def test_polynomial_is_the_sum_of_multiplied_inequalities():
    rng = np.random.default_rng(2)
    limit = 0.07
    m = Multipliers.unpacked(rng.normal(size=(5, MULTIPLIER_COUNT)))
    n = rng.normal(size=7)
    least, most = ends(limit)
    products = (n - least)[PAIR_I] * (n - least)[PAIR_J]
    expected = (
        m.products @ products + m.lower @ (n - least) + m.upper @ ((n - least) * (most - n))
    )
    phi, c, c0 = polynomial(m, limit)
    assert np.einsum("i,nij,j->n", n, phi, n) - c @ n - c0 == pytest.approx(expected)


def test_ends_are_those_of_unit_vectors():
    least, most = ends(0.05)
    assert 7 * least**2 == pytest.approx(1 - 3 * 0.05)
    assert most**2 + 6 * least**2 == pytest.approx(1.0)


def test_multipliers_are_packed_and_unpacked():
    rows = np.arange(2.0 * MULTIPLIER_COUNT).reshape(2, -1)
    m = Multipliers.unpacked(rows)
    assert m.shared.shape == (2, 4, 4)
    assert m.constant == pytest.approx(rows[:, -1])
    assert (m.packed() == rows).all()
    assert (m.take(np.array([1])).packed() == rows[1:]).all()


@pytest.mark.parametrize(
    ("place", "value", "admissible"),
    [
        (0, -1.0, True),  # an equation
        (40, -1.0, True),  # the block of q
        (88, -1.0, True),  # the constant
        (53, -1e-300, False),  # the first product
        (73, -1.0, False),
        (74, -1.0, False),  # the first lower end
        (87, -1.0, False),  # the last upper end
        (0, np.nan, False),
        (60, np.nan, False),
        (60, np.inf, False),
        (88, -np.inf, False),
    ],
)
def test_multipliers_of_inequalities_are_not_negative(place, value, admissible):
    rows = np.zeros((2, MULTIPLIER_COUNT))
    rows[1, place] = value
    assert Multipliers.unpacked(rows).admissible().tolist() == [True, admissible]


@pytest.mark.parametrize("limit", [-1e-9, 1 / 3, 0.5, np.nan, np.inf])
def test_limits_without_any_n_are_refused(limit):
    with pytest.raises(InputError, match=r"limit of lever arms.*from 0 to below 1/3"):
        ends(limit)
