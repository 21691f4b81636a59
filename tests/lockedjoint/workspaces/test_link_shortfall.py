"""What links with a locked joint are too short for: never a point that the arm reaches."""

import numpy as np
import pytest

from lockedjoint.kinematics.chain_between import chain_between
from lockedjoint.kinematics.serial_chain import from_first_joint, planar_chain, serial_chain
from lockedjoint.workspaces.link_shortfall import link_shortfall
from tests.lockedjoint.workspaces.test_workspace import locked, ring

LENGTHS = (0.6, 0.25, 0.1)


@pytest.mark.parametrize("planar", [True, False])
def test_no_point_that_is_reached_is_beyond_the_links(made, planar):
    spatial = serial_chain(chain_between(made.tree(made.offset_arm()), "l7"))
    arm = planar_chain(LENGTHS) if planar else spatial
    q = np.random.default_rng(0).uniform(-3, 3, (len(arm.joints), 500))
    points = from_first_joint(arm).tip_at(q)[0].T
    for joint, places in enumerate(q):
        assert link_shortfall(arm, points, joint, places).max() < 1e-12


@pytest.mark.parametrize("joint", range(3))
def test_of_a_planar_arm_it_is_how_far_the_ring_of_two_links_is(joint):
    rng = np.random.default_rng(1)
    points = np.pad(rng.uniform(-1.2, 1.2, (300, 2)), ((0, 0), (0, 1)))
    for place in (0.3, -2.0):
        ours = link_shortfall(planar_chain(LENGTHS), points, joint, np.full(300, place))
        margin = ring(*locked(LENGTHS, points[:, :2], joint, place))
        assert (ours > 0).sum() > 50
        assert np.array_equal(ours > 0, margin < 0)
        assert ours[ours > 0] == pytest.approx(-margin[margin < 0])
