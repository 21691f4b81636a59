"""Denavit–Hartenberg tables, read by the Robotics Toolbox."""

import numpy as np
import pytest

from lockedjoint.formulations.reproduction import reference
from lockedjoint.robot import Robot
from lockedjoint.synthesis.dh import Convention, denavit_hartenberg
from lockedjoint.synthesis.from_jacobian import realise
from tests.made_robots import toolbox_robot

both = pytest.mark.parametrize("convention", list(Convention))


def agrees_with_the_toolbox(arm, convention, slack):
    """Poses and Jacobians at zero displacement and elsewhere, frame changes apart."""
    table = denavit_hartenberg(arm, convention)
    rows = zip(arm.kinds, table.d, table.a, table.alpha, table.theta, strict=True)
    robot, rng = toolbox_robot(convention, rows), np.random.default_rng(0)
    for q in (np.zeros(arm.joints), *rng.uniform(-3, 3, (3, arm.joints))):
        flange = np.array(robot.fkine(q).A)
        pose = table.base @ flange @ table.tool
        np.testing.assert_allclose(pose, arm.pose(q), atol=slack)
        found = np.array(robot.jacob0(q))
        # From the last frame's origin to the end effector, and to the frame of the Jacobian.
        way = flange[:3, :3] @ table.tool[:3, 3]
        found[:3] += np.cross(found[3:], way, axis=0)
        found = np.kron(np.eye(2), table.base[:3, :3]) @ found
        np.testing.assert_allclose(found, arm.full_jacobian(q), atol=slack)


@both
def test_the_toolbox_finds_the_same_jacobian(arm, convention):
    agrees_with_the_toolbox(arm, convention, 1e-9)


@both
def test_the_robots_commands_read_the_table(arm, convention, tmp_path):
    """Written as CSV and read back: the same Jacobian, with every digit that the poses have."""
    path = tmp_path / "arm.csv"
    path.write_text(denavit_hartenberg(arm, convention).csv(), encoding="utf-8")
    read = Robot(path, "tip", task="vx", length=1.0).arm
    found = read.metric_jacobian(np.zeros(arm.joints))
    np.testing.assert_allclose(found, arm.full_jacobian(), atol=1e-9)


@pytest.mark.parametrize("matrix", [reference.PLANAR_3R, reference.planar_4r(0.3)[:2]])
def test_a_planar_arm_needs_lengths_and_angles_only(matrix):
    arm = realise(matrix)
    table = denavit_hartenberg(arm)
    np.testing.assert_allclose(table.d, 0, atol=1e-15)
    np.testing.assert_allclose(np.sin(table.alpha), 0, atol=1e-15)
    places = np.vstack([arm.points, arm.end_effector])
    np.testing.assert_allclose(table.a, np.linalg.norm(np.diff(places, axis=0), axis=1))


@both
@pytest.mark.parametrize("angle", [1e-4, 1e-6, 1e-8, 1e-10, 0.0])
def test_axes_that_are_almost_parallel(optimum, convention, angle):
    matrix = np.array(optimum)
    tilted = matrix[3:, 0] + angle * matrix[3:, 1]
    matrix[3:, 1] = tilted / np.linalg.norm(tilted)
    matrix[:3, 1] = np.cross(matrix[3:, 1], [1.0, 0.3, 0.2])
    agrees_with_the_toolbox(realise(matrix), convention, 1e-7)
