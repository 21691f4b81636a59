"""The worst case as an expression and as C, against the measures and `worst_case`."""

import ctypes
import subprocess

import numpy as np
import pytest

from lockedjoint.formulations import measures
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.robot import Robot
from lockedjoint.robots.worst_case_code import worst_case_function
from tests.made_robots import real


def agree(arm, evaluate, count=60):
    points = arm.samples(np.random.default_rng(5), count)
    sigma, gradient = arm.worst_case(points)
    for point, value, slope in zip(points, sigma, gradient, strict=True):
        found, steep, joint = evaluate(point)
        left = measures.locked_singular_values(arm.jacobian(point))
        assert found == pytest.approx(value, abs=1e-14)
        assert left[round(float(joint))] == pytest.approx(value, abs=1e-12)
        first, second = np.sort(left)[:2]
        if first > 1e-4 and second - first > 1e-4:
            assert steep == pytest.approx(slope, abs=1e-9)


def called(function):
    def evaluate(point):
        sigma, gradient, joint = function(point)
        return float(sigma), np.array(gradient)[:, 0], float(joint)

    return evaluate


@pytest.mark.parametrize("name", ["Franka", "KUKA", "TIAGo,", "UR5"])
def test_the_expression_is_the_measure(name):
    arm = real(name, "position" if name == "UR5" else "all").arm()
    function = worst_case_function(arm)
    agree(arm, called(function))


def test_jacobians_with_equal_and_vanishing_singular_values(made):
    """Tasks of one and two directions, joints that slide, structural zeros."""
    arm = made.planar([1.0, 1.0, 1.0])
    function = worst_case_function(arm)
    agree(arm, called(function))
    for point in (np.zeros(3), np.array([0.3, 0.0, 0.0])):  # stretched: rank 1
        assert float(function(point)[0]) == pytest.approx(0, abs=1e-15)
        assert np.all(np.isfinite(np.array(function(point)[1])))
    single = RobotArm(arm.chain, TaskSpace.parse("vy"))
    function = worst_case_function(single)
    agree(single, called(function))


@pytest.mark.compiler
def test_the_command_writes_what_a_compiler_takes(lockedjoint, made, tmp_path):
    (tmp_path / "arm.urdf").write_text(made.offset_arm())
    words = ("codegen", "arm.urdf", "--out-dir", "code", "--name", "mine")
    joints = lockedjoint.json(*words, cwd=tmp_path)["joints"]
    assert joints == [f"j{k}" for k in range(7)]
    user = '#include "mine.h"\ndouble twice(const double* q) {return 2*mine_sigma(q, 0, 0);}\n'
    (tmp_path / "code" / "user.c").write_text(user)
    flags = ["-O0", "-Wall", "-Werror", "-Wno-unused", "-fPIC", "-shared", "-o", "mine.so"]
    sources = ["mine.c", "user.c", "-lm"]
    subprocess.run(["cc", *flags, *sources], cwd=tmp_path / "code", check=True, timeout=120)
    library = ctypes.CDLL(str(tmp_path / "code" / "mine.so"))
    library.mine_sigma.restype = library.twice.restype = ctypes.c_double
    arm = Robot(tmp_path / "arm.urdf").arm

    def evaluate(point):
        q, gradient = (ctypes.c_double * 7)(*point), (ctypes.c_double * 7)()
        joint = ctypes.c_int()
        sigma = library.mine_sigma(q, gradient, ctypes.byref(joint))
        assert library.twice(q) == 2 * sigma
        return sigma, np.array(gradient), joint.value

    agree(arm, evaluate)
