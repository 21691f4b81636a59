"""Assessing a robot: what is said must follow from its Jacobian."""

import numpy as np
import pytest

from lockedjoint.formulations import measures
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.robots.by_length import LengthScale
from lockedjoint.robots.robot_assessment import best_7r, measure_robot

POINT = np.array([0.3, -0.9, 0.4, 1.1, -0.2, 0.8, 0.5])


@pytest.fixture(scope="module")
def found(arm):
    return measure_robot(arm, POINT)


@pytest.mark.parametrize("failures", [1, 2])
def test_failures_follow_from_the_jacobian(made, failures):
    """The direction named is the one that moves least for any joint rates of norm 1."""
    arm = made.arm(made.offset_arm(8))
    found = measure_robot(arm, np.append(POINT, 0.1), failures)
    matrix = arm.jacobian(np.append(POINT, 0.1))
    assert np.array(found.jacobian) == pytest.approx(matrix)
    assert found.worst_case_sigma == measures.worst_case_sigma(matrix, failures)
    sigmas = [one.sigma for one in found.by_failure]
    assert sigmas == sorted(sigmas)
    assert len(sigmas) == {1: 8, 2: 28}[failures]
    for one in found.by_failure:
        kept = [k for k, name in enumerate(arm.chain.names) if name not in one.joints]
        direction = np.array(list(one.direction.values()))
        assert np.linalg.norm(direction) == pytest.approx(1.0)
        left = np.linalg.norm(direction @ matrix[:, kept])
        assert left == pytest.approx(one.sigma, abs=1e-12)
    assert found.worst_case_joints == found.by_failure[0].joints


def test_percentages(found):
    assert found.sigma_bound == pytest.approx(np.sqrt(14 / 42))
    assert found.percent_of_bound == pytest.approx(100 * found.worst_case_sigma * np.sqrt(3))
    assert found.percent_of_reachable == pytest.approx(100 * found.worst_case_sigma / best_7r())


def test_the_dependence_on_length(arm, found):
    middle = found.by_length[len(found.by_length) // 2]
    assert middle.length == pytest.approx(found.characteristic_length)
    assert middle.worst_case_sigma == pytest.approx(found.worst_case_sigma)
    ends = found.by_length[-1].length / found.by_length[0].length
    assert ends == pytest.approx(100.0)
    for one in found.by_length:
        matrix = RobotArm(arm.chain, length=one.length).jacobian(POINT)
        assert measures.worst_case_sigma(matrix) == pytest.approx(one.worst_case_sigma)


def test_no_length_is_better_than_the_best(arm, found):
    lengths = found.characteristic_length * np.logspace(-2, 2, 1001)
    scale = LengthScale(arm, arm.metric_jacobian(POINT), 1)
    percents = [one.percent_of_bound for one in scale.at(lengths)]
    assert found.best_length.percent_of_bound >= max(percents) - 1e-9
    assert found.best_length.percent_of_bound > found.percent_of_bound


def test_length_is_a_mere_unit_for_positions(arm):
    positions = RobotArm(arm.chain, TaskSpace.parse("position"))
    found = measure_robot(positions, POINT)
    assert (found.by_length, found.best_length) == ((), None)
    other = measure_robot(RobotArm(arm.chain, positions.task, 3.7), POINT)
    assert other.percent_of_bound == pytest.approx(found.percent_of_bound)


def test_equally_bad_failures_are_counted(made):
    """In the plane, four joints in a square about the tip: each failure leaves the optimum."""
    square = ["1 1 0", "-2 0 0", "0 -2 0", "2 0 0"]
    joints = made.serial(square, ["0 0 1"] * 4)
    tool = made.joint("tool", "l4", "tip", "fixed", xyz="-1 1 0")
    arm = made.arm(made.urdf([*joints, tool]), task="vx,vy")
    found = measure_robot(arm, np.zeros(4))
    assert found.equally_bad == 4
    assert found.worst_case_sigma == pytest.approx(1.0)
    assert found.percent_of_bound == pytest.approx(100.0)
    assert found.characteristic_length == pytest.approx(np.sqrt(2))
