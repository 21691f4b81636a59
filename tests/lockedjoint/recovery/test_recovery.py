"""After failures: against closed forms, pinocchio, an independent check, and its mutants."""

import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import BPoly
from scipy.spatial.transform import Rotation

from lockedjoint.kinematics.pose import Pose
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.nlp.errors import InputError
from lockedjoint.paths.waypoints import ToolPath
from lockedjoint.recovery import check_proof
from lockedjoint.recovery.check_proof import check
from lockedjoint.recovery.checking import faults, tip_pose
from lockedjoint.recovery.failures import Damage, Locked, ReducedRange, ReducedSpeed
from lockedjoint.recovery.goal import ToolGoal
from lockedjoint.recovery.recover import recover
from lockedjoint.recovery.recovery_search import RecoverySearch
from lockedjoint.recovery.unreachable import prove_unreachable, upright_motions
from lockedjoint.robot import Robot

pytest.importorskip("toppra", reason="install toppra")
QUICK = RecoverySearch(starts=200, boxes=50_000)


def tip(arm, q):
    """The position and rotation of the tip at a configuration of all joints."""
    return tip_pose(arm, dict(zip(arm.healthy.names, q, strict=True)))


def pose(position, rotation):
    return Pose(tuple(position), tuple(Rotation.from_matrix(rotation).as_quat()))


def left(arm, free):
    """The tip's position and rotation at a configuration of the joints that are left."""
    position, rotation = arm.chain.tip_at(free[:, None])
    return position[:, 0], rotation[:, :, 0]


@pytest.fixture(scope="module")
def spatial(made):
    """A robot of seven joints, its arm with j2 locked, where it is, and a goal within reach."""
    tree = made.tree(made.offset_arm())
    whole = Damage.of(tree, ())
    q, after = np.random.default_rng(3).uniform(*whole.healthy.limits, (2, 7))
    after[2] = q[2]
    return tree, Damage.of(tree, [Locked("j2", q[2])]), q, pose(*tip(whole, after))


@pytest.fixture(scope="module")
def answer(spatial):
    tree, arm, q, goal = spatial
    return recover(tree, q, arm.failures, goal)


def test_the_arm_that_is_left_moves_as_the_whole_one(spatial):
    _, arm, q, _ = spatial
    rng = np.random.default_rng(0)
    for _ in range(20):
        free = rng.uniform(*arm.chain.limits)
        whole = arm.whole(free[None])[0]
        assert whole[2] == q[2]
        for found, same in zip(tip(arm, whole), left(arm, free), strict=True):
            assert found == pytest.approx(same, abs=1e-12)


def test_a_pose_is_reached_with_a_joint_locked(spatial, answer, made):
    _, arm, q, goal = spatial
    assert answer.verdict == "trajectory"
    run = answer.trajectory
    assert np.array_equal(run.positions[:, 2], np.full(len(run.times), q[2]))
    assert run.joints == arm.healthy.names
    model = pin.buildModelFromXML(made.offset_arm())
    for where, place in ((0, tip(arm, q)[0]), (-1, goal.position)):
        at = made.pose_in_pinocchio(model, run.joints, run.positions[where], arm.chain.tip)
        assert at.translation == pytest.approx(np.array(place), abs=1e-5)
    assert at.rotation == pytest.approx(goal.rotation, abs=1e-5)


def moved(rows, joint, by):
    shifted = rows.copy()
    shifted[:, joint] += by
    return shifted


ROWS = ("times", "positions", "velocities", "accelerations")
# What is done to a trajectory, and words of what the check says then.
MUTANTS = {
    "start where the arm is": lambda r: {"positions": moved(r.positions, 0, 0.01)},
    "j2 leaves": lambda r: {"positions": moved(r.positions, 2, 1e-3 * r.times / r.duration)},
    "j2 is faster": lambda r: {"velocities": moved(r.velocities, 2, 1.5)},
    "rest": lambda r: {"velocities": moved(r.velocities, 0, 0.01)},
    "follow from velocities": lambda r: {"times": 0.5 * r.times},
    "end at the goal": lambda r: {name: getattr(r, name)[:-40] for name in ROWS},
    "finite numbers": lambda r: {"positions": r.positions * np.nan},
    "j4 leaves": lambda r: {"positions": moved(r.positions, 4, 9.0)},
}


@pytest.mark.parametrize("words", MUTANTS)
def test_the_check_finds_what_is_wrong(spatial, answer, words):
    (_, arm, q, goal), run = spatial, answer.trajectory
    assert faults(arm, q, ToolGoal(goal), run) == []
    found = faults(arm, q, ToolGoal(goal), replace(run, **MUTANTS[words](run)))
    assert any(words in sentence for sentence in found)


@pytest.mark.parametrize("seed", range(12))
def test_a_planar_arm_reaches_the_ring_that_its_lock_leaves(made, seed):
    """Links 0.5, 0.4, 0.3 with the last joint locked: two links, whose reach is a ring."""
    rng = np.random.default_rng(seed)
    limit = 'lower="-3.2" upper="3.2" effort="1" velocity="1"'
    tree = made.tree(made.planar_urdf([0.5, 0.4, 0.3], limit))
    angle = rng.uniform(-3, 3)
    outer = abs(0.4 + 0.3 * np.exp(1j * angle))
    inside, side = seed % 2, 1 if seed % 4 < 2 else -1
    radius = abs(0.5 + side * outer) * (1 + 0.02 * side * (-1 if inside else 1))
    turn = rng.uniform(-np.pi, np.pi)
    goal = Pose((radius * np.cos(turn), radius * np.sin(turn), 0.0))
    found = recover(tree, [0.1, 0.2, angle], [Locked("j2", angle)], goal, search=QUICK)
    assert found.verdict == ("trajectory" if inside else "impossible, proved"), radius
    if not inside:
        # Of joints that turn fully, whose balls are on the axis of the next.
        assert check(json.loads(json.dumps(found.proof.content))) == found.proof.boxes


@pytest.mark.parametrize("turns", [-3, 1])
def test_a_continuous_joint_is_where_it_is_but_for_whole_turns(made, turns):
    """A lock and a range that are stated whole turns away; of a joint with limits refused."""
    text = made.planar_urdf([0.5, 0.4, 0.3], "")
    tree, q = made.tree(text.replace('"revolute"', '"continuous"')), [0.1, 0.2, 5.0]
    away, goal = 2 * np.pi * turns, Pose((0.5, 0.3, 0.0))
    answers = [
        recover(tree, q, [Locked("j2", 5.0 + by), ReducedRange("j0", by - 3, by + 3)], goal)
        for by in (0.0, away)
    ]
    for answer in answers:
        assert answer.verdict == "trajectory"
        run = answer.trajectory
        np.testing.assert_allclose(run.positions[0], q, atol=1e-9)
        np.testing.assert_allclose(run.positions[:, 2], 5.0, atol=1e-9)
        assert np.all(np.abs(run.positions[:, 0]) <= 3 + 1e-6)
    assert answers[0].trajectory.duration == pytest.approx(answers[1].trajectory.duration)
    with pytest.raises(InputError, match="where it has locked"):
        recover(tree, q, [Locked("j2", 5.1 + away)], goal)
    limits = 'lower="-20" upper="20" effort="1" velocity="1"'
    limited = made.tree(made.planar_urdf([0.5, 0.4, 0.3], limits))
    with pytest.raises(InputError, match="where it has locked"):
        recover(limited, [0.1, 0.2, 0.3], [Locked("j2", 0.3 + 2 * np.pi)], goal)


def test_no_pose_that_can_be_reached_is_proved_impossible(spatial):
    _, arm, _, _ = spatial
    rng = np.random.default_rng(1)
    for _ in range(8):
        whole = pose(*left(arm, rng.uniform(*arm.chain.limits)))
        for one, points in ((whole, 4), (Pose(whole.position), 1)):
            goal = ToolGoal(one)
            assert len(upright_motions(arm.chain, goal)["starts"]) == points
            assert prove_unreachable(arm.chain, goal, 2000) is None


@pytest.fixture(scope="module")
def proof(spatial):
    """Of a pose that the arm reaches before the failure, and not after it."""
    _, arm, _, _ = spatial
    two = Damage.of(arm.robot, [Locked("j2", 0.3), Locked("j5", -1.0)])
    rng = np.random.default_rng(7)
    for _ in range(10):
        goal = ToolGoal(pose(*tip(two, rng.uniform(*two.healthy.limits))))
        found = prove_unreachable(two.chain, goal, 20_000)
        if found is not None and found.boxes > 5:
            there = ToolGoal(pose(*left(two, rng.uniform(*two.chain.limits))))
            reached = upright_motions(two.chain, there)["targets"]
            return json.loads(json.dumps(found.content)), reached
    raise AssertionError("no proof")


def test_a_proof_is_checked_and_its_mutants_are_not(proof):
    plain, reached = proof
    assert check(plain) == sum(split < 0 for split in plain["splits"])
    count, splits = len(plain["starts"]), plain["splits"]
    for change in (
        {"targets": reached},
        {"tolerances": [2.0] * count},
        {"splits": splits[: splits.index(-1)]},
        {"splits": [-1]},
        {"placements": (np.array(plain["placements"]) * (1 + 1e-9)).tolist()},
        {"starts": [[1e3, 0, 0]] * count},
    ):
        with pytest.raises(ValueError, match=r"no point|left over|rounding is not bounded"):
            check(plain | change)


EMPTY = {
    "lower": [],
    "upper": [],
    "multipliers": [],
    "placements": [],
    "slides": [],
    "splits": [],
}


@pytest.mark.parametrize(
    "change",
    [
        EMPTY,
        {"lower": [], "upper": [], "multipliers": [[], []]},
        {"starts": [], "targets": [], "tolerances": []},
        {"tolerances": [-1.0]},
        {"tolerances": [float("nan")]},
        {"tolerances": ["0"]},
        {"tolerances": [True]},
        {"targets": [[float("inf"), 0, 0]]},
        {"targets": [[10**400, 0, 0]]},
        {"slides": [0, 0]},
        {"slides": ["", ""]},
        {"splits": [-1.5]},
        {"splits": [7, -1, -1]},
        {"splits": []},
        "lower above upper",
        "more splits",
        "missing",
    ],
)
def test_a_proof_of_nothing_is_none(proof, change):
    """A claim without joints, points or boxes, of contradictory limits, or not of numbers."""
    plain, _ = proof
    if change == "lower above upper":
        change = {"lower": plain["upper"], "upper": plain["lower"]}
    elif change == "more splits":
        change = {"splits": [*plain["splits"], -1]}
    if change == "missing":
        changed = {name: value for name, value in plain.items() if name != "tolerances"}
    else:
        changed = plain | change
    for name in ("tolerances", "targets"):
        if isinstance(change, dict) and name in change and change[name]:
            changed[name] = change[name] * len(plain["starts"])
    with pytest.raises(ValueError):  # noqa: PT011 (whatever it says)
        check(changed)


def test_a_direction_that_does_not_count_is_free(spatial):
    """A tool that may turn about its own axis, on an arm with two locked joints."""
    tree, _, q, _ = spatial
    failures = [Locked("j2", q[2]), Locked("j6", q[6])]
    arm = Damage.of(tree, failures)
    free = np.random.default_rng(5).uniform(*arm.chain.limits)
    place, rotation = left(arm, free)
    wanted = pose(place, rotation @ Rotation.from_euler("z", 1.3).as_matrix())
    goal = ToolGoal(wanted, TaskSpace(("vx", "vy", "vz", "wx", "wy"), "tip"))
    found = recover(tree, q, failures, goal, search=RecoverySearch(starts=2000))
    assert found.verdict == "trajectory"
    position, rotation = tip(arm, found.trajectory.positions[-1])
    assert position == pytest.approx(place, abs=1e-5)
    assert rotation[:, 2] == pytest.approx(wanted.rotation[:, 2], abs=1e-5)
    assert np.abs(rotation[:, 0] - wanted.rotation[:, 0]).max() > 0.1


def test_less_speed_takes_longer_and_less_range_is_kept(spatial):
    tree, _, q, goal = spatial
    near = Pose(goal.position, goal.quaternion, 0.05, 0.1)
    fast = recover(tree, q, [ReducedSpeed("j1", 1.0)], near, search=QUICK).trajectory
    slow = recover(
        tree, q, [ReducedSpeed(f"j{k}", 0.2) for k in range(7)], near, search=QUICK
    ).trajectory
    assert slow.duration > 3 * fast.duration
    assert np.abs(slow.velocities).max() <= 0.2 * (1 + 1e-6)
    place = Pose(goal.position)
    way = recover(tree, q, [ReducedSpeed("j1", 1.0)], place, search=QUICK).trajectory
    end = way.positions[-1, 1]
    low, high = sorted((q[1], end - 0.03 * np.sign(end - q[1])))
    low, high = (low - 0.5, high) if end > q[1] else (low, high + 0.5)
    kept = recover(tree, q, [ReducedRange("j1", low, high)], place, search=QUICK)
    assert kept.verdict == "trajectory"
    assert low <= kept.trajectory.positions[:, 1].min()
    assert kept.trajectory.positions[:, 1].max() <= high
    assert not low <= end <= high


def test_a_way_leads_around_what_is_between(made, tmp_path):
    """A gantry whose hoist has locked low goes around a wall that it could have passed over."""
    pytest.importorskip("ompl", reason="install ompl")
    slide = {"kind": "prismatic", "limit": 'lower="-1" upper="1" effort="1" velocity="1"'}
    kinds = {f"j{k}": slide for k in range(3)}
    text = made.urdf(made.serial(["0 0 0"] * 3, ["1 0 0", "0 1 0", "0 0 1"], **kinds))
    text = made.with_shapes(text, [0], '<box size="0.2 1 0.4"/>')
    path = tmp_path / "gantry.urdf"
    path.write_text(made.with_shapes(text, [3], '<sphere radius="0.05"/>'))
    gantry = Robot(path, clearance=0.02)
    failure, start, goal = Locked("j2", 0.1), [-0.5, 0.0, 0.1], Pose((0.5, 0.0, 0.1))
    arm = Damage.of(gantry, failure)
    apart = gantry.apart_along(arm.chain)
    found = recover(gantry, start, failure, goal)
    assert found.verdict == "trajectory"
    x, y, _ = found.trajectory.positions.T
    passing = np.abs(x) < 0.1
    assert passing.any()
    assert np.all(np.abs(y[passing]) > 0.5 + 0.05)
    assert abs(np.sign(y[passing]).sum()) == passing.sum()
    straight = recover(path, start, failure, goal).trajectory
    wrong = faults(arm, np.array(start), ToolGoal(goal), straight, apart)
    assert any("links are nearer" in sentence for sentence in wrong)
    shares = np.linspace(0, 1, 9)[:, None, None]
    q = found.trajectory.positions[:, arm.free]
    way = (q[:-1] + shares * np.diff(q, axis=0)).reshape(-1, 2)
    least = min(apart.closest(point, apart.pairs).distance for point in way)
    assert least >= 0.02 - 1e-5, "between samples, too"
    assert found.closest.distance == pytest.approx(least, abs=1e-3)
    assert found.closest.at_least - 1e-9 <= least <= found.closest.at_least + 2e-3
    assert found.to_dict()["closest"]["distance"] == found.closest.distance
    with pytest.raises(InputError, match="start is in collision"):
        recover(gantry, [0.1, 0.0, 0.1], failure, goal)
    # The wall ends at 0.5 m, and the tool is a ball of 0.05 m: 0.01 m are left between the two.
    near = r"start is where (\S+) and (\S+) are (\S+) m apart; .* at least 0.02 m apart"
    with pytest.raises(InputError, match=near) as refused:
        recover(gantry, [0.0, 0.56, 0.1], failure, goal)
    assert float(re.search(near, str(refused.value))[3]) == pytest.approx(0.01, abs=1e-3)


def test_a_limit_of_jerk_is_kept_between_points_too(made):
    """By scipy's polynomials through position, velocity and acceleration."""
    robot = Robot(made.tree(made.offset_arm()))
    start, failure, jerk = np.full(7, 0.3), Locked("j2"), 20.0
    goal = Pose(tuple(robot.chain.tip_at(start[:, None] + 0.3)[0][:, 0].tolist()))
    runs = [recover(robot, start, failure, goal, jerk=each) for each in (None, jerk)]
    free, limited = (found.trajectory for found in runs)
    assert limited.duration > free.duration
    assert free.jerk is None
    states = [limited.positions, limited.velocities, limited.accelerations]
    curve = BPoly.from_derivatives(limited.times, np.stack(states, axis=1))
    times = np.linspace(0, limited.duration, 20_000)
    assert np.max(np.abs(curve(times, 3))) <= jerk * (1 + 1e-9)
    assert np.all(limited.positions[:, 2] == 0.3)
    # The check of recoveries looks between points, too.
    arm = Damage.of(robot, failure, start)
    end = ToolGoal(Pose(goal.position, tolerance=0.01))
    assert faults(arm, start, end, limited) == []
    bent = limited.accelerations.copy()
    k = int(np.argmax(np.abs(limited.velocities[:, 0])))
    bent[k : k + 2] = [[1e5] * 7, [-1e5] * 7]
    wrong = faults(arm, start, end, replace(limited, accelerations=bent))
    assert any("faster than it can be" in sentence for sentence in wrong)


def test_a_path_is_followed_or_the_part_that_can_be(spatial):
    tree, arm, _, _ = spatial
    start = arm.whole(arm.chain.mid_range[None])[0]
    ends = tip(arm, start)[0] + np.outer([0.0, 0.05, 0.1], [0.3, -0.5, 0.4])
    done = recover(tree, start, arm.failures, ToolPath(ends), search=QUICK)
    assert done.verdict == "trajectory"
    assert tip(arm, done.trajectory.positions[-1])[0] == pytest.approx(ends[-1], abs=5e-5)
    far = np.stack([ends[0], ends[0] * 5])
    part = recover(tree, start, arm.failures, ToolPath(far), search=QUICK)
    assert part.verdict == "impossible, proved"
    assert 0 < part.help.share < 1
    assert part.help.share * 60 <= part.sample < 60


def test_the_operator_is_told_what_would_have_helped(made):
    """The middle joint of three locked straight: nothing near the base is within reach."""
    limit = 'lower="-3.1" upper="3.1" effort="1" velocity="1"'
    tree = made.tree(made.planar_urdf([0.5, 0.4], limit))
    found = recover(tree, [0, 0], [Locked("j1", 0.0)], Pose((0.0, 0.6, 0.0), None, 0.02))
    assert found.verdict == "impossible, proved"
    assert found.help.nearest.distance == pytest.approx(0.28, abs=1e-4)
    bent = np.arccos((0.6**2 - 0.5**2 - 0.4**2) / (2 * 0.5 * 0.4))
    assert {round(abs(place), 1) for place in found.help.brake["j1"]} <= {
        round(bent + off, 1) for off in (-0.1, 0.0, 0.1)
    }
    little = RecoverySearch(starts=5, boxes=1)
    found = recover(tree, [0, 0], [Locked("j1", 0.0)], Pose((0.0, 0.6, 0.0)), search=little)
    assert found.verdict == "not found"


def test_an_arm_without_a_joint_that_moves_is_told_so(spatial):
    tree, _, q, goal = spatial
    with pytest.raises(
        InputError, match=r"free joints move \(j0, j1, j2, j3, j4, j5, j6 cannot"
    ):
        recover(tree, q, [Locked(f"j{k}") for k in range(7)], goal)


def test_the_command_writes_a_trajectory_or_a_proof(lockedjoint, made, spatial, tmp_path):
    _, _, q, goal = spatial
    (tmp_path / "arm.urdf").write_text(made.offset_arm())
    here = "--q=" + ",".join(map(repr, q.tolist()))
    words = ("recover", "arm.urdf", here, "--locked", "j2")
    pose = "--at=" + ",".join(map(repr, (*goal.position, *goal.quaternion)))
    done = lockedjoint.here(*words, pose, "--out-dir", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    names = {f"trajectory.{kind}" for kind in ("csv", "json", "yaml", "ros2_control.csv")}
    assert {path.name for path in (tmp_path / "out").iterdir()} == names
    far = lockedjoint.here(*words, "--at=9,0,0", "--out-dir", "far", "--json", cwd=tmp_path)
    assert far.returncode == 1
    assert "out of reach" in far.stderr
    assert json.loads(far.stdout)["verdict"] == "impossible, proved"
    assert json.loads(far.stdout)["tried"][-1] == "a proof of 1 box, proved"
    assert [path.name for path in (tmp_path / "far").iterdir()] == ["proof.json"]
    shown = lockedjoint.here(*words, "--at=9,0,0", cwd=tmp_path).stdout
    assert re.search(r"^j2 could have locked at \(rad or m\) +nowhere$", shown, re.MULTILINE)
    # The check needs nothing but NumPy: isolated, and away from all other modules.
    alone = shutil.copy(check_proof.__file__, tmp_path / "alone.py")
    words = [sys.executable, "-I", alone, tmp_path / "far" / "proof.json"]
    done = subprocess.run(words, capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout == "proved: 1 leaves\n"
