"""Eq. (6) against the printed matrices, against random Jacobians and against its own limits."""

import math
from fractions import Fraction

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockedjoint.formulations.bounds.certified import largest_worst_case
from lockedjoint.formulations.bounds.rational_roots import (
    rational_root_above,
    root_above,
    root_below,
)
from lockedjoint.formulations.joints import models
from lockedjoint.formulations.measures import eigenvalue_bound
from lockedjoint.formulations.registry import bound
from lockedjoint.formulations.reproduction.reference import PLANAR_3R
from lockedjoint.formulations.solving.solve import solve
from results.relaxation.row_traces import block_trace_bound


def worst_eigenvalue(jacobian):
    gram = jacobian @ jacobian.T
    downdates = gram - np.einsum("if,jf->fij", jacobian, jacobian)
    return float(np.linalg.eigvalsh(downdates)[:, 0].min())


def test_the_values_that_are_printed():
    """Eqs. (12) and (14), (46), (49): of unit revolute joints tr JJᵀ = 2n."""
    assert eigenvalue_bound(2, 3, 2) == pytest.approx(1 / 3, rel=1e-15)
    assert worst_eigenvalue(PLANAR_3R) == pytest.approx(1 / 3, rel=1e-14)
    assert math.sqrt(eigenvalue_bound(6, 7, 14)) == pytest.approx(0.57735, abs=1e-5)
    assert eigenvalue_bound(6, 8, 16) == pytest.approx(2 / 3, rel=1e-15)


@given(st.integers(1, 6), st.integers(1, 5), st.integers(0, 2**32 - 1), st.floats(0.0, 3.0))
def test_no_jacobian_beats_the_bound(m, extra, seed, spread):
    rng = np.random.default_rng(seed)
    scales = np.exp(spread * rng.standard_normal((m, 1)))
    jacobian = scales * rng.standard_normal((m, m + extra))
    bound = eigenvalue_bound(m, m + extra, float(np.sum(jacobian**2)))
    assert worst_eigenvalue(jacobian) <= bound * (1 + 1e-12)


@given(st.integers(7, 12), st.floats(0.1, 10.0), st.integers(0, 2**32 - 1))
def test_random_arms_obey_the_traces_and_the_bound(n, lever_arm, seed):
    rng = np.random.default_rng(seed)
    frames = np.linalg.qr(rng.standard_normal((n, 3, 2)))[0]
    lengths = lever_arm * rng.uniform(0.5, 1.0, size=n)
    jacobian = np.concatenate([frames[:, :, 0].T * lengths, frames[:, :, 1].T])
    traces = n * lever_arm**2, float(n)
    assert worst_eigenvalue(jacobian) <= block_trace_bound(n, (3, 3), traces)


def as_a_program(joints, sizes, traces):
    """Return the same bound from a semidefinite program in M' = JJᵀ/t and s = 1/t."""
    m = sum(sizes)
    s, gram, y = cp.Variable(), *(cp.Variable((m, m), symmetric=True) for _ in range(2))
    conditions = [cp.bmat([[y, np.eye(m)], [np.eye(m), gram - np.eye(m)]]) >> 0]
    conditions.append(cp.trace(y) <= joints - m)
    blocks = np.split(np.arange(m), np.cumsum(sizes)[:-1])
    for block, limit in zip(blocks, traces, strict=True):
        conditions.append(cp.sum(cp.diag(gram)[block]) <= s * limit)
    cp.Problem(cp.Minimize(s), conditions).solve(solver="CLARABEL")
    return 1 / float(s.value)


@pytest.mark.parametrize(
    ("joints", "sizes", "traces"),
    [
        *((n, (m,), (m,)) for m, n in ((2, 3), (3, 7), (6, 7), (6, 12))),
        *((n, (3, 3), (n * a**2, n)) for n in (7, 12) for a in (0.5, 1, 3)),
        (8, (1, 2, 3), (4.0, 1.0, 7.0)),
    ],
)
def test_a_semidefinite_program_says_the_same(joints, sizes, traces):
    expected = block_trace_bound(joints, sizes, traces)
    assert as_a_program(joints, sizes, traces) == pytest.approx(expected, rel=1e-6)
    eq_6 = eigenvalue_bound(sum(sizes), joints, sum(traces))
    alike = len({trace / size for size, trace in zip(sizes, traces, strict=True)}) == 1
    assert expected == pytest.approx(eq_6) if alike else expected < eq_6


def test_unlike_traces_of_rows_tighten_the_bound() -> None:
    # M_11 ≤ 3/2, M_22 ≤ 1/2, n = 4: 1/(3/2 − t) + 1/(1/2 − t) = 2/t, so t = (3 − √3)/4.
    assert block_trace_bound(4, (1, 1), (1.5, 0.5)) == pytest.approx((3 - math.sqrt(3)) / 4)


def test_equal_blocks_are_no_different_from_the_whole():
    assert block_trace_bound(7, (3, 3), (7, 7)) == pytest.approx(1 / 3, rel=1e-14)
    assert block_trace_bound(9, (2, 1, 3), (4, 2, 6)) == pytest.approx(2 * 3 / 9, rel=1e-14)


def test_unequal_blocks_solve_their_equation():
    t = block_trace_bound(7, (3, 3), (28, 7))
    assert 0 < t < 7 / 3
    assert 3 / (28 / 3 - t) + 3 / (7 / 3 - t) == pytest.approx(1 / t, rel=1e-12)
    # A block that is free of charge leaves the bound of the other one with 7 joints.
    alone = eigenvalue_bound(3, 4, 7)
    assert block_trace_bound(7, (3, 3), (1e12, 7)) == pytest.approx(alone, rel=1e-9)


@given(st.fractions(min_value=Fraction(1, 10**6), max_value=10**6))
def test_a_root_above_is_the_next_double_or_the_root(square):
    root = root_above(square)
    assert Fraction(root) ** 2 >= square > Fraction(math.nextafter(root, 0)) ** 2
    assert root_below(square) ** 2 <= square < rational_root_above(square) ** 2
    assert float(rational_root_above(square)) == pytest.approx(root, rel=1e-14)


@given(st.integers(6, 9), st.integers(1, 2), st.integers(0, 2**32 - 1))
def test_no_arm_with_prismatic_joints_beats_its_bound(revolute, prismatic, seed):
    arm = models.arm(f"unit-revolute:{revolute},prismatic:{prismatic}", revolute + prismatic)
    bound = largest_worst_case(arm).value
    assert bound < math.sqrt(eigenvalue_bound(6, revolute + prismatic, arm.largest_trace))
    jacobian = np.array(arm.jacobian(arm.sample(np.random.default_rng(seed))))
    assert math.sqrt(max(worst_eigenvalue(jacobian), 0)) <= bound


def test_the_bound_on_isotropic_arms_with_a_prismatic_joint_is_attained():
    outcome = solve("isotropy", "lever-revolute:7,prismatic:1", 8, starts=4, workers=1)
    limit = bound("isotropy", outcome.arm)
    # T = 14, the prismatic column has norm 1: t = 14/6 − 13/7.
    assert limit.value == pytest.approx(math.sqrt(14 / 6 - 13 / 7), rel=1e-11)
    assert outcome.best.worst_case_sigma == pytest.approx(limit.value, abs=1e-8)
