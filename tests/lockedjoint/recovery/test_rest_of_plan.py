"""From a plan to a recovery: where the arm is at a time, and what is left of its path."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import lockedjoint as lj
from lockedjoint.nlp.errors import InputError
from lockedjoint.paths.search import path

pytest.importorskip("toppra", reason="install toppra")

QUICK = lj.PathSearch(samples=12, tracks=8, rounds=1)
# A path with a corner, along which the arm waits at the second waypoint: x, y, z and t.
CORNER = "x,y,z,roll,pitch,yaw,t\n" + "".join(
    f"{place},0,1.5708,0,{time}\n"
    for place, time in (
        ("0.45,-0.15,0.3", 5),
        ("0.5,0.1,0.35", 9),
        ("0.5,0.1,0.35", 10),
        ("0.45,0.2,0.35", 13),
    )
)


@pytest.fixture(scope="module")
def plans(tmp_path_factory, lockedjoint):
    """The folder with the plans `rough`, which is not timed, `timed` and `positions`."""
    folder = tmp_path_factory.mktemp("plans")
    (folder / "way.csv").write_text(CORNER)
    common = "path example way.csv --effort samples=12 --effort rounds=1"
    for name, more in (
        ("rough", ""),
        ("timed", "--acceleration 2 --jerk 30 --corners stop --q 0,0.6,0,1.4,0,0.6,0"),
        ("positions", "--task position --effort tracks=8"),
        ("line", "--task vx,vy,vz,wx,wy --effort tracks=8"),
    ):
        line = f"{common} {more} --out-dir {name}"
        done = lockedjoint.here(*line.split(), cwd=folder)
        assert done.returncode == 0, done.stderr
    return folder


def content(folder, name):
    return json.loads((folder / name / "path.json").read_text())


def test_at_a_sample_the_arm_is_where_the_plan_has_it(plans):
    plan, saved = lj.read_plan(plans / "rough/path.json"), content(plans, "rough")
    for k, time in enumerate(saved["times"][:-1]):
        rest = plan.after(time)
        expected = saved["trajectory"]["configurations"][k]
        np.testing.assert_allclose(list(rest.q.values()), expected, atol=1e-12)
        assert rest.place == saved["places"][k]
        tool, turn = lj.Robot("example").chain.tip_at(np.array(expected)[:, None])
        np.testing.assert_allclose(rest.path.positions[0], tool[:, 0], atol=2e-5)
        off = Rotation.from_quat(rest.path.quaternions[0]).inv() * Rotation.from_matrix(
            turn[:, :, 0]
        )
        assert off.magnitude() < 2e-5
        np.testing.assert_allclose(rest.path.positions[-1], [0.45, 0.2, 0.35])


def test_between_samples_joints_move_evenly_and_waypoints_behind_are_gone(plans):
    plan, saved = lj.read_plan(plans / "rough/path.json"), content(plans, "rough")
    two = saved["times"][1:3]
    rest = plan.after(0.25 * two[0] + 0.75 * two[1])
    first, second = np.array(saved["trajectory"]["configurations"][1:3])
    np.testing.assert_allclose(list(rest.q.values()), 0.25 * first + 0.75 * second)
    # The tool waits at a waypoint, which is one place of the rest.
    assert len(plan.after(7.0).path.positions) == 3
    np.testing.assert_allclose(plan.after(7.0).path.positions[0], [0.475, -0.025, 0.325])
    for waiting in (9.0, 9.5):
        np.testing.assert_allclose(
            plan.after(waiting).path.positions, [[0.5, 0.1, 0.35], [0.45, 0.2, 0.35]]
        )
    assert len(plan.after(11.5).path.positions) == 2
    assert str(plan.after(5.0)) == "at 5 s of path.csv, at waypoint 1"


def test_a_timed_plan_has_its_own_times(plans):
    plan, saved = lj.read_plan(plans / "timed/path.json"), content(plans, "timed")
    run = saved["timed"]
    assert plan.clock == "trajectory.csv"
    places = np.array(run["places"])
    before = np.array(run["times"]) <= run["begins"] + 1e-9
    assert np.all(places[before] == 1)
    assert np.all(np.diff(places) >= 0)
    assert places[-1] == pytest.approx(4)
    # At the places of samples the arm is where the plan has it at these samples.
    samples = np.array(saved["trajectory"]["configurations"])
    for column, along in zip(np.array(run["positions"]).T, samples.T, strict=True):
        on = ~before
        there = np.interp(places[on], saved["places"], along)
        np.testing.assert_allclose(column[on], there, atol=0.05)
        for place, value in zip(saved["places"], along, strict=True):
            k = np.argmin(np.abs(places - place) + before)
            if abs(places[k] - place) < 1e-4:
                assert column[k] == pytest.approx(value, abs=1e-3)
    # On the way to the path all of it is left.
    rest = plan.after(run["begins"] / 2)
    assert len(rest.path.positions) == 3
    assert str(rest).endswith("s of trajectory.csv, on the way to waypoint 1")
    np.testing.assert_allclose(list(plan.after(0.0).q.values()), [0, 0.6, 0, 1.4, 0, 0.6, 0])
    # Between points joints go on as a controller does: by both positions and their rates.
    k = len(run["times"]) // 2
    for share in (0.2, 0.6):
        here, there = run["times"][k], run["times"][k + 1]
        now = here + share * (there - here)
        speed = (np.array(run["positions"][k + 1]) - run["positions"][k]) / (there - here)
        expected = np.array(run["positions"][k]) + speed * (now - here)
        np.testing.assert_allclose(list(plan.after(now).q.values()), expected, atol=1e-4)


@pytest.mark.parametrize("name", ["rough", "timed"])
def test_what_the_plan_survives_is_recovered(plans, lockedjoint, name):
    """The failures of the last third of the path that the plan survives, one a joint."""
    saved = content(plans, name)
    k = 2 * len(saved["times"]) // 3
    time, place = saved["times"][k], saved["places"][k]
    if name == "timed":
        time = float(np.interp(place, saved["timed"]["places"], saved["timed"]["times"]))
    joints = [row["joint"] for row in saved["joints"]]
    ends = saved["trajectory"]["ends_at"][k]
    survived = [joint for joint, end in zip(joints, ends, strict=True) if end == 13]
    assert len(survived) >= 3
    for joint in survived[:3]:
        line = f"recover example --waypoints {name}/path.json@{time} --locked {joint} --json"
        done = lockedjoint.here(*line.split(), cwd=plans)
        assert done.returncode == 0, done.stderr
        values = json.loads(done.stdout)
        assert values["verdict"] == "trajectory"
        assert values["plan"]["place"] == pytest.approx(place)
        tool = values["trajectory"]["tool"]
        np.testing.assert_allclose(tool[-1][:3], [0.45, 0.2, 0.35], atol=1e-4)
        start = values["trajectory"]["positions"][0]
        np.testing.assert_allclose(start, list(values["plan"]["q"].values()), atol=1e-9)


def test_the_function_takes_what_is_left_of_a_plan(plans):
    plan = path("example", plans / "way.csv", replace(QUICK, samples=8))
    rest = plan.after(11.5)
    assert str(rest) == "at 11.5 s of the plan, on the path between waypoints 3 and 4"
    answer = lj.recover("example", None, lj.Locked("wrist_roll"), rest, starts=60)
    same = lj.recover("example", rest.q, lj.Locked("wrist_roll"), rest.path, starts=60)
    assert answer.verdict == same.verdict
    assert answer.tried == same.tried
    with pytest.raises(InputError, match=r"q is .*; allowed: None with the rest of a plan"):
        lj.recover("example", rest.q, lj.Locked("wrist_roll"), rest)
    with pytest.raises(InputError, match=r"after is 13 s; .* from 5 to below 13 s \(the plan"):
        plan.after(13)
    with pytest.raises(InputError, match="after is 4"):
        plan.after("4")


def test_a_plan_that_keeps_positions_leaves_positions(plans):
    rest = lj.read_plan(plans / "positions/path.json").after(11.0)
    assert not rest.path.has_orientation
    answer = lj.recover("example", None, lj.Locked("elbow"), rest)
    assert answer.verdict == "trajectory"


def test_a_joint_that_had_locked_before_still_is(plans, lockedjoint, tmp_path):
    line = "path example way.csv --task position --locked wrist_roll=0.3 --out-dir"
    line = [*line.split(), str(tmp_path), "--effort=samples=6", "--effort=tracks=8"]
    assert lockedjoint.here(*line, cwd=plans).returncode == 0
    line = f"recover example --waypoints {tmp_path}/path.json@11 --locked elbow --json"
    done = lockedjoint.here(*line.split(), cwd=plans)
    assert done.returncode == 0, done.stderr
    run = json.loads(done.stdout)["trajectory"]
    positions = np.array(run["positions"])[:, run["joints"].index("wrist_roll")]
    np.testing.assert_allclose(positions, 0.3, atol=1e-12)
    moved = [*line.split(), "--locked", "wrist_roll=0.4"]
    done = lockedjoint.here(*moved, cwd=plans)
    assert done.returncode == 2
    assert "wrist_roll at the start is 0.3 rad; allowed: 0.4 rad" in done.stderr
    # In Python the robot may have locked it.
    robot = lj.Robot("example", locked={"wrist_roll": 0.3})
    rest = lj.read_plan(tmp_path / "path.json").after(11.0)
    assert lj.recover(robot, None, lj.Locked("elbow"), rest).verdict == "trajectory"
    with pytest.raises(InputError, match="wrist_roll"):
        lj.recover(robot.changed(locked={"wrist_roll": 0.2}), None, lj.Locked("elbow"), rest)


REFUSED = {
    "@7 --q=0,0,0,0,0,0,0": r"--q is 0,0,0,0,0,0,0; allowed: none with the rest of a plan",
    "@7 --at=0.4,0,0.3": "--at is given besides --waypoints; allowed: either",
    "@7 --tolerance=0.1": "--tolerance is .*; allowed: none with --waypoints",
    "@7 --task=position": "--task is position; allowed: none with --waypoints",
    "@4.9": r"after is 4.9 s; allowed: a time of the plan, from 5 to below 13 s \(path.csv\)",
    "@13": "after is 13 s; allowed: a time of the plan",
    "@1e30": "after is 1e.30 s; allowed: a time of the plan",
    "@nan": "after is nan; allowed: a time of the plan",
    "@": "--waypoints is rough/path.json@; allowed: FILE, or FILE@SECONDS with",
    "@soon": "--waypoints is rough/path.json@soon; allowed: FILE, or FILE@SECONDS with",
    "@7 --tip=upper_arm": "plan is of the joints .*; allowed: one of the joints of this robot",
    "@7 --tip=tool:0,0,0.1": "misses by 0.1 m and .* rad; allowed: one of this robot with base",
    "@7 --base=shoulder": "allowed: one of the joints of this robot",
}


@pytest.mark.parametrize("more", REFUSED)
def test_what_does_not_fit_a_plan_is_refused(plans, lockedjoint, more):
    line = f"recover example --locked elbow --waypoints rough/path.json{more}"
    done = lockedjoint.here(*line.split(), cwd=plans)
    assert done.returncode == 2
    assert done.stdout == ""
    (sentence,) = done.stderr.strip().splitlines()
    assert re.search(REFUSED[more], sentence), sentence


def test_a_file_whose_name_has_an_at_is_read(plans, lockedjoint):
    line = "x,y,z\n0.45,0.19,0.35\n0.45,0.2,0.35\n"
    (plans / "way@3").write_text(line)
    words = "recover example --q 0,0.6,0,1.4,0,0.6,0 --locked elbow --waypoints way@3"
    done = lockedjoint.here(*words.split(), cwd=plans)
    assert done.returncode == 0, done.stderr


def test_directions_that_recover_does_not_follow_are_refused(plans):
    with pytest.raises(InputError, match=r"task of the plan is vx,vy,vz,wx,wy; allowed: pos"):
        lj.read_plan(plans / "line/path.json")


def changed(saved, name, value):
    return {**saved, name: value}


FAULTS = {
    "a list": lambda saved: [saved],
    "no waypoints": lambda saved: changed(saved, "waypoints", []),
    "a waypoint of two numbers": lambda saved: changed(saved, "waypoints", [[0.1, 0.2]] * 4),
    "one waypoint fewer": lambda saved: changed(saved, "waypoints", saved["waypoints"][1:]),
    "a number too large": lambda saved: changed(saved, "waypoints", [[1e300, 0, 0]] * 4),
    "a name twice": lambda saved: changed(saved, "joints", [saved["joints"][0]] * 7),
    "times that fall": lambda saved: changed(saved, "times", saved["times"][::-1]),
    "places that fall": lambda saved: changed(saved, "places", saved["places"][::-1]),
    "too few times": lambda saved: changed(saved, "times", saved["times"][1:]),
    "a text": lambda saved: changed(saved, "times", "soon"),
    "another task": lambda saved: changed(saved, "task", ["up"]),
    "locked nowhere": lambda saved: changed(saved, "locked", {"elbow": "there"}),
    "locked at NaN": lambda saved: changed(saved, "locked", {"elbow": float("nan")}),
    "no trajectory": lambda saved: changed(saved, "trajectory", None),
    "NaN": lambda saved: changed(saved, "trajectory", {"configurations": [[np.nan] * 7] * 12}),
    "a timed part of nothing": lambda saved: changed(saved, "timed", {}),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_file_that_is_no_plan_is_refused(plans, tmp_path, fault):
    file = tmp_path / "path.json"
    file.write_text(json.dumps(FAULTS[fault](content(plans, "rough"))))
    with pytest.raises(InputError, match=r"plan is .*; allowed: the path.json that `path` wri"):
        lj.read_plan(file)
