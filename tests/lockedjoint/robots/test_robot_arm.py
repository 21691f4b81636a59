"""The column model robot: real arms against pinocchio, scaling, invariances."""

from dataclasses import replace
from functools import lru_cache

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lockedjoint.formulations import measures
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.nlp.errors import InputError
from results.robots.survey import ARMS
from tests.made_robots import pose_in_pinocchio
from tests.made_robots import real as declared_as

SEEDS = st.integers(0, 2**32 - 1)


@lru_cache
def real(name):
    return declared_as(name, "position" if name == "UR5" else "all").arm()


def designed(name):
    """The chain of an arm whose prismatic joints were designed in another unit than metres."""
    chain = real(name).chain
    joints = tuple(replace(one, speed=0.4 if one.prismatic else 1.0) for one in chain.joints)
    return replace(chain, joints=joints)


@pytest.mark.parametrize("declared", ARMS, ids=lambda one: f"{one.name}, {one.task}")
def test_real_arms_agree_with_pinocchio(declared, made):
    """Panda, iiwa, UR and all the rest: limits, and J at random configurations to 1e-9."""
    model, arm = made.pinocchio_model(declared), declared.arm()
    for joint in arm.chain.joints:
        place = model.joints[model.getJointId(joint.name)]
        limits = np.array([model.lowerPositionLimit, model.upperPositionLimit])[:, place.idx_q]
        limits = limits if place.nq == 1 else (-np.inf, np.inf)
        assert (joint.lower, joint.upper) == pytest.approx(tuple(limits))
    rng = np.random.default_rng(7)
    for _ in range(20):
        point = arm.sample(rng)
        ours, theirs = arm.metric_jacobian(point), made.of_pinocchio(model, arm.chain, point)
        assert np.max(np.abs(ours - theirs)) < 1e-9


@pytest.mark.parametrize("task", ["all", "position", "wx,vz,vy", "orientation"])
@pytest.mark.parametrize("length", [None, 0.3])
@pytest.mark.parametrize("frame", ["base", "tip"])
def test_symbolic_and_numeric_jacobians_are_the_same(task, length, frame):
    """Two codes: the formulations see one of them, the measures the other."""
    arm = RobotArm(designed("TIAGo,"), TaskSpace.parse(task, frame), length)
    q = arm.symbols()
    function = ca.Function("J", [q], [arm.matrix(q)])
    rng = np.random.default_rng(1)
    for _ in range(3):
        point = arm.sample(rng)
        assert np.array(function(point)) == pytest.approx(arm.jacobian(point), abs=1e-12)


@given(SEEDS)
@settings(max_examples=20, deadline=None)
def test_columns_are_derivatives_of_the_pose(seed):
    """Without any formula of a Jacobian: finite differences of pinocchio's poses."""
    arm, model = real("TIAGo,"), tiago_in_pinocchio()
    point, h = arm.sample(np.random.default_rng(seed)), 1e-6

    def pose(at):
        return pose_in_pinocchio(model, arm.chain.names, at, arm.chain.tip)

    matrix = arm.metric_jacobian(point)
    for k in range(arm.size):
        step = h * np.eye(arm.size)[k]
        ahead, behind = pose(point + step), pose(point - step)
        linear = (ahead.translation - behind.translation) / (2 * h)
        turn = pin.log3(ahead.rotation @ behind.rotation.T) / (2 * h)
        assert matrix[:, k] == pytest.approx(np.concatenate([linear, turn]), abs=1e-7)


@lru_cache
def tiago_in_pinocchio():
    return pin.buildModelFromUrdf(str(declared_as("TIAGo,").path))


@given(SEEDS, st.floats(-12, 6))
@settings(max_examples=20, deadline=None)
def test_a_robot_of_another_size_is_the_same_robot(seed, exponent):
    """All lengths times a factor, prismatic travel among them: J in units of ℓ stays."""
    factor = 10**exponent
    arm = real("TIAGo,")
    chain = arm.chain

    def grown(pose):
        return tuple((*row[:3], row[3] * factor) for row in pose[:3]) + pose[3:]

    motions = tuple(replace(one, placement=grown(one.placement)) for one in chain.motions)
    larger = replace(chain, motions=motions, end=grown(chain.end))
    point = arm.sample(np.random.default_rng(seed))
    large = np.where(chain.prismatic, factor, 1.0) * point
    for length in (None, 0.2):
        small = RobotArm(chain, length=length)
        other = RobotArm(larger, length=length and factor * length)
        assert other.jacobian(large) == pytest.approx(small.jacobian(point), abs=1e-9)


@given(SEEDS)
@settings(max_examples=20, deadline=None)
def test_whose_axes_makes_no_difference_to_whole_tasks(seed):
    """Base or tip: the singular values after every failure are the same."""
    point = real("Franka").sample(np.random.default_rng(seed))
    for task in ("all", "position", "orientation"):
        tasks = (TaskSpace.parse(task, frame) for frame in ("base", "tip"))
        matrices = (RobotArm(real("Franka").chain, one).jacobian(point) for one in tasks)
        base, tip = map(measures.locked_singular_values, matrices)
        assert base == pytest.approx(tip, abs=1e-10)


def test_joints_without_limits_are_drawn_from_one_turn(made):
    kinds = {"j0": {"kind": "continuous"}, "j1": {"kind": "prismatic"}}
    joints = made.serial(["0 0 0.3"] * 3, ["0 1 0"] * 3, **kinds, j2=kinds["j0"])
    text = made.urdf(joints).replace('lower="-2" upper="2"', 'lower="-inf" upper="inf"')
    arm = made.arm(text, task="vx,vz")
    rng = np.random.default_rng(0)
    drawn = np.array([arm.sample(rng) for _ in range(200)])
    assert np.all(np.abs(drawn) <= [np.pi, 1.0, np.pi])
    assert np.all(np.max(np.abs(drawn), axis=0) > [3.0, 0.9, 3.0])


def test_what_cannot_be_an_arm_and_is_no_batch_of_postures():
    chain = real("UR5").chain
    with pytest.raises(InputError, match=r"is 6 \(shoulder_pan_joint.*more than the 6 task"):
        RobotArm(chain)
    for length in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="length"):
            RobotArm(chain, TaskSpace(("vx",)), length)
    for points in (np.zeros(6), np.zeros((2, 2, 7)), np.full((1, 7), np.nan)):
        with pytest.raises(InputError, match=r"shape \(N, 7\)|Jacobian 0 is not finite"):
            real("Franka").worst_case(points)


def test_axes_that_all_meet_in_the_tip_have_no_lever_arm(made):
    joints = made.serial(["0 0 0.2"] + ["0 0 0"] * 3, ("0 0 1", "0 1 0", "0 0 1", "0 1 0"))
    arm = made.arm(made.urdf(joints), task="position")
    with pytest.raises(InputError, match="axes of all revolute joints meet"):
        arm.jacobian(np.zeros(4))
    with pytest.raises(InputError, match="Jacobian 0 is not finite"):
        arm.worst_case(np.zeros((2, 4)))
    turning = RobotArm(arm.chain, TaskSpace.parse("orientation"))
    assert np.linalg.norm(turning.jacobian(np.ones(4)), axis=0) == pytest.approx(np.ones(4))


@pytest.mark.parametrize("name", ["Franka", "KUKA", "UFactory", "TIAGo,", "PR2"])
@pytest.mark.parametrize(("task", "length"), [("all", None), ("all", 0.3), ("position", None)])
def test_worst_cases_of_many_postures(name, task, length):
    """Against the measure of each posture, and central differences away from ties."""
    arm = RobotArm(designed(name), TaskSpace.parse(task, "tip"), length)
    rng, h = np.random.default_rng(2), 1e-6
    points = np.array([arm.sample(rng) for _ in range(40)])
    sigma, gradient = arm.worst_case(points)
    alone = [measures.worst_case_sigma(arm.jacobian(point)) for point in points]
    assert sigma == pytest.approx(np.array(alone), abs=1e-13)
    left = np.sort([measures.locked_singular_values(arm.jacobian(one)) for one in points])
    smooth = (left[:, 0] > 1e-3) & (left[:, 1] - left[:, 0] > 1e-3)
    assert np.sum(smooth) > 10 or (name, task) == ("KUKA", "all")
    steps = h * np.eye(arm.size)
    ahead, behind = (
        np.array([arm.worst_case(points + t * step)[0] for step in steps]) for t in (1, -1)
    )
    slopes = (ahead - behind).T / (2 * h)
    assert gradient[smooth] == pytest.approx(slopes[smooth], abs=1e-6)


@pytest.mark.parametrize("name", ["Franka", "KUKA", "TIAGo,", "PR2"])
def test_one_posture_is_one_of_many(name):
    """Another way of computing the same, also near singular postures."""
    arm = real(name)
    rng = np.random.default_rng(3)
    points = np.array([arm.sample(rng) for _ in range(300)])
    sigma, gradient = arm.worst_case(points)
    alone = [arm.worst_case(point) for point in points]
    assert np.array([one for one, _ in alone]) == pytest.approx(sigma, abs=1e-12)
    left = np.sort([measures.locked_singular_values(arm.jacobian(one)) for one in points])
    clear = (sigma > 1e-6) & (left[:, 1] - left[:, 0] > 1e-6)
    slopes = np.array([slope for _, slope in alone])
    assert np.sum(clear) > 200 or name == "KUKA"
    assert slopes[clear] == pytest.approx(gradient[clear], abs=1e-7)


def test_worst_cases_where_the_jacobian_has_zeros(made):
    """Entries that are zero by structure, and joints that mimic."""
    mimic = '<mimic joint="j0" multiplier="-0.5" offset="0.2"/>'
    joints = made.serial(["0 0 1"] * 4, ("0 1 0",) * 4, j2={"mimic": mimic})
    arm = made.arm(made.urdf(joints), task="vx,vz")
    points = np.random.default_rng(0).uniform(-1, 1, (30, 3))
    sigma, gradient = arm.worst_case(points)
    for point, value, slope in zip(points, sigma, gradient, strict=True):
        assert value == pytest.approx(measures.worst_case_sigma(arm.jacobian(point)), abs=1e-13)
        alone, same = arm.worst_case(point)
        assert (alone.shape, same.shape) == ((), (3,))
        assert alone == pytest.approx(value, abs=1e-14)
        assert same == pytest.approx(slope, abs=1e-12)


def test_more_postures_than_are_evaluated_at_once(monkeypatch):
    arm = real("Franka")
    points = np.array([arm.sample(np.random.default_rng(k)) for k in range(7)])
    whole = arm.worst_case(points)
    monkeypatch.setattr("lockedjoint.kinematics.worst_cases._CONFIGURATIONS_AT_ONCE", 3)
    for one, other in zip(whole, arm.worst_case(points), strict=True):
        assert one == pytest.approx(other, abs=1e-11)
    sigma, gradient = arm.worst_case(np.zeros((0, 7)))
    assert (sigma.shape, gradient.shape) == ((0,), (0, 7))
