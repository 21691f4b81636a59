"""Whatever multipliers are offered, no more is proved than is true."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formulations.bounds.worst_case.certificate import (
    WorstCaseMultipliers,
    check_multipliers,
)
from formulations.bounds.worst_case.problem import LinearFact, WorstCase, free_columns
from nlp.arrays import FloatArray


def optimal(n: int, m: int) -> tuple[FloatArray, float, float]:
    """Return Z, μ and ν of eq. (6), by hand: μ = m/(n − m)², Z₁₂ = −I/(n − m), ν = 1/m."""
    redundancy = n - m
    identity = np.eye(m)
    mu = m / redundancy**2
    matrix = np.block(
        [[mu * identity, -identity / redundancy], [-identity / redundancy, identity / m]]
    )
    return matrix, mu, 1 / m


@pytest.mark.parametrize(("n", "m"), [(7, 6), (3, 2), (12, 2), (4, 1)])
def test_the_exact_multipliers_prove_exactly_eq_6(n: int, m: int) -> None:
    matrix, mu, nu = optimal(n, m)
    certificate = check_multipliers(free_columns(n, m), WorstCaseMultipliers(matrix, mu, (nu,)))
    assert certificate.proved_value == pytest.approx(n / (n - m), rel=1e-12)
    assert certificate.dual_value == pytest.approx(n / (n - m), rel=1e-12)
    assert certificate.residual < 1e-14


@given(
    st.sampled_from([(7, 6), (3, 2), (12, 2), (5, 3)]),
    st.integers(0, 2**32 - 1),
    st.floats(0.0, 3.0),
)
def test_no_multipliers_prove_too_much(size: tuple[int, int], seed: int, noise: float) -> None:
    n, m = size
    rng = np.random.default_rng(seed)
    matrix, mu, nu = optimal(n, m)
    perturbed = WorstCaseMultipliers(
        matrix + noise * rng.standard_normal(matrix.shape),
        mu + noise * float(rng.standard_normal()),
        (nu + noise * float(rng.standard_normal()),),
    )
    certificate = check_multipliers(free_columns(n, m), perturbed)
    assert certificate.proved_value <= n / (n - m) * (1 + 1e-12)
    if noise > 1e-2:
        assert certificate.residual > 1e-6


def test_an_indefinite_matrix_is_paid_for() -> None:
    # Huge Z₁₂ with μ = 0; without the payment of λ(n − 2m) this would prove s ≥ 2 > 6/5.
    matrix = np.kron(np.array([[0.0, -1e3], [-1e3, 0.5]]), np.eye(2))
    certificate = check_multipliers(
        free_columns(12, 2), WorstCaseMultipliers(matrix, 0.0, (0.5,))
    )
    assert certificate.smallest_eigenvalue < -900
    assert certificate.proved_value < 1.2


def test_the_first_block_must_be_a_multiple_of_the_identity() -> None:
    # tr M ≤ 2, M_11 = 3 M_22, n = 4: the optimum is 4/(3 − √3). This Z is semidefinite and
    # would prove 4, but its first block is diag(0, 2).
    problem = WorstCase(4, 2, 2.0, (LinearFact("ratio", np.diag([1.0, -3.0]), 0.0, "equal"),))
    vector = np.array([[0.0, 1.0, 0.0, -1.0]])
    false = WorstCaseMultipliers(2 * vector.T @ vector, 1.0, (0.5, -0.5))
    certificate = check_multipliers(problem, false)
    assert certificate.dual_value == pytest.approx(4)
    assert certificate.residual == pytest.approx(1)
    assert certificate.proved_value <= 4 / (3 - math.sqrt(3))


def test_inequalities_take_no_negative_multipliers() -> None:
    # M_11 ≤ 10 is no restriction; with a multiplier −1 it would prove s ≥ 19 > 2.
    slack = LinearFact("slack", np.diag([1.0, 0.0]), 10.0, "at most")
    z = np.array([4.5, 5.5])
    root = float(np.sqrt(z).sum()) / 2
    cross = -np.diag(root * np.sqrt(z))
    matrix = np.block([[root**2 * np.eye(2), cross], [cross, np.diag(z)]])
    false = WorstCaseMultipliers(matrix, root**2, (5.5, -1.0))
    certificate = check_multipliers(WorstCase(4, 2, 2.0, (slack,)), false)
    assert certificate.dual_value > 19
    assert certificate.proved_value <= 2


@pytest.mark.parametrize("nu", [0.0, -1.0, math.nan])
def test_useless_multipliers_prove_nothing(nu: float) -> None:
    useless = WorstCaseMultipliers(np.zeros((12, 12)), 0.0, (nu,))
    assert check_multipliers(free_columns(7, 6), useless).proved_value == -math.inf
