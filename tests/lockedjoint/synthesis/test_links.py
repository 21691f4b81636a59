"""Link lengths, the room between links, and joints slid along their axes."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from lockedjoint.kinematics.geometry import segment_distance
from lockedjoint.synthesis.from_jacobian import realise
from lockedjoint.synthesis.links import (
    LINK_RADIUS,
    clearance,
    link_gap,
    link_lengths,
    slide,
    slide_apart,
)
from lockedjoint.synthesis.manipulator import Manipulator


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


def chain(*places):
    """A manipulator with vertical axes and joints at places, the last one the end effector."""
    points = np.array(places, dtype=float)
    n = len(points) - 1
    return Manipulator(np.tile([0.0, 0, 1], (n, 1)), points[:-1], np.zeros(n), points[-1])


def test_room_between_links_that_cross():
    height = 0.1
    arm = chain([0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 1, height], [1, -1, height])
    diameter = 2 * LINK_RADIUS * arm.size
    found = link_gap(arm)
    assert found.gap == pytest.approx(height - diameter)
    assert found.touching == ()
    low = chain([0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 1, 0.01], [1, -1, 0.01])
    assert link_gap(low).touching == ((0, 3),)
    assert link_gap(low).gap == pytest.approx(0.01 - 2 * LINK_RADIUS * low.size)


def test_an_elbow_does_not_touch_itself_but_a_folded_arm_does():
    assert link_gap(realise(np.zeros((2, 3)))).gap == np.inf  # no body
    assert link_gap(chain([0, 0, 0], [1, 0, 0], [1, 1, 0])).touching == ()
    assert link_gap(chain([0, 0, 0], [1, 0, 0], [0.3, 0, 0])).touching == ((0, 1),)
    # Folded around a short link: as far apart as that is long.
    wide, narrow = (
        link_gap(chain([0, 0, 0], [1, 0, 0], [1, 0, offset], [0, 0, offset]))
        for offset in (0.2, 0.005)
    )
    assert wide.touching == ()
    assert (0, 2) in narrow.touching


@pytest.mark.parametrize("seed", range(4))
def test_planar_links_that_cross_are_slid_apart(seed):
    """In a plane they would pass through one another; their joints have room along z."""
    rng = np.random.default_rng(seed)
    arms = (realise(rng.standard_normal((2, 5))) for _ in range(100))
    arm = next(arm for arm in arms if link_gap(arm).touching)
    slid = slide_apart(arm)
    assert link_gap(slid).touching == ()
    np.testing.assert_allclose(slid.jacobian(), arm.jacobian(), atol=1e-12)
    np.testing.assert_allclose(slid.points[:, :2], arm.points[:, :2], atol=1e-12)
    assert np.max(np.abs(slid.points[:, 2])) <= 0.5 * arm.size + 1e-12
    np.testing.assert_array_equal(slide_apart(arm).points, slid.points)
