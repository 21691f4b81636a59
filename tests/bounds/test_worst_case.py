"""Eq. (6) as a program: against formulas, random arms, and multipliers that are wrong."""

import json
import math
from functools import partialmethod

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formulations import conic
from formulations.bounds import worst_case
from formulations.bounds.closed_form import block_trace_bound
from formulations.bounds.worst_case import check_multipliers, worst_case_bound
from formulations.measures import eigenvalue_bound


def assert_proved(bound, expected):
    assert bound["status"] == "optimal"
    # A proved upper bound lies on the safe side of the optimum, to rounding.
    assert expected * (1 - 1e-12) <= bound["eigenvalue_bound"] <= expected * (1 + 1e-6)
    assert bound["singular_value_bound"] == math.sqrt(bound["eigenvalue_bound"])
    assert bound["primal_eigenvalue"] == pytest.approx(expected, rel=1e-6)
    assert bound["certificate"]["residual"] < 1e-6
    assert bound["certificate"]["smallest_eigenvalue"] > -1e-6


EQ_6 = [(n, (m,), (m,)) for m in range(2, 7) for n in range(m + 1, 13)]
SCALED = [(7, (6,), (trace,)) for trace in (1e-9, 14.0, 1e9)]
REVOLUTE = [(n, (3, 3), (n * a**2, n)) for n in (7, 8, 12) for a in (0.1, 0.5, 1, 2, 3, 100)]


@pytest.mark.parametrize(
    ("joints", "rows", "traces"), [*EQ_6, *SCALED, *REVOLUTE, (8, (1, 2, 3), (4.0, 1.0, 7.0))]
)
def test_agrees_with_the_scalar_equation(joints, rows, traces):
    bound = worst_case_bound(joints, rows, traces)
    assert_proved(bound, block_trace_bound(joints, rows, traces))
    eq_6 = eigenvalue_bound(sum(rows), joints, sum(traces))
    if len(rows) == 1 or traces[0] == traces[1]:
        assert_proved(bound, eq_6)
    else:  # unless the blocks are alike their traces say more
        assert bound["eigenvalue_bound"] < eq_6


@given(st.integers(7, 12), st.floats(0.1, 10.0), st.integers(0, 2**32 - 1))
def test_random_arms_obey_the_traces_and_the_bound(n, lever_arm, seed):
    rng = np.random.default_rng(seed)
    frames = np.linalg.qr(rng.standard_normal((n, 3, 2)))[0]
    lengths = lever_arm * rng.uniform(0.5, 1.0, size=n)
    jacobian = np.concatenate([frames[:, :, 0].T * lengths, frames[:, :, 1].T])
    gram = jacobian @ jacobian.T
    traces = n * lever_arm**2, float(n)
    assert np.trace(gram[:3, :3]) <= traces[0] * (1 + 1e-12)
    assert np.trace(gram[3:, 3:]) <= traces[1] * (1 + 1e-12)
    worst = min(np.linalg.eigvalsh(gram - np.outer(j, j))[0] for j in jacobian.T)
    assert worst <= worst_case_bound(n, (3, 3), traces)["eigenvalue_bound"]


def test_unlike_traces_of_rows_tighten_the_bound() -> None:
    # M_11 ≤ 3/2, M_22 ≤ 1/2, n = 4: 1/(3/2 − t) + 1/(1/2 − t) = 2/t, so t = (3 − √3)/4.
    assert_proved(worst_case_bound(4, (1, 1), (1.5, 0.5)), (3 - math.sqrt(3)) / 4)


def test_a_solver_cut_short_says_so_and_proves_less(monkeypatch):
    monkeypatch.setattr(cp.Problem, "solve", partialmethod(cp.Problem.solve, max_iter=3))
    bound = worst_case_bound(7, (6,), (6.0,))
    assert bound["status"] == "user_limit"
    assert bound["eigenvalue_bound"] > 1 / 7 * (1 + 1e-4)


def test_a_solver_that_returns_nothing_proves_nothing(monkeypatch):
    monkeypatch.setattr(worst_case, "run", lambda *_: "solver_error: out of luck")
    bound = worst_case_bound(7, (6,), (6.0,))
    assert bound["status"].startswith("solver_error")
    assert bound["eigenvalue_bound"] is None
    assert json.dumps(bound, allow_nan=False)


def test_another_solver_agrees(monkeypatch):
    monkeypatch.setattr(conic, "SOLVER", "SCS")
    monkeypatch.setattr(cp.Problem, "solve", partialmethod(cp.Problem.solve, eps=1e-9))
    assert_proved(worst_case_bound(7, (6,), (6.0,)), 1 / 7)


def test_the_result_is_plain_json_and_holds_its_proof():
    shown = json.loads(json.dumps(worst_case_bound(7, (6,), (14.0,)), allow_nan=False))
    assert (shown["kind"], shown["joints"], shown["trace"]) == ("numerical", 7, 14.0)
    again = shown["multipliers"]
    matrix, nu = np.array(again["matrix"]), np.array(again["facts"])
    checked = check_multipliers(7, (6,), np.array([6.0]), matrix, again["redundancy"], nu)
    assert checked == shown["certificate"]


def optimal(n, m):
    """Return Z, μ and ν of eq. (6), by hand: μ = m/(n − m)², Z₁₂ = −I/(n − m), ν = 1/m."""
    redundancy = n - m
    identity = np.eye(m)
    mu = m / redundancy**2
    matrix = np.block(
        [[mu * identity, -identity / redundancy], [-identity / redundancy, identity / m]]
    )
    return matrix, mu, np.array([1 / m])


@pytest.mark.parametrize(("n", "m"), [(7, 6), (3, 2), (12, 2), (4, 1)])
def test_the_exact_multipliers_prove_exactly_eq_6(n, m):
    certificate = check_multipliers(n, (m,), np.array([m]), *optimal(n, m))
    assert certificate["proved_value"] == pytest.approx(n / (n - m), rel=1e-12)
    assert certificate["dual_value"] == pytest.approx(n / (n - m), rel=1e-12)
    assert certificate["residual"] < 1e-14


@given(
    st.sampled_from([(7, 6), (3, 2), (12, 2), (5, 3)]),
    st.integers(0, 2**32 - 1),
    st.floats(0.0, 3.0),
)
def test_no_multipliers_prove_too_much(size, seed, noise):
    n, m = size
    rng = np.random.default_rng(seed)
    matrix, mu, nu = optimal(n, m)
    certificate = check_multipliers(
        n,
        (m,),
        np.array([m]),
        matrix + noise * rng.standard_normal(matrix.shape),
        mu + noise * float(rng.standard_normal()),
        nu + noise * rng.standard_normal(1),
    )
    assert certificate["proved_value"] <= n / (n - m) * (1 + 1e-12)
    if noise > 1e-2:
        assert certificate["residual"] > 1e-6


def test_an_indefinite_matrix_is_paid_for() -> None:
    # Huge Z₁₂ with μ = 0; without the payment of λ(n − 2m) this would prove s ≥ 2 > 6/5.
    matrix = np.kron(np.array([[0.0, -1e3], [-1e3, 0.5]]), np.eye(2))
    certificate = check_multipliers(12, (2,), np.array([2]), matrix, 0.0, np.array([0.5]))
    assert certificate["smallest_eigenvalue"] < -900
    assert certificate["proved_value"] < 1.2


def test_the_first_block_must_be_a_multiple_of_the_identity() -> None:
    # M_11 ≤ 3/2, M_22 ≤ 1/2, n = 4: the optimum is 4/(3 − √3). This Z is semidefinite and
    # would prove 4, but its first block is diag(0, 2).
    vector = np.array([[0.0, 1.0, 0.0, -1.0]])
    certificate = check_multipliers(
        4, (1, 1), np.array([1.5, 0.5]), 2 * vector.T @ vector, 1.0, np.array([0.0, 2.0])
    )
    assert certificate["dual_value"] == pytest.approx(4)
    assert certificate["residual"] == pytest.approx(1)
    assert certificate["proved_value"] <= 4 / (3 - math.sqrt(3))


def test_traces_take_no_negative_multipliers() -> None:
    # M_11 ≤ 9/5 and M_22 ≤ 1/5, n = 4; ν₁ = −1 lets ν₂ be 14.
    cross = np.diag([0.0, -math.sqrt(14.0)])
    matrix = np.block([[np.eye(2), cross], [cross, np.diag([-1.0, 14.0])]])
    limits, largest = np.array([1.8, 0.2]), block_trace_bound(4, (1, 1), (1.8, 0.2))
    certificate = check_multipliers(4, (1, 1), limits, matrix, 1.0, np.array([-1.0, 14.0]))
    assert certificate["dual_value"] > 18 > 1 / largest
    assert certificate["residual"] >= 1
    assert certificate["proved_value"] <= 1 / largest


@pytest.mark.parametrize("nu", [0.0, -1.0, math.nan])
def test_useless_multipliers_prove_nothing(nu):
    certificate = check_multipliers(
        7, (6,), np.array([6.0]), np.zeros((12, 12)), 0.0, np.array([nu])
    )
    assert certificate["proved_value"] == -math.inf
