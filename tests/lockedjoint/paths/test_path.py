"""The path command and what it rests on: the survival test, the search."""

import csv
import io
import itertools
import json
import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lockedjoint.clearance.motion import ClearMotion
from lockedjoint.clearance.read_clearance import read_clearance
from lockedjoint.kinematics.chain import narrowed
from lockedjoint.kinematics.chain_between import chain_between
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.task_space import TaskSpace
from lockedjoint.nlp.errors import InputError
from lockedjoint.paths import planner
from lockedjoint.paths.following import follow
from lockedjoint.paths.motion_limits import MotionLimits
from lockedjoint.paths.path_search import PathSearch
from lockedjoint.paths.plan import continuations
from lockedjoint.paths.search import plan_path
from lockedjoint.paths.self_motion_map import SelfMotionMap
from lockedjoint.paths.survival import on_path, survivors
from lockedjoint.paths.timing import timed
from lockedjoint.paths.waypoints import Poses, ToolPath, read_waypoints

QUICK = PathSearch(samples=12, tracks=15, rounds=1)


@pytest.fixture(scope="module")
def planar(made):
    limit = 'lower="-3.1" upper="3.1" effort="1" velocity="2"'
    return made.planar([1, 1, 0.6], limit=limit)


def line(arm, reach=0.15, count=12):
    """Poses along a line through the pose midway between the limits."""
    origin, rotation = arm.chain.tip_at(arm.chain.mid_range[:, None] + 0.4)
    along = np.linspace(-reach, reach, count)[:, None]
    positions = origin[:, 0] + along * np.array([0.2, 1.0, -0.3])
    return Poses(positions, np.repeat(rotation[..., 0][None], count, 0), range(6))


def drawn(chain, poses, sample, count, seed):
    """Configurations at a sample from random starts."""
    samples = np.full(count, sample)
    return on_path(chain, poses, samples, np.random.default_rng(seed))[1]


def tool_path(poses):
    quaternions = Rotation.from_matrix(poses.rotations[[0, -1]]).as_quat()
    return ToolPath(poses.positions[[0, -1]], quaternions)


def test_survivors_are_those_of_elementary_geometry(planar):
    """After a lock a planar 3R is a planar 2R: it reaches a ring, and keeps its elbow."""
    lengths = np.array([1.0, 1.0, 0.6])
    # Out and in again.
    radii = np.concatenate([np.linspace(1.2, 2.4, 40), np.linspace(2.38, 1.0, 46)])
    positions = np.stack([radii, 0 * radii, 0 * radii], axis=1)
    rotations = np.repeat(np.eye(3)[None], len(radii), 0)
    poses = Poses(positions, rotations, planar.task.rows)
    nodes = drawn(planar.chain, poses, 0, 100, 2)
    ends = survivors(planar.chain, nodes, np.zeros(nodes.shape[1], dtype=int), poses)

    def rings(q):
        base, elbow, wrist = np.exp(1j * q)
        yield np.abs(radii - lengths[0] * base), lengths[1], lengths[2]
        yield radii, abs(lengths[0] + lengths[1] * elbow), lengths[2]
        yield radii, lengths[0], abs(lengths[1] + lengths[2] * wrist)

    told = {True: 0, False: 0}
    for q, end in zip(nodes.T, ends.T, strict=True):
        for joint, (distance, near, far) in enumerate(rings(q)):
            inside = np.minimum(distance - abs(near - far), near + far - distance)
            outside = np.flatnonzero(inside < -1e-3)
            if outside.size:
                # It gets to the border, unless a limit of a joint ends it before.
                told[False] += end[joint] >= outside[0] - 3
                assert end[joint] < outside[0]
            elif np.min(inside) > 0.01:
                told[True] += end[joint] == len(radii) - 1
    assert min(told.values()) > 10, told


def test_a_locked_joint_stays_and_the_pose_is_kept(arm):
    poses = line(arm)
    start = drawn(arm.chain, poses, 0, 20, 3)[:, :5]
    joint = np.arange(5)
    track, last = follow(arm.chain, start, poses, 0, joint=joint)
    for k in range(5):
        q = track[: last[k] + 1, :, k]
        assert np.all(q[:, k] == start[k, k])
        origin, _ = arm.chain.tip_at(q.T)
        np.testing.assert_allclose(origin.T, poses.positions[: last[k] + 1], atol=2e-5)


def test_the_map_has_every_configuration_and_foresees_its_failures(arm):
    poses = line(arm)
    found = SelfMotionMap(arm.chain, poses, np.random.default_rng(0))
    final = len(poses) - 1
    samples = range(0, final, 3)
    agree = []
    for k, ends in zip(samples, found.ends()[::3], strict=False):
        points = found.points(k)
        assert np.max(np.abs(poses.at(k).missing(*arm.chain.tip_at(points)))) < 1e-4
        # Nothing that random inverse kinematics finds is far from all points.
        q = drawn(arm.chain, poses, k, 200, 1)
        gaps = np.linalg.norm(q[:, :, None] - points[:, None], axis=0).min(axis=1)
        assert np.max(gaps) < 0.12
        some = points[:, ::5]
        tested = survivors(arm.chain, some, np.full(some.shape[1], k), poses)
        agree.append(np.mean((tested == final) == (ends[:, ::5] == final)))
    assert np.mean(agree) > 0.9


def test_the_plan_survives_more_than_minimum_norm_and_keeps_all_limits(arm):
    poses = line(arm)
    plan = plan_path(arm, tool_path(poses), QUICK)
    share = plan.planned.share
    assert plan.minimum_norm is None or share >= plan.minimum_norm.share
    assert share <= plan.best_of_samples <= np.mean(plan.joint_best_of_samples) + 1e-9
    q = plan.planned.configurations
    lower, upper = arm.bounds
    assert np.all((q >= lower) & (q <= upper))
    assert plan.speed <= 1.0
    origin, _ = arm.chain.tip_at(q.T)
    np.testing.assert_allclose(origin.T, plan.poses.positions, atol=2e-5)
    # Measured again, by hand: the survivors of one sample.
    ends = survivors(arm.chain, q[[4]].T, np.array([4]), plan.poses)
    assert (ends[:, 0] == 11).tolist() == plan.planned.survives[4].tolist()
    assert np.all(plan.planned.survives[-1])
    # And by what is stored for a controller.
    stored = np.load(io.BytesIO(continuations(arm, plan, QUICK.seed)))["configurations"]
    done = ~np.isnan(stored[:, :, -1, 0])
    assert done.T.tolist() == plan.planned.survives.tolist()
    for joint, k in np.argwhere(done):
        track = stored[joint, k, k:]
        np.testing.assert_allclose(track[:, joint], q[k, joint], atol=1e-12)
        assert np.all((track >= lower) & (track <= upper))
        origin, _ = arm.chain.tip_at(track.T)
        np.testing.assert_allclose(origin.T, plan.poses.positions[k:], atol=2e-5)
        assert np.isnan(stored[joint, k, :k]).all()


def test_a_path_from_hand_to_hand(made):
    """The tool of one arm moves along a line in the other hand; each by a chain of its own."""
    limit = {"limit": 'lower="-2.5" upper="2.5" effort="1" velocity="2"'}
    joints = []
    for arm, side in (("a", 0.3), ("b", -0.3)):
        joints += [
            made.joint(f"{arm}0", "base", f"{arm}1", xyz=f"0 {side} 0", **limit),
            made.joint(f"{arm}1", f"{arm}1", f"{arm}2", xyz="0.5 0 0", **limit),
            made.joint(f"{arm}end", f"{arm}2", arm, "fixed", xyz="0.4 0 0"),
        ]
    tree = made.tree(made.urdf(joints))
    both = RobotArm(chain_between(tree, "a", "b"), TaskSpace(("vx", "vy")))
    path = ToolPath(np.array([[-0.2, -0.6, 0.0], [0.3, -0.5, 0.0]]))
    plan = plan_path(both, path, QUICK)
    assert 0 < plan.planned.share <= plan.best_of_samples
    moved = []
    for chain in (chain_between(tree, "a"), chain_between(tree, "b")):
        own = [both.chain.names.index(name) for name in chain.names]
        q = plan.planned.configurations[:, own].T
        moved.append(chain.tip_at(q))
    (tool, _), (origin, rotation) = moved
    relative = np.einsum("jik,jk->ki", rotation, tool - origin)
    np.testing.assert_allclose(relative[:, :2], plan.poses.positions[:, :2], atol=2e-5)


def test_a_failure_that_no_trajectory_survives(planar):
    """Near the base and then at full stretch: joint 1 of a planar 3R has no common angle."""
    path = ToolPath(np.array([[1.2, 0, 0], [2.55, 0, 0]]))
    arm = RobotArm(narrowed(planar.chain, dict.fromkeys(("j1", "j2"), (0, 3.1))), planar.task)
    search = replace(QUICK, samples=20, duration=30.0)
    plan, again = (plan_path(arm, path, search) for _ in range(2))
    assert np.array_equal(again.planned.configurations, plan.planned.configurations)
    # At 1.2 joints 1 and 2 may be anywhere between, but at 2.55 both are nearly straight.
    assert plan.joint_best_of_samples[1] < 100
    for joint, (row, last) in enumerate(
        zip(plan.joint_rows(), plan.unrecoverable_until, strict=True)
    ):
        assert (row["unrecoverable_until_s"] is None) == (last < 0)
        assert not plan.planned.survives[: last + 1, joint].any()


def test_what_was_found_before_an_interrupt_is_an_answer(planar):
    said = []

    def interrupt(words):
        said.append(words)
        if words.startswith("polish"):
            raise KeyboardInterrupt

    path = ToolPath(np.array([[1.2, 0, 0], [2.2, 0, 0]]))
    plan = plan_path(planar, path, replace(QUICK, progress=interrupt))
    assert len(set(said)) == 3
    assert not plan.complete
    assert not plan.polished
    assert 0 < plan.planned.share <= plan.best_of_samples


POINTS = [[0, 0, 1, 0.1, 0.2, 0.3], [1, 0, 1, 0, 0, 0]]
NAMED = [dict(zip(("x", "y", "z", "roll", "pitch", "yaw"), one, strict=True)) for one in POINTS]
FORMS = {
    "a.csv": "0,0,1,0.1,0.2,0.3\n1,0,1,0,0,0\n",
    "b.csv": "\ufeffyaw,x,y,z,roll,pitch\n0.3,0,0,1,0.1,0.2\n\n0,1,0,1,0,0\n",
    "c.json": json.dumps(POINTS),
    "d.json": json.dumps({"waypoints": NAMED}),
    "e.csv": "x,y,z,qx,qy,qz,qw\n0,0,1,{}\n1,0,1,0,0,0,1\n",
}


@pytest.mark.parametrize("name", FORMS)
def test_waypoints_in_every_form(tmp_path, name):
    rotation = Rotation.from_euler("xyz", [0.1, 0.2, 0.3])
    shown = ",".join(map(str, rotation.as_quat()))
    (tmp_path / name).write_text(FORMS[name].replace("{}", shown), encoding="utf-8")
    path = read_waypoints(tmp_path / name)
    times, poses, places = path.sampled(11, 5.0)
    assert times == pytest.approx(np.linspace(0, 5, 11))
    assert poses.positions[5] == pytest.approx([0.5, 0, 1])
    half = Rotation.from_rotvec(rotation.as_rotvec() / 2)
    assert poses.rotations[0] == pytest.approx(rotation.as_matrix())
    assert poses.rotations[5] == pytest.approx(half.as_matrix())
    assert places[[0, 5, 10]] == pytest.approx([1, 1.5, 2])


BAD = {
    "": "not empty",
    "x,y\n0,0\n1,1\n": "columns of the waypoints is x,y",
    "X (m),Y (m),Z (m)\n0,0,0\n1,1,1\n": r"columns of the waypoints is x \(m\),y \(m\)",
    "x;y;z\n0;0;0\n1;1;1\n": "columns of the waypoints is x;y;z.*with commas between",
    "nan,0,0\n1,1,1\n": "waypoint 1 is nan,0,0",
    "0,0,0\n": "at least two",
    "0,0,0\n0,zero,1\n": "waypoint 2 is 0,zero,1",
    "0,0,0\n0,1\n": "waypoint 2 is of 2 entries",
    "0,0,0\n0,0,inf\n": "waypoint 2",
    "0,0\n": "waypoint 1 is of 2 numbers",
    "0,0,0\n1,0,0\n1,0,0\n": "waypoint 3 is the same",
    "t,x,y,z\n0,0,0,0\n1,1,0,0\n1,2,0,0\n": "time of waypoint 3 is 1 s after 1 s",
    "x,y,z,qx,qy,qz,qw\n0,0,1,0,0,0,1\n1,0,0,0,0,0,2\n": "waypoint 2 is 0, 0, 0, 2",
}


@pytest.mark.parametrize(("text", "said"), BAD.items())
def test_bad_waypoints_are_named(tmp_path, text, said):
    (tmp_path / "w.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        read_waypoints(tmp_path / "w.csv")


@pytest.mark.parametrize(
    ("points", "duration", "said"),
    [
        ([[1.2, 0, 0], [3, 0, 0], [1, 0, 0]], 10.0, "waypoint 2 is out of reach at"),
        ([[-2, 1.6, 0], [2, 1.6, 0], [2, 3, 0]], 10.0, "waypoint 3 is out of reach"),
        ([[2.5, 0.3, 0], [2.5, -0.3, 0], [-2.0, -1.6, 0]], 50.0, "between waypoints 2 and 3"),
        ([[1.2, 0, 0], [2.2, 0, 0]], 0.05, "speed of j. at the path between"),
    ],
)
def test_paths_that_cannot_be_followed_are_refused(planar, points, duration, said):
    if "between waypoints 2" in said:  # the way leads through where the arm cannot fold to
        chain = narrowed(planar.chain, {"j1": (-0.5, 0.5), "j2": (-0.5, 0.5)})
        planar = RobotArm(chain, planar.task)
    path = ToolPath(np.array(points, dtype=float))
    with pytest.raises(InputError, match=said):
        plan_path(planar, path, replace(QUICK, duration=duration))


@pytest.mark.parametrize(("x", "off"), [(3.0, 0.4), (-2.9, 0.3)])
def test_out_of_reach_says_what_is_nearest(planar, x, off):
    """Links of 2.6 in all: from a point outside the disc the nearest is on its edge."""
    path = ToolPath(np.array([[1.2, 0, 0], [x, 0, 0]], dtype=float))
    with pytest.raises(InputError, match="the nearest found, which is no proof") as refused:
        plan_path(planar, path, QUICK)
    said = re.search(r"is \((\S+), (\S+), (\S+)\) m, (\S+) m away", str(refused.value))
    *place, distance = map(float, said.groups())
    assert distance == pytest.approx(off, rel=0.02)
    assert np.hypot(*place[:2]) == pytest.approx(2.6, rel=1e-3)


def test_out_of_reach_says_how_far_the_tool_turns_away(arm):
    """A pose that the arm holds, turned about an axis by which it cannot: both parts count."""
    chain = narrowed(arm.chain, dict.fromkeys(arm.chain.names, (-0.01, 0.01)))
    position, rotation = chain.tip_at(chain.mid_range[:, None])
    turned = Rotation.from_matrix(rotation[:, :, 0]) * Rotation.from_rotvec([0, 0, 1.0])
    poses = ToolPath(
        np.stack([position[:, 0], position[:, 0] + 1e-3]), np.stack([turned.as_quat()] * 2)
    )
    with pytest.raises(InputError) as refused:
        plan_path(RobotArm(chain, arm.task), poses, QUICK)
    said = re.search(r"m, (\S+) m and (\S+)° away\.$", str(refused.value))
    off, degrees = map(float, said.groups())
    assert off < 0.1
    assert np.degrees(1.0) - 5 < degrees < np.degrees(1.0) + 1e-6


def test_rotations_need_waypoints_with_an_orientation(arm):
    path = ToolPath(np.array([[0.3, 0.1, 0.5], [0.3, 0.2, 0.5]]))
    with pytest.raises(InputError, match=r"task is vx,.*because the waypoints have no orienta"):
        plan_path(arm, path, QUICK)


def test_the_command_writes_what_it_says(lockedjoint, made, arm, tmp_path):
    (tmp_path / "robot.urdf").write_text(made.offset_arm())
    poses = line(arm)
    lines = [",".join(map(str, poses.positions[k].tolist())) for k in (0, -1)]
    (tmp_path / "w.csv").write_text("x,y,z\n" + "\n".join(lines))
    words = ("path", "robot.urdf", "w.csv", "--effort=samples=6", "--effort=tracks=8")
    done = lockedjoint.here(*words, "--out-dir", "here", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "best of samples" in done.stdout
    written = json.loads((tmp_path / "here/path.json").read_text())
    rows = csv.DictReader((tmp_path / "here/path.csv").read_text().splitlines())
    points = written["trajectory"]["configurations"]
    assert [float(row["j3 (rad)"]) for row in rows] == [point[3] for point in points]
    assert "joints that may lock" in (tmp_path / "here/path.svg").read_text()


def test_links_and_obstacles_are_avoided_between_samples_too(made, tmp_path):
    """A post that the best trajectory would go through; distances by coal at many steps."""
    pytest.importorskip("coal", reason="install coal")
    text = made.with_shapes(made.offset_arm(), range(1, 8), '<sphere radius="0.05"/>')
    (tmp_path / "arm.urdf").write_text(text)
    arm = made.arm(text)
    path = tool_path(line(arm))
    free = plan_path(arm, path, QUICK)
    assert free.to_dict()["collisions"] == "not checked"
    # Where link 3 is midway.
    middle = made.chain(text, "l3")
    at = middle.tip_at(free.planned.configurations[6:7, :3].T)[0][:, 0]
    obstacles = made.obstacle(tmp_path, " ".join(map(str, at)), '<sphere radius="0.02"/>')
    clearance = read_clearance(tmp_path / "arm.urdf", arm.chain, 0.01, obstacles)
    assert not clearance.is_kept(free.planned.configurations.T).all()
    plan = plan_path(arm, path, QUICK, clearance)
    q = plan.planned.configurations
    fine = np.concatenate([np.linspace(*ends, 30) for ends in pairwise(q)])
    closest = [clearance.closest(point, clearance.pairs).distance for point in (*q, *fine)]
    assert min(closest[: len(q)]) == pytest.approx(plan.closest.distance, abs=1e-12)
    assert plan.closest.distance >= 0.01
    assert min(closest) > 0
    assert plan.to_dict()["collisions"] == "none"
    assert 0 < plan.planned.share <= free.best_of_samples + 1e-9
    base = plan.minimum_norm
    assert (
        base is None
        or not clearance.is_kept(base.configurations.T).all()
        or (plan.planned.share >= base.share - 1e-9)
    )
    motion = ClearMotion(clearance, arm.chain)
    given = arm.chain, q.T, np.arange(len(q)), plan.poses, QUICK.seed, motion.clear
    assert plan.planned.ends.T.tolist() == survivors(*given).tolist(), (
        "what is shown is checked"
    )
    # What is stored for a controller touches nothing either, between samples too.
    stored = np.load(io.BytesIO(continuations(arm, plan, QUICK.seed, clearance)))
    done = np.isfinite(stored["configurations"][:, :, -1, 0])
    assert done.T.tolist() == plan.planned.survives.tolist()
    assert np.isfinite(stored["closest"]).tolist() == done.tolist()
    for joint, k in np.argwhere(done)[::5]:
        track = stored["configurations"][joint, k, k:]
        at_samples = [clearance.closest(q, clearance.pairs).distance for q in track]
        assert min(at_samples) == pytest.approx(stored["closest"][joint, k], abs=1e-12)
        between = [np.linspace(*ends, 10) for ends in pairwise(track)]
        for point in itertools.chain(*between):
            assert clearance.closest(point, clearance.pairs).distance > 0
    around = read_clearance(tmp_path / "arm.urdf", arm.chain, 2.0, obstacles)
    with pytest.raises(InputError, match="with links or obstacles too near only"):
        plan_path(arm, path, QUICK, around)


def test_the_deviation_is_the_largest_anywhere(made):
    """At samples and between, by forward kinematics: no point of the way is farther off."""
    arm = made.arm(made.offset_arm())
    plan = plan_path(arm, tool_path(line(arm)), QUICK)
    q = plan.planned.configurations
    at_samples = arm.chain.tip_at(q.T)[0].T - plan.poses.positions
    worst = float(np.max(np.linalg.norm(at_samples, axis=1)))
    for share in np.linspace(0, 1, 41):
        tool = arm.chain.tip_at((q[:-1] + share * np.diff(q, axis=0)).T)[0].T
        begins, ends = plan.poses.positions[:-1], plan.poses.positions[1:]
        along = np.linspace(0, 1, 2001)[:, None, None]
        way = begins + along * (ends - begins)
        worst = max(worst, float(np.max(np.min(np.linalg.norm(way - tool, axis=2), axis=0))))
    assert worst <= 1.02 * plan.deviation + 1e-7
    run = timed(arm.chain, q, MotionLimits.of(arm.chain, [2.0] * 7), path=plan.poses.positions)
    assert run.off_path >= np.linalg.norm(at_samples[0]) - 1e-12


def test_the_baseline_is_a_candidate(made, monkeypatch):
    """What is found is never below what is shown beside it."""
    arm = made.arm(made.offset_arm())
    monkeypatch.setattr(planner.Nodes, "best_sequence", worst_sequence)
    plan = plan_path(arm, tool_path(line(arm)), replace(QUICK, rounds=0))
    assert plan.minimum_norm is not None
    assert plan.planned.share >= plan.minimum_norm.share


def worst_sequence(nodes, tested=False, apart_from=None):
    """A track that keeps to the path, and survives least."""
    tracks = [nodes.at(k) for k in range(len(nodes._poses))]
    low = [np.argmin(np.sum(nodes.survives(k), axis=0)) for k in range(len(tracks))]
    return np.array([track[:, k] for track, k in zip(tracks, low, strict=True)])


@pytest.mark.parametrize("ending", ["csv", "json"])
def test_units_of_waypoints_are_stated(tmp_path, ending):
    """In millimetres and degrees as in metres and radians; numbers hardly meant are noted."""
    plain = np.array([[0.3, -0.2, 0.5, 0.1, 0.2, -3.0], [0.4, 0.1, 0.6, 0.3, -0.2, 1.0]])
    names = ["x_mm", "y_cm", "z_m", "roll_deg", "pitch_rad", "yaw_deg"]
    factors = [1000, 100, 1, 180 / np.pi, 1, 180 / np.pi]
    files = {}
    for name, head, rows in (
        ("plain", ["x", "y", "z", "roll", "pitch", "yaw"], plain),
        ("stated", names, plain * factors),
        ("wrong", ["x", "y", "z", "roll", "pitch", "yaw"], plain * factors),
    ):
        files[name] = tmp_path / f"{name}.{ending}"
        if ending == "json":
            text = json.dumps([dict(zip(head, row, strict=True)) for row in rows.tolist()])
        else:
            text = "\n".join(
                [",".join(head), *(",".join(map(repr, row)) for row in rows.tolist())]
            )
        files[name].write_text(text)
    read = {name: read_waypoints(path) for name, path in files.items()}
    np.testing.assert_allclose(read["stated"].positions, read["plain"].positions, rtol=1e-12)
    np.testing.assert_allclose(read["stated"].quaternions, read["plain"].quaternions, rtol=1e-9)
    assert read["stated"].notes == read["plain"].notes == ()
    assert [("millimetres" in note, "degrees" in note) for note in read["wrong"].notes] == [
        (True, False),
        (False, True),
    ]
    (tmp_path / "twice.csv").write_text("x,x_mm,y,z\n1,2,3,4\n1,2,3,5\n")
    with pytest.raises(InputError, match="columns of the waypoints"):
        read_waypoints(tmp_path / "twice.csv")


def test_limits_in_degrees_are_noted(made):
    chain = made.chain(made.offset_arm())
    assert not narrowed(chain, {"j1": (-1.0, 1.0)}).notes
    (note,) = narrowed(chain, {"j1": (-90.0, 90.0)}).notes
    assert "may be degrees: j1" in note


def test_waypoints_are_arrays_of_finite_numbers():
    assert ToolPath([[0, 0, 0], [1, 0, 0]], times=[0, 1]).positions.shape == (2, 3)
    turns = np.repeat([[0.0, 0, 0, 1]], 2, axis=0)
    for given, said in (
        (
            [np.zeros((2, 2))],
            r"positions is an array of shape \(2, 2\); allowed: shape \(W, 3\)",
        ),
        ([np.eye(3), turns], r"quaternions is .*; allowed: shape \(3, 4\)"),
        ([np.eye(3), None, [0.0, 1.0]], r"times is .*; allowed: shape \(3,\)"),
        ([[[0, 0, 0], [0, 0, np.nan]]], "largest of positions is nan; allowed: finite"),
        (["here"], "positions is"),
    ):
        with pytest.raises(InputError, match=said):
            ToolPath(*given)
