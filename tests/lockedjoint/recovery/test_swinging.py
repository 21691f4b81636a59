"""A joint that swings freely: against a pendulum's closed form, and simulated dynamics."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from lockedjoint.kinematics.hanging import HangingJoint
from lockedjoint.kinematics.pose import Pose
from lockedjoint.kinematics.read_robot import read_robot
from lockedjoint.nlp.errors import InputError
from lockedjoint.paths.waypoints import ToolPath
from lockedjoint.recovery.checking import SWING_RAD, faults
from lockedjoint.recovery.failures import Damage, FreeSwinging, Locked
from lockedjoint.recovery.goal import ToolGoal
from lockedjoint.recovery.recover import recover
from lockedjoint.recovery.recovery_search import RecoverySearch
from lockedjoint.robot import Robot
from tests.made_robots import real

pytest.importorskip("toppra", reason="install toppra")
LENGTHS, START, SWINGS = (0.5, 0.4, 0.3), [0.3, -0.5, 0.1], [FreeSwinging("j2")]
GOAL = Pose((0.3, 0.0, -0.8), None, 1e-4)


def pendulum(made, path, axis="0 1 0", last=1.0, limit=3.0):
    """Three links that hang down at zero, each a rod; the last of a mass."""
    limits = {"limit": f'lower="{-limit}" upper="{limit}" effort="9" velocity="1"'}
    places = ["0 0 0", *(f"0 0 {-long}" for long in LENGTHS)]
    joints = made.serial(places[:3], [axis] * 3, j0=limits, j1=limits, j2=limits)
    text = made.urdf([*joints, made.joint("tool", "l3", "tip", "fixed", xyz=places[3])])
    for k, (long, mass) in enumerate(zip(LENGTHS, (2.0, 1.5, last), strict=True), start=1):
        across, along = mass * long**2 / 12, mass / 1000
        inertia = f'ixx="{across}" iyy="{across}" izz="{along}" ixy="0" ixz="0" iyz="0"'
        rod = f'<origin xyz="0 0 {-long / 2}"/><mass value="{mass}"/><inertia {inertia}/>'
        rod = f'<link name="l{k}"><inertial>{rod}</inertial></link>'
        text = text.replace(f'<link name="l{k}"/>', rod) if mass else text
    path.write_text(text)
    return path


@pytest.fixture(scope="module")
def robot(made, tmp_path_factory):
    return pendulum(made, tmp_path_factory.mktemp("swing") / "pendulum.urdf")


@pytest.fixture(scope="module")
def answer(robot):
    return recover(robot, START, SWINGS, GOAL)


def simulated(path, run, passive, tip, damping=1e-3, step=1e-3):
    """Where the tip ends by pinocchio's aba: torques keep all joints but one on their way."""
    model = pin.buildModelFromUrdf(str(path))
    data = model.createData()
    places = [model.joints[model.getJointId(name)].idx_v for name in run.joints]
    own = model.joints[model.getJointId(passive)].idx_v
    times = np.arange(0.0, run.duration, step)
    wanted = np.zeros((len(times), 3, model.nv))
    for k, rows in enumerate((run.positions, run.velocities, run.accelerations)):
        for place, column in zip(places, rows.T, strict=True):
            wanted[:, k, place] = np.interp(times, run.times, column)
    q, v = pin.neutral(model), np.zeros(model.nv)
    q[places] = run.positions[0]
    for there, speed, rate in wanted:
        pull = rate + 400 * (there - q) + 40 * (speed - v)
        torque = pin.rnea(model, data, q, v, pull)
        torque[own] = -damping * v[own]
        v += step * pin.aba(model, data, q, v, torque)
        q += step * v
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[model.getFrameId(tip)].translation.copy()


def test_the_last_link_hangs_straight_down_all_the_way(answer):
    assert answer.verdict == "trajectory", answer.tried
    q = answer.trajectory.positions
    assert q[0] == pytest.approx([0.3, -0.5, 0.2], abs=1e-9)  # to where it hangs
    assert np.abs(q.sum(axis=1)).max() < 1e-4
    # In closed form: the elbow is above the goal by the last link.
    x, z = GOAL.position[0], GOAL.position[2] + LENGTHS[2]
    bend = np.arccos((x**2 + z**2 - 0.5**2 - 0.4**2) / (2 * 0.5 * 0.4))
    assert abs(q[-1, 1]) == pytest.approx(bend, abs=1e-3)


def test_simulated_dynamics_end_at_the_goal(robot, answer):
    end = simulated(robot, answer.trajectory, "j2", "tip")
    assert np.linalg.norm(end - GOAL.position) < GOAL.tolerance + SWING_RAD * LENGTHS[2]


def test_the_check_finds_a_swing(robot, answer):
    arm = Damage.of(robot, SWINGS)
    run = answer.trajectory
    assert faults(arm, run.positions[0], ToolGoal(GOAL), run) == []
    faster = {"velocities": run.velocities * 3, "accelerations": run.accelerations * 9}
    for change in (
        {"times": run.times / 3, **faster},
        {"positions": run.positions + [0, 0, 0.02]},
    ):
        other = replace(run, **change)
        found = faults(arm, other.positions[0], ToolGoal(GOAL), other)
        assert any("swings" in sentence for sentence in found)


def test_what_no_angle_of_the_joint_reaches_is_proved_impossible(robot):
    far = recover(robot, START, SWINGS, Pose((0.0, 0.0, -1.25)))
    assert far.verdict == "impossible, proved"
    # Within reach if the last link could be lifted, and no angle that hangs: nothing is known.
    little = RecoverySearch(starts=100, boxes=1000)
    lifted = recover(robot, START, SWINGS, Pose((1.0, 0.0, 0.2)), search=little)
    assert lifted.verdict == "not found"


def test_a_panda_with_a_free_wrist():
    """Against pinocchio: no torque of gravity at the end, and the tip at the goal."""
    path, place = real("Franka").path, (0.5, 0.3, 0.4)
    start = [0, -0.5, 0, -2.0, 0, 1.8, 0.7]
    found = recover(
        Robot(path, tip="panda_hand"), start, FreeSwinging("panda_joint6"), Pose(place)
    )
    assert found.verdict == "trajectory", found.tried
    end = simulated(path, found.trajectory, "panda_joint6", "panda_hand")
    assert np.linalg.norm(end - place) < SWING_RAD * 0.3
    model = pin.buildModelFromUrdf(str(path))
    q = pin.neutral(model)
    q[:7] = found.trajectory.positions[-1]
    assert abs(pin.computeGeneralizedGravity(model, model.createData(), q)[5]) < 1e-4


def test_gravity_by_differences(robot):
    """Slopes of the angle off q* where it hangs, and how it falls, on the pendulum."""
    whole = Robot(robot)
    joint = HangingJoint.of(whole.description, whole.chain, "j2")
    q = joint.hung(np.array([0.4, 0.5, 1.0]))
    assert q == pytest.approx([0.4, 0.5, -0.9], abs=1e-12)
    assert joint.moment(q) == pytest.approx(1.0 * 9.81 * 0.15)
    angle, slopes = joint.off((q + 1e-6 * np.eye(3)).T)
    assert angle == pytest.approx(1e-6 * slopes[:, 0], abs=1e-10)
    raised, still = q + [0, 0, 0.3], np.zeros(3)
    falls = -9.81 * 0.15 * np.sin(0.3) / (0.3**2 / 12 + 0.15**2)
    assert joint.falls(raised, still, still) == pytest.approx(falls)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"last": 0.0}, "bears none"),
        ({"axis": "0 0 1"}, "balanced"),
        ({"limit": 0.15}, "where it hangs"),
        ({"goal": ToolPath(np.array([[0.3, 0, -0.8], [0.3, 0, -0.9]]))}, "a path"),
        ({"failures": [Locked("j2", 0.0), *SWINGS]}, "two of j2"),
        ({"failures": [FreeSwinging("j0"), *SWINGS]}, "more than one"),
        ({"robot": "tree"}, "URDF file or a pinocchio model"),
    ],
)
def test_what_is_not_known_to_hang_is_refused(made, tmp_path, change, words):
    shape = {key: value for key, value in change.items() if key in ("last", "axis", "limit")}
    path = pendulum(made, tmp_path / "made.urdf", **shape)
    robot = read_robot(path) if "robot" in change else path
    start = [0.1, -0.1, 0.0] if not shape else [0.1, 0.1, 0.1]
    with pytest.raises(InputError, match=words):
        recover(robot, start, change.get("failures", SWINGS), change.get("goal", GOAL))


def test_the_command_knows_it(lockedjoint, robot):
    words = ("recover", robot.name, "--q=0.3,-0.5,0.1", "--reduced", "j2=free")
    found = lockedjoint.json(*words, "--at=0.3,0,-0.8", cwd=robot.parent)
    assert found["verdict"] == "trajectory"
