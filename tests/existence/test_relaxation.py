"""What multipliers prove of small blocks; orders 2 and 3; nothing excludes true solutions."""

import json
import math
from dataclasses import replace
from functools import partialmethod

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formulations.existence import relaxation
from formulations.existence.derive import solve_moment_equations
from formulations.existence.equations import Frame
from formulations.existence.relaxation import (
    EdgeMultisets,
    MomentBlock,
    check_margin,
    existence_relaxation,
    moment_blocks,
    solve_margin,
)

NONE = np.zeros(0)


def block(*matrices):
    stacked = np.array(matrices, dtype=float)
    return MomentBlock(0, (1,), stacked.shape[1], stacked, 0.0)


@pytest.mark.parametrize(("multiplier", "proved"), [(0, 1), (0.25, 0.5), (1, -1), (2, -1)])
def test_what_the_trace_lacks_counts_as_one(multiplier, proved):
    margin = check_margin([block([[-1]])], NONE, NONE, [np.array([[multiplier]])])
    assert margin.proved == pytest.approx(proved, abs=1e-8)
    assert margin.attained == -1


def test_negative_multipliers_are_cut_off():
    margin = check_margin([block([[1, 0], [0, 9]])], NONE, NONE, [np.diag([1.0, -1.0])])
    assert margin.smallest_eigenvalue == -1
    assert margin.proved == pytest.approx(1, abs=1e-8)


def test_dependence_on_free_moments_is_accounted_for() -> None:
    # y − 1/2 is nonnegative at y = 1/2, but the multiplier 1 gives −1/2 at y = 0.
    blocks, limits = [block([[-0.5]], [[1]])], np.ones(1)
    margin = check_margin(blocks, limits, np.array([0.5]), [np.ones((1, 1))])
    assert margin.residual == 1
    assert margin.proved == pytest.approx(0.5, abs=1e-8)
    assert margin.attained == 0


def test_rounding_is_no_proof():
    rounded = block([[1, 0], [0, -1e-14]])
    margin = check_margin([rounded], NONE, NONE, [np.diag([0.0, 1.0])])
    assert margin.attained < 0 <= margin.proved


def test_nothing_given_nothing_shown():
    margin = check_margin([block([[1]])], NONE, None, [np.array([[math.nan]])])
    assert (margin.attained, margin.proved) == (-math.inf, 1.0)


@given(st.integers(0, 2**32 - 1))
def test_the_solver_meets_its_certificate(seed):
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
    assert margin.value == pytest.approx(margin.attained, abs=1e-5)
    assert margin.attained <= margin.proved
    assert margin.proved == pytest.approx(margin.attained, abs=1e-4)


def test_order_2_determines_every_moment_and_is_feasible(order_2):
    moments, margin = order_2.moments, order_2.margin
    assert (len(moments.classes), moments.equations, moments.rank) == (43, 85, 42)
    assert moments.free == ()
    assert (order_2.verdict, margin.status) == ("feasible", "optimal")
    # Nothing is free, so the margin is the smallest eigenvalue, in the (4, 3) block.
    lowest = min(np.linalg.eigvalsh(block.matrices[0])[0] for block in order_2.blocks)
    assert margin.attained == pytest.approx(lowest) == pytest.approx(0.00453514739, abs=1e-10)
    assert margin.value == pytest.approx(0.00453514739, abs=1e-7)
    assert all(one.proved >= 0 for one in order_2.alone)


def test_order_3_has_the_sizes_and_ranks_of_the_theory(order_3):
    moments = order_3.moments
    assert (len(moments.classes), moments.equations, moments.rank) == (760, 2430, 757)
    assert len(moments.free) == 2
    sizes = {block.shape: block.size for block in order_3.blocks if block.charge == 1}
    assert [sizes[shape] for shape in ((4, 2, 1), (3, 3, 1), (3, 2, 2))] == [7, 4, 5]
    shown = json.loads(json.dumps(order_3.to_dict(), allow_nan=False))
    assert (shown["kind"], shown["verdict"]) == ("numerical", "infeasible")
    assert (shown["largest_block"], shown["rank_doubt"] < 1e-9) == (7, True)
    assert sum(block["infeasible_alone"] for block in shown["blocks"]) == 3


def test_order_3_is_infeasible_with_the_margin(order_3):
    margin = order_3.margin
    assert order_3.verdict == "infeasible"
    assert margin.value == pytest.approx(-0.0178404, abs=1e-6)
    assert margin.attained == pytest.approx(-0.0178404, abs=1e-6)
    assert margin.attained < margin.proved < -0.01783
    assert margin.residual < 1e-6
    assert margin.smallest_eigenvalue > -1e-9


def test_three_blocks_are_infeasible_alone(order_3):
    alone = {
        (block.charge, block.shape)
        for block, margin in zip(order_3.blocks, order_3.alone, strict=True)
        if margin.proved < 0
    }
    assert alone == {(1, (4, 2, 1)), (1, (3, 3, 1)), (1, (3, 2, 2))}
    feasible = [margin for margin in order_3.alone if margin.proved >= 0]
    assert all(margin.attained > 0 for margin in feasible)


def test_perturbed_multipliers_prove_no_more_than_the_truth(order_3):
    margin, limits = order_3.margin, order_3.moments.limits()
    rng = np.random.default_rng(0)
    for noise in (1e-6, 1e-4, 1e-2, 1.0):
        perturbed = [x + noise * rng.standard_normal(x.shape) for x in margin.multipliers]
        checked = check_margin(order_3.blocks, limits, margin.free, perturbed)
        assert checked.proved >= margin.attained
        if noise >= 1e-2:
            assert checked.proved >= 0
    negated = [-x for x in margin.multipliers]
    assert check_margin(order_3.blocks, limits, margin.free, negated).proved >= 0


def test_a_solver_that_fails_decides_nothing(monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(cp.Problem, "solve", partialmethod(cp.Problem.solve, max_iter=1))
        cut_short = existence_relaxation(2, 6)
    assert cut_short.margin.status not in ("optimal", "optimal_inaccurate")
    monkeypatch.setattr(relaxation, "run", lambda *_: "solver_error: out of luck")
    failed = existence_relaxation(1)
    assert failed.to_dict()["margin"] is None
    for found in (cut_short, failed):
        assert found.verdict == "undecided"
        assert json.dumps(found.to_dict(), allow_nan=False)


def test_the_verdict_rests_on_the_certificate_alone(order_2):
    unproved = check_margin(order_2.blocks, NONE, None, [np.array([[math.nan]])])
    for value in (-1.0, 1.0):
        unfounded = replace(unproved, value=value, status="optimal")
        assert replace(order_2, margin=unfounded).verdict == "undecided"


def assert_solved_by(moments, w, averages):
    """Check every equation at the moments of a solution; return its free moments."""
    frame = moments.frame
    multisets = EdgeMultisets(frame.joints, moments.order, frame.diagonal)
    values = averages(multisets, moments.classes, w)
    by_class = dict(zip(moments.classes, values, strict=True))
    for multiple in frame.multiples(moments.order):
        equation = frame.averaged(multiple)
        terms = [float(value) * by_class[graph] for graph, value in equation.items()]
        assert abs(sum(terms)) < 1e-11 * (1 + max(map(abs, terms), default=0.0))
    free = np.array([by_class[graph] for graph in moments.free])
    predicted = moments.coefficients @ np.concatenate([[1.0], free])
    np.testing.assert_allclose(predicted, values, atol=1e-9)
    assert (np.abs(free) <= moments.limits()).all()
    return free


@pytest.mark.long
def test_isotropic_6r_satisfies_order_3_and_has_semidefinite_blocks(
    solution_6r, printed_6r, averages
):
    moments = solve_moment_equations(Frame(6, 6), 3)
    blocks = moment_blocks(moments)
    assert moments.consistent
    assert len(moments.free) == 30
    for w in (printed_6r, *(solution_6r(seed) for seed in range(2))):
        free = assert_solved_by(moments, w, averages)
        lowest = min(np.linalg.eigvalsh(block.at(free))[0] for block in blocks)
        assert lowest > -1e-10


def test_a_solution_satisfies_the_equations_and_no_other_matrix(solution_6r, averages):
    moments = solve_moment_equations(Frame(6, 6), 2)
    assert_solved_by(moments, solution_6r(0), averages)
    with pytest.raises(AssertionError):
        assert_solved_by(moments, 1.001 * solution_6r(0), averages)


def test_rotated_simplices_satisfy_the_equations_with_the_diagonal_kept(
    solution_simplex, averages
):
    relaxation = existence_relaxation(2, diagonal=True)
    assert relaxation.moments.consistent
    assert relaxation.verdict in ("feasible", "undecided")
    assert all(margin.proved >= 0 for margin in relaxation.alone)
    for seed in range(3):
        w = solution_simplex(seed)
        assert np.abs(np.diag(w)).max() > 0.1
        free = assert_solved_by(relaxation.moments, w, averages)
        lowest = min(np.linalg.eigvalsh(block.at(free))[0] for block in relaxation.blocks)
        assert lowest > -1e-10


@pytest.mark.parametrize(("joints", "order"), [(3, 1), (5, 2)])
def test_small_impossible_cases(joints, order):
    relaxation = existence_relaxation(order, joints)
    assert not relaxation.moments.consistent
    assert relaxation.verdict == "inconsistent"
    assert relaxation.to_dict()["kind"] == "exact"
    assert relaxation.blocks == ()
    assert existence_relaxation(order, joints, diagonal=True).moments.consistent
    if order > 1:
        assert existence_relaxation(order - 1, joints).moments.consistent
