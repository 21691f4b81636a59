"""Small blocks whose margins are known, with multipliers that are not feasible."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formulations.existence.equations import Frame
from formulations.existence.relaxation.linear_moments import solve_moment_equations
from formulations.existence.relaxation.margin import check_margin, solve_margin
from formulations.existence.relaxation.moment_matrix import MomentBlock

NONE = np.zeros(0)


def block(*matrices: object) -> MomentBlock:
    stacked = np.array(matrices, dtype=float)
    return MomentBlock(0, (1,), stacked.shape[1], stacked)


@pytest.mark.parametrize(("multiplier", "proved"), [(0, 1), (0.25, 0.5), (1, -1), (2, -1)])
def test_what_the_trace_lacks_counts_as_one(multiplier: float, proved: float) -> None:
    certificate = check_margin([block([[-1]])], NONE, NONE, [np.array([[multiplier]])])
    assert certificate.proved == pytest.approx(proved, abs=1e-8)
    assert certificate.attained == -1


def test_negative_multipliers_are_cut_off() -> None:
    certificate = check_margin([block([[1, 0], [0, 9]])], NONE, NONE, [np.diag([1.0, -1.0])])
    assert certificate.smallest_eigenvalue == -1
    assert certificate.proved == pytest.approx(1, abs=1e-8)


def test_dependence_on_free_moments_is_accounted_for() -> None:
    # y − 1/2 is nonnegative at y = 1/2, but the multiplier 1 gives −1/2 at y = 0.
    blocks, limits = [block([[-0.5]], [[1]])], np.ones(1)
    certificate = check_margin(blocks, limits, np.array([0.5]), [np.ones((1, 1))])
    assert certificate.residual == 1
    assert certificate.proved == pytest.approx(0.5, abs=1e-8)
    assert certificate.feasible
    assert not certificate.infeasible


def test_rounding_is_no_proof() -> None:
    rounded = block([[1, 0], [0, -1e-14]])
    certificate = check_margin([rounded], NONE, NONE, [np.diag([0.0, 1.0])])
    assert not certificate.infeasible
    assert not certificate.feasible


def test_nothing_given_nothing_shown() -> None:
    certificate = check_margin([block([[1]])], NONE, None, [np.array([[math.nan]])])
    assert (certificate.attained, certificate.proved) == (-math.inf, 1.0)
    assert certificate.to_dict()["attained"] is None


@given(st.integers(0, 2**32 - 1))
def test_the_solver_meets_its_certificate(seed: int) -> None:
    rng = np.random.default_rng(seed)
    blocks = []
    for size in (1, 3):
        raw = rng.standard_normal((3, size, size))
        blocks.append(block(*(raw + raw.transpose(0, 2, 1))))
    # Two opposite blocks bound the margin.
    blocks += [block([[0.1]], [[1]], [[0]]), block([[0.1]], [[-1]], [[0]])]
    blocks += [block([[0.1]], [[0]], [[1]]), block([[0.1]], [[0]], [[-1]])]
    margin = solve_margin(blocks, np.ones(2))
    assert margin.status == "optimal"
    assert margin.value == pytest.approx(margin.certificate.attained, abs=1e-5)
    assert margin.certificate.attained <= margin.certificate.proved
    assert margin.certificate.proved == pytest.approx(margin.certificate.attained, abs=1e-4)


def test_limits_are_powers_of_the_diagonal_of_the_projector() -> None:
    # |W_ij|² ≤ 2 P_ii = 2 for a square isotropic Jacobian and 12/7 for seven joints.
    square = solve_moment_equations(Frame(6, 6), 2)
    assert set(square.limits()) == {2.0 ** len(graph.w) for graph in square.free}
    kept = solve_moment_equations(Frame(7, 6, diagonal=True), 1)
    assert kept.limits().tolist() == [12 / 7] * len(kept.free)
    assert len(kept.free) > 0
