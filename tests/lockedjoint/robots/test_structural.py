"""Structural failures: what samples and geometry say of arms made from DH lists."""

from math import pi

import numpy as np
import pytest

from lockedjoint.formulations import measures
from lockedjoint.kinematics.read_dh_table import dh_tree
from lockedjoint.robot import Robot
from lockedjoint.robots.structural import structural_failures
from tests.made_robots import real

# Modified Denavit–Hartenberg parameters (α, a, d) of a spherical shoulder, an elbow and a
# spherical wrist; the tool is 0.1 m from the wrist.
SRS = [(0, 0, 0.3), (-pi / 2, 0, 0), (pi / 2, 0, 0.4), (-pi / 2, 0, 0)]
SRS += [(pi / 2, 0, 0.4), (-pi / 2, 0, 0), (pi / 2, 0, 0)]


def with_offset(k, a):
    """The same arm with the link length a before joint k."""
    return tuple((one[0], a, one[2]) if i == k else one for i, one in enumerate(SRS))


def arm(parameters, task="all", point=(0, 0.02, 0.1)):
    lines = ["# convention: modified", "joint,kind,alpha_rad,a,d,theta_rad,lower_rad,upper_rad"]
    lines += [f"j{k},R,{alpha},{a},{d},0,-2,2" for k, (alpha, a, d) in enumerate(parameters)]
    return Robot(dh_tree("\n".join(lines).encode()), task=task, point=point).arm


def test_a_spherical_shoulder_and_wrist():
    (found,) = structural_failures(arm(SRS))
    assert (found.joint, found.kind) == ("j3", "structural")
    assert found.ratio < 1e-12
    assert found.miss < 1e-12
    assert "--task position" in found.sentence
    assert structural_failures(arm(SRS, "position")) == ()


@pytest.mark.parametrize("joint", [1, 2, 5, 6])
def test_an_offset_of_a_millimetre_makes_it_near_structural(joint):
    """Its axes miss a common line by no more than that."""
    exact = arm(with_offset(joint, 0.001))
    (found,) = structural_failures(exact)
    assert (found.joint, found.kind) == ("j3", "near-structural")
    assert 1e-5 < found.ratio < 0.02
    assert 1e-5 < found.miss <= 0.001
    assert "mm" in found.sentence


def test_the_ratio_is_of_what_is_left_before_and_after(made):
    """Over postures of one's own, by a loop: within a factor of two of the sampled ratio."""
    made_arm = arm(with_offset(2, 0.002))
    (found,) = structural_failures(made_arm)
    rng = np.random.default_rng(5)
    drawn = [made_arm.jacobian(made_arm.sample(rng)) for _ in range(200)]
    left = max(made.sigmas_left(one)[3] for one in drawn)
    before = max(measures.singular_values(one)[-1] for one in drawn)
    assert found.ratio == pytest.approx(left / before, rel=1.0)


def test_offsets_as_large_as_links_are_not_structural():
    """Before the elbow an offset only changes the distance between the centres."""
    assert structural_failures(arm(with_offset(3, 0.1))) != ()
    assert structural_failures(arm(with_offset(2, 0.1))) == ()


@pytest.mark.parametrize(
    ("name", "kinds"),
    [
        ("Franka Panda", []),
        ("KUKA LBR iiwa 14", [("joint_a4", "near-structural")]),
        ("iCub, left arm", [("l_elbow", "structural")]),
    ],
)
def test_arms_that_exist(name, kinds):
    """The iiwa as described has offsets of 0.436 mm at the shoulder."""
    found = structural_failures(real(name).arm())
    assert [(one.joint, one.kind) for one in found] == kinds
    assert all(one.miss < 0.00044 for one in found)


def test_parallel_axes_are_a_point_at_infinity():
    """A yaw joint, three parallel axes and a spherical wrist: without the yaw, a plane."""
    parameters = [(0, 0, 0.2), (pi / 2, 0, 0), (0, 0.4, 0), (0, 0.4, 0)]
    parameters += [(pi / 2, 0, 0.1), (-pi / 2, 0, 0), (pi / 2, 0, 0)]
    found = {one.joint: one for one in structural_failures(arm(parameters))}
    assert found["j0"].kind == "structural"
    assert found["j0"].miss < 1e-9


def test_a_task_beyond_the_arm_makes_every_failure_structural():
    flat = [(0, 0.3, 0)] * 8
    found = structural_failures(arm(flat, point=(0.3, 0, 0)))
    assert {one.kind for one in found} == {"structural"}
    assert len(found) == 8
    assert all(one.miss is None for one in found)
