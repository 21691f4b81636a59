"""Postures at a pose: judged by pinocchio, by brute force, and where it is out of reach."""

import json
from functools import lru_cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import lockedjoint.formulations.solving.solve as solving
from lockedjoint.formulations import measures
from lockedjoint.kinematics.inverse import solve_ik
from lockedjoint.kinematics.pose import Pose
from lockedjoint.nlp.errors import InputError
from lockedjoint.robots.pose_constrained_arm import PoseConstrainedArm
from lockedjoint.robots.posture import best_posture
from lockedjoint.robots.search import Search
from tests.made_robots import real

DOWN = (1.0, 0.0, 0.0, 0.0)


@lru_cache
def panda_down():
    pose = Pose((0.4, 0.1, 0.5), DOWN)
    return pose, best_posture(real("Franka").arm(), Search(starts=12), at=pose)


def placed(made, declared, configuration):
    """Pose of the tip and worst case, by pinocchio, within its limits."""
    model, at = made.pinocchio_model(declared), (configuration, configuration.values())
    q, _ = made.in_pinocchio(model, *at)
    assert np.all((q >= model.lowerPositionLimit) & (q <= model.upperPositionLimit))
    sigma = made.by_pinocchio(declared, configuration)[1]
    return made.pose_in_pinocchio(model, *at, declared.tip), sigma


@lru_cache
def kuka_with_a_tolerance():
    turn = Rotation.from_euler("xyz", [2.5, 0.3, 0.2])
    pose = Pose((0.5, 0.1, 0.6), tuple(turn.as_quat()), 0.02, 0.1)
    return pose, best_posture(real("KUKA").arm(), Search(starts=2), at=pose)


@pytest.mark.parametrize(
    ("name", "posture"), [("Franka", panda_down), ("KUKA", kuka_with_a_tolerance)]
)
def test_the_answer_by_pinocchio_alone(made, name, posture):
    pose, found = posture()
    place, sigma = placed(made, real(name), found.assessment.q)
    off = np.linalg.norm(place.translation - pose.position)
    angle = (Rotation.from_matrix(place.rotation @ pose.rotation.T)).magnitude()
    assert off == pytest.approx(found.at.position_error, abs=1e-8)
    assert off <= pose.tolerance + 1e-7
    assert angle == pytest.approx(found.at.orientation_error, abs=1e-7)
    assert angle <= pose.angle + 1e-7
    assert sigma == pytest.approx(found.assessment.worst_case_sigma, abs=1e-9)


def test_a_tolerance_is_used_where_it_helps(made):
    arm, point = made.planar([1.0] * 4), (1.5, 0.8, 0.0)
    search = Search(starts=3)
    exact, near = (best_posture(arm, search, at=Pose(point, None, one)) for one in (0.0, 0.05))
    assert near.at.position_error == pytest.approx(0.05, abs=1e-6)
    assert near.assessment.worst_case_sigma > exact.assessment.worst_case_sigma + 1e-3


def test_as_good_as_the_best_of_many_points_of_the_self_motion():
    pose, found = panda_down()
    arm = real("Franka").arm()
    rng = np.random.default_rng(8)
    drawn = rng.uniform(*arm.chain.ranges, (7, 1500))
    points, reached = solve_ik(arm.chain, drawn, pose.target, iterations=60)
    sampled = [measures.worst_case_sigma(arm.jacobian(q)) for q in points[:, reached].T]
    assert len(sampled) > 200
    assert max(sampled) <= found.assessment.worst_case_sigma + 1e-6


def test_a_planar_arm_against_every_point_of_its_self_motion(made):
    """Four unit links hold a point: two angles on a grid, the others in closed form."""
    arm = made.planar([1.0] * 4)
    target = np.array([1.5, 0.8])
    found = best_posture(arm, Search(starts=4), at=Pose((*target, 0.0)))

    turns = np.linspace(-2, 2, 401)
    first, second = (one.ravel() for one in np.meshgrid(turns, turns))
    elbow = np.exp(1j * first) + np.exp(1j * (first + second))
    rest = target @ (1, 1j) - elbow
    best = 0.0
    for side in (-1, 1):
        with np.errstate(invalid="ignore"):
            bend = side * np.arccos(np.abs(rest) / 2)  # of the third link from the way left
        third = np.angle(rest) + bend - first - second
        third, fourth = ((turn + np.pi) % (2 * np.pi) - np.pi for turn in (third, -2 * bend))
        ok = (np.abs(third) <= 2) & (np.abs(fourth) <= 2)
        turns = np.stack([first, second, third, fourth], axis=1)[ok]
        sigmas, tips = made.planar_sigmas(np.cumsum(turns, axis=1))
        assert np.allclose(tips, target @ (1, 1j))
        best = max(best, float(np.max(sigmas)))
    assert best <= found.assessment.worst_case_sigma + 1e-9
    assert best == pytest.approx(found.assessment.worst_case_sigma, abs=5e-3)


def test_where_each_joint_of_a_planar_arm_may_lock(made):
    """In closed form: the first joint's angle fixes how far the other two have to reach."""
    arm = made.planar([1.0, 0.8, 0.5], limit='lower="-3.14159" upper="3.14159"')
    held = PoseConstrainedArm(arm.chain, arm.task, None, Pose((0.8, 0.4, 0.0)))
    found = held.locked_reach(held.sample(np.random.default_rng(0)))
    angles = np.linspace(-np.pi, np.pi, 2001)
    far = np.abs(complex(0.8, 0.4) - np.exp(1j * angles))
    share = 100 * np.mean((far <= 1.3) & (far >= 0.3))
    assert found[0].joint == "j0"
    assert found[0].percent == pytest.approx(share, abs=2.6)  # a cell is 2.5 %
    span = np.abs(1.0 + 0.8 * np.exp(1j * angles))
    there = abs(complex(0.8, 0.4))
    share = 100 * np.mean((there <= span + 0.5) & (there >= span - 0.5))
    assert found[1].percent == pytest.approx(share, abs=5.1)  # two ranges
    assert len(found[1].ranges) == 2
    assert found[1].ranges[0] == pytest.approx([-x for x in found[1].ranges[1][::-1]])


def test_out_of_reach_is_said_with_how_far(made):
    arm = made.planar([1.0, 1.0, 1.0])
    with pytest.raises(InputError, match=r"pose at \(3.2, 0, 0\) is out of reach.*0.2 m off"):
        best_posture(arm, Search(starts=2), at=Pose((3.2, 0, 0)))
    near = best_posture(arm, Search("residual", starts=1), at=Pose((3.2, 0, 0), tolerance=0.4))
    assert near.at.position_error == pytest.approx(0.4, abs=1e-3)
    turned = Pose((1.5, 0.5, 0), tuple(Rotation.from_euler("x", np.pi / 2).as_quat()))
    with pytest.raises(InputError, match=r"out of reach.*m and .*° off"):
        best_posture(arm, at=turned)


def test_a_pose_that_was_not_reached_is_no_answer(made, monkeypatch):
    """Whatever the solver says: a configuration beside the pose is dropped."""
    arm = made.planar([1.0, 1.0, 1.0, 1.0])
    judge = solving.judge

    def beside(case, run, *polish):
        run.solution.variables[0] += 1e-4
        return judge(case, run, *polish)

    monkeypatch.setattr(solving, "judge", beside)
    with pytest.raises(InputError, match="not found from 2 starts"):
        best_posture(arm, Search(starts=2), at=Pose((1.5, 0.8, 0)))


def test_the_command_says_how_nearly_and_where_joints_may_lock(lockedjoint, made, tmp_path):
    (tmp_path / "robot.urdf").write_text(made.offset_arm())
    (tmp_path / "pose.json").write_text('{"x": 0.3, "y": 0.4, "z": 1.1}')
    command = "posture robot.urdf --task position --at pose.json --tolerance 0.01 --starts 2"
    wanted = " --workers 1 --failure-probabilities j3=0 --out best.json"
    done = lockedjoint.here(*(command + wanted).split(), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "0.3, 0.4, 1.1 m, off by" in done.stdout
    found = json.loads((tmp_path / "best.json").read_text())
    assert found["never_failing_joints"] == ["j3"]
    assert found["at"]["pose"]["tolerance"] == 0.01
    assert [one["joint"] for one in found["at"]["after_failure"]] == [f"j{k}" for k in range(7)]
