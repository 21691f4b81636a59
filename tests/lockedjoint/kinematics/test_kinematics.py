"""Forward kinematics over many configurations, and the inverse of it."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lockedjoint.kinematics.forward import tip_kinematics
from lockedjoint.kinematics.geometry import roll_pitch_yaw
from lockedjoint.kinematics.inverse import solve_ik
from lockedjoint.kinematics.tool_poses import ToolPoses


def test_the_missing_rotation_up_to_half_a_turn():
    rng = np.random.default_rng(3)
    count = 400
    present = Rotation.random(count, random_state=4)
    axes = rng.normal(size=(count, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    axes[:3] = np.eye(3)
    angles = rng.uniform(0, np.pi, count)
    angles[:100] = np.pi
    angles[100:200] = np.pi - 10.0 ** rng.uniform(-16, -1, 100)
    wanted = Rotation.from_rotvec(angles[:, None] * axes) * present
    turns = [np.moveaxis(one.as_matrix(), 0, 2) for one in (present, wanted)]
    still = np.zeros((3, count))
    vectors = ToolPoses(still, turns[1], range(6)).missing(still, turns[0])[3:].T
    np.testing.assert_allclose(
        np.linalg.norm(vectors, axis=1), (wanted * present.inv()).magnitude(), atol=1e-12
    )
    # The rotation of the vector, from where the tool is, gives what is wanted.
    left = (Rotation.from_rotvec(vectors) * present * wanted.inv()).magnitude()
    assert left.max() < 1e-12


@pytest.mark.parametrize("pitch", [0.0, 0.4, -1.5, *(np.pi / 2 - d for d in (0, 1e-9, 1e-6))])
@pytest.mark.parametrize("side", [-1, 1])
def test_angles_of_a_rotation_make_it_again(pitch, side):
    """Also about a quarter turn, where there are many."""
    for roll, yaw in ((0.0, 0.0), (0.3, -2.8), (3.1, 1.2)):
        turn = Rotation.from_euler("xyz", [roll, side * pitch, yaw]).as_matrix()
        angles = roll_pitch_yaw(turn)
        again = Rotation.from_euler("xyz", angles).as_matrix()
        np.testing.assert_allclose(again, turn, atol=2e-7)
        assert abs(angles[1]) <= np.pi / 2


def test_half_a_turn_off_is_not_there(arm):
    q = arm.chain.mid_range[:, None] + 0.4
    origin, turn = arm.chain.tip_at(q)
    for axis in np.eye(3):
        back = np.einsum("ij,jkb->ikb", Rotation.from_rotvec(np.pi * axis).as_matrix(), turn)
        there, turned = (ToolPoses(origin, one, range(6)) for one in (turn, back))
        assert solve_ik(arm.chain, q, there, iterations=0)[1].all()
        assert not solve_ik(arm.chain, q, turned, iterations=0)[1].any()


def test_kinematics_are_those_of_the_chain(made):
    mimic = '<mimic joint="j1" multiplier="-0.5" offset="0.2"/>'
    joints = made.serial(
        ["0.1 0 0.3"] * 7, j2={"kind": "prismatic"}, j4={"mimic": mimic}, j5={"rpy": "1 2 3"}
    )
    arm = made.arm(made.urdf(joints), "l7", "position")
    rng = np.random.default_rng(0)
    q = np.stack([arm.sample(rng) for _ in range(5)], axis=1)
    origins, turns, matrices = arm.chain.forward(q)
    for k in range(5):
        origin, turn = map(ca.evalf, tip_kinematics(arm.chain, ca.SX(q[:, k]))[1:])
        assert origins[:, k] == pytest.approx(np.array(origin).ravel(), abs=1e-12)
        assert turns[..., k] == pytest.approx(np.array(turn), abs=1e-12)
        assert matrices[..., k] == pytest.approx(arm.metric_jacobian(q[:, k]), abs=1e-12)
