"""Controls: true solutions satisfy every equation and are excluded by nothing."""

import numpy as np
import pytest

from formulations.existence.equations import Frame
from formulations.existence.moments import EdgeMultisets, solve_moment_equations
from formulations.existence.relaxation import existence_relaxation


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


def test_isotropic_6r_satisfies_order_3_and_has_semidefinite_blocks(
    order_3_of_6r, solution_6r, printed_6r, averages
):
    moments = order_3_of_6r.moments
    assert moments.consistent
    assert len(moments.free) == 30
    for w in (printed_6r, *(solution_6r(seed) for seed in range(2))):
        free = assert_solved_by(moments, w, averages)
        lowest = min(np.linalg.eigvalsh(block.at(free))[0] for block in order_3_of_6r.blocks)
        assert lowest > -1e-10


def test_isotropic_6r_is_feasible_at_order_3(order_3_of_6r):
    assert order_3_of_6r.verdict == "feasible"
    assert all(margin.proved >= 0 for margin in order_3_of_6r.alone)
    margin = order_3_of_6r.margin
    assert margin is not None
    assert margin.attained > 1e-3
    assert margin.proved == pytest.approx(margin.attained, abs=1e-4)


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
