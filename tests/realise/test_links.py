"""Link lengths, the room between links, and joints slid along their axes."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from formulations.realise.from_jacobian import realise
from formulations.realise.links import clearance, link_lengths, segment_distance, slide
from formulations.reproduction import reference


def closest(ends):
    """Distance between segments by bounded minimisation, from several starts."""
    a, b, c, d = ends

    def square(x):
        return np.sum((a + x[0] * (b - a) - c - x[1] * (d - c)) ** 2)

    starts = [(0.1, 0.1), (0.9, 0.1), (0.5, 0.5), (0.1, 0.9), (0.9, 0.9)]
    found = [minimize(square, x, bounds=[(0, 1)] * 2, method="L-BFGS-B").fun for x in starts]
    return np.sqrt(min(found))


@given(st.integers(0, 2**32), st.sampled_from(["skew", "parallel", "point", "plane"]))
def test_distance_between_segments(seed, kind):
    ends = np.random.default_rng(seed).uniform(-1, 1, (4, 3))
    if kind == "parallel":
        ends[3] = ends[2] + 0.7 * (ends[1] - ends[0])
    if kind == "point":
        ends[3] = ends[2]
    if kind == "plane":
        ends[:, 2] = 0
    assert segment_distance(*ends) == pytest.approx(closest(ends), abs=1e-4)
    assert segment_distance(*ends[[2, 3, 1, 0]]) == pytest.approx(segment_distance(*ends))


def test_clearance_is_over_links_that_share_no_joint(optimum):
    arm = realise(optimum).arranged([0, 2, 1, 3, 5, 4, 6])
    chain = np.vstack([arm.points, arm.end_effector])
    links = [chain[i : i + 2] for i in range(7)]
    apart = [closest([*links[i], *links[j]]) for i, j in combinations(range(7), 2) if j > i + 1]
    assert clearance(arm.points, arm.end_effector) == pytest.approx(min(apart), abs=1e-4)


def test_links_that_meet_where_two_axes_intersect_do_not_collide():
    chain = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 0], [1, 1, 0.0]])
    tip = np.array([0.0, 2, 0])
    assert clearance(chain, tip) == 1.0  # not 0, where links 0 and 2 meet
    assert clearance(chain[:2], tip) == np.inf


def test_links_of_many_arms_at_once():
    points = np.random.default_rng(0).standard_normal((2, 3, 5, 3))
    tip = np.zeros(3)
    assert link_lengths(points, tip).shape == (2, 3, 5)
    one = points[1, 2]
    np.testing.assert_allclose(link_lengths(points, tip)[1, 2], link_lengths(one, tip))
    assert clearance(points, tip)[1, 2] == pytest.approx(clearance(one, tip))


@pytest.mark.parametrize("seed", range(3))
def test_slid_joints_have_the_least_total_length(seed, optimum):
    arm = realise(optimum).arranged(np.random.default_rng(seed).permutation(7))
    slid = slide(arm)
    np.testing.assert_allclose(slid.full_jacobian(), arm.full_jacobian(), atol=1e-12)

    def total(ways):
        return link_lengths(arm.points + ways[:, None] * arm.directions, arm.end_effector).sum()

    least = min(
        minimize(total, start, method="BFGS").fun
        for start in np.random.default_rng(seed).standard_normal((3, 7))
    )
    here = link_lengths(slid.points, slid.end_effector).sum()
    assert here <= least + 1e-6
    assert here < total(np.zeros(7))


def test_planar_joints_have_nowhere_to_slide():
    arm = realise(reference.PLANAR_3R)
    np.testing.assert_allclose(slide(arm).points, arm.points, atol=1e-15)
