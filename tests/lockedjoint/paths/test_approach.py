"""A path that begins where the arm stands: the way to the first waypoint, and what it keeps."""

import json

import numpy as np
import pytest

import lockedjoint as lj
from lockedjoint.nlp.errors import InputError
from lockedjoint.paths.approach import NoApproachError, approach
from lockedjoint.paths.connecting import Connector, SearchLimit
from lockedjoint.paths.path_search import PathSearch
from lockedjoint.paths.search import with_approach

QUICK = PathSearch(samples=5, tracks=4, rounds=1)
SLIDE = {"kind": "prismatic", "limit": 'lower="-1" upper="1" effort="1" velocity="1"'}


@pytest.fixture
def gantry(made, tmp_path):
    """A ball that three joints slide, and a wall that it can pass over."""
    kinds = {f"j{k}": SLIDE for k in range(3)}
    text = made.urdf(made.serial(["0 0 0"] * 3, ["1 0 0", "0 1 0", "0 0 1"], **kinds))
    text = made.with_shapes(text, [0], '<box size="0.2 1.9 0.4"/>')
    (tmp_path / "gantry.urdf").write_text(
        made.with_shapes(text, [3], '<sphere radius="0.05"/>')
    )
    return lj.Robot(tmp_path / "gantry.urdf", clearance=0.02)


def test_the_straight_way_is_taken_where_links_stay_apart(gantry):
    start, first = np.array([-0.5, 0.0, 0.5]), np.array([0.5, 0.0, 0.5])
    way = approach(gantry.chain, start, first, gantry.apart)
    np.testing.assert_allclose(way.configurations, [start, first])
    # The ball passes over the wall: 0.5 - 0.05 - 0.2.
    assert way.closest.distance == pytest.approx(0.25, abs=2e-3)
    assert way.closest.at_least <= 0.25 <= way.closest.distance + 1e-6
    assert way.closest.at_least == pytest.approx(0.25, abs=2e-3)
    assert "straight way of the joints" in str(way)


def test_a_way_leads_around_what_is_between(gantry):
    pytest.importorskip("ompl", reason="install ompl")
    start, first = np.array([-0.5, 0.0, 0.0]), np.array([0.5, 0.0, 0.0])
    way = approach(gantry.chain, start, first, gantry.apart)
    q = way.configurations
    np.testing.assert_allclose(q[[0, -1]], [start, first])
    assert len(q) > 2
    assert "links come too near on the straight one" in str(way)
    shares = np.linspace(0, 1, 200)[:, None, None]
    points = (q[:-1] + shares * np.diff(q, axis=0)).reshape(-1, 3)
    least = min(gantry.apart.closest(q, gantry.apart.pairs).distance for q in points)
    assert least >= 0.02 - 1e-5
    assert way.closest.at_least - 1e-9 <= least <= way.closest.distance + 2e-3
    free = approach(gantry.chain, start, first)
    assert len(free.configurations) == 2
    assert free.to_dict()["collisions"] == "not checked"


def test_no_way_is_said_and_is_no_success(gantry, monkeypatch):
    """Of an arm that cannot rise."""
    pytest.importorskip("ompl", reason="install ompl")
    monkeypatch.setattr("lockedjoint.paths.approach._MOST_SAMPLES", 30)
    low = gantry.changed(limits={"j2": (-0.1, 0.1)})
    start, first = np.array([-0.5, 0.0, 0.0]), np.array([0.5, 0.0, 0.0])
    with pytest.raises(NoApproachError, match=r"without a way to the first.*with 30 samples"):
        approach(low.chain, start, first, low.apart)
    assert NoApproachError.exit_status == 1


def test_how_long_a_way_is_looked_for_does_not_depend_on_the_clock(gantry, monkeypatch):
    """A number of samples ends the search, and one seed gives one way."""
    pytest.importorskip("ompl", reason="install ompl")
    asked = []
    whole = SearchLimit.condition

    def counted(limit):
        ends = whole(limit)
        return lambda: asked.append(ends()) or asked[-1]

    monkeypatch.setattr(SearchLimit, "condition", counted)
    low = gantry.changed(limits={"j2": (-0.1, 0.1)})
    start, first = np.array([-0.5, 0.0, 0.0]), np.array([0.5, 0.0, 0.0])
    assert (
        Connector(low.chain, low.apart).way(start, first[None], SearchLimit(samples=9), 0)
        is None
    )
    assert asked.count(False) == 9
    assert asked[-1] is True
    monkeypatch.setattr("time.monotonic", lambda: pytest.fail("the clock was read"))
    ways = [approach(gantry.chain, start, first, gantry.apart).configurations for _ in "ab"]
    np.testing.assert_array_equal(*ways)


def test_joints_without_limits_go_the_short_way(made, tmp_path):
    """The whole plan turns with them, and is the same path of the tool."""
    kinds = {f"j{k}": {"kind": "continuous"} for k in (0, 3)}
    joints = made.serial(["0.1 0.05 0.3"] * 5, made.AXES[:5], **kinds)
    text = made.urdf([*joints, made.joint("mount", "l5", "tool", "fixed")])
    (tmp_path / "arm.urdf").write_text(text)
    robot = lj.Robot(tmp_path / "arm.urdf", tip="tool", task="position")
    begin = robot.chain.tip_at(np.array([[0.3, 0.5, -0.2, 0.6, 0.1]]).T)[0][:, 0]
    way = lj.ToolPath(np.stack([begin, begin + [0, 0.1, 0]]))
    found = lj.path(robot, way, QUICK)
    plain = found.planned
    turns = 2 * np.pi * np.array([2, 0, 0, -1, 0])
    near = np.array([0.1, 0.0, 0.1, -0.1, 0.0])
    plan = with_approach(found, robot, plain.configurations[0] + turns + near, (), 0)
    assert plan.approach.largest_motion == pytest.approx(0.1)
    np.testing.assert_allclose(plan.planned.configurations, plain.configurations + turns)
    np.testing.assert_array_equal(
        plan.approach.configurations[-1], plan.planned.configurations[0]
    )
    np.testing.assert_array_equal(plan.planned.ends, plain.ends)
    places = [robot.chain.tip_at(each.configurations.T)[0] for each in (plain, plan.planned)]
    np.testing.assert_allclose(*places, atol=1e-12)


@pytest.fixture
def folder(made, tmp_path):
    joints = made.serial(["0.1 0.05 0.3"] * 5, made.AXES[:5])
    joints += [made.joint("finger", "l5", "f"), made.joint("mount", "l5", "tool", "fixed")]
    text = made.urdf(joints)
    (tmp_path / "arm.urdf").write_text(text)
    arm = made.arm(text, "tool", "position")
    q = np.array([0.3, 0.5, -0.2, 0.6, 0.1])
    begin = arm.chain.tip_at(q[:, None])[0][:, 0]
    lines = [",".join(map(str, (begin + shift).tolist())) for shift in (0, np.r_[0, 0.1, 0])]
    (tmp_path / "w.csv").write_text("x,y,z\n" + "\n".join(lines))
    state = {"name": ["finger", *(f"j{k}" for k in range(5))], "position": [0.5, *q.tolist()]}
    (tmp_path / "state.yaml").write_text(json.dumps(state))
    return tmp_path, q


def test_a_plan_begins_where_the_arm_stands(folder):
    place, q = folder
    robot = lj.Robot(place / "arm.urdf", tip="tool")
    plain = lj.path(robot, place / "w.csv", QUICK)
    plan = lj.path(robot, place / "w.csv", QUICK, q=str(place / "state.yaml"))
    assert plain.approach is None
    np.testing.assert_array_equal(plan.planned.configurations, plain.planned.configurations)
    np.testing.assert_allclose(plan.approach.configurations[0], q)
    np.testing.assert_array_equal(
        plan.approach.configurations[-1], plan.planned.configurations[0]
    )
    assert "finger" in plan.approach.notes[0]
    there = lj.path(robot, place / "w.csv", QUICK, q=plain.planned.configurations[0])
    assert len(there.approach.configurations) == 1
    assert there.approach.largest_motion == 0.0
    with pytest.raises(InputError, match="j0"):
        lj.path(robot, place / "w.csv", QUICK, q=[9, 0, 0, 0, 0])
    # Artificial limits hold on the way to the path, too.
    with pytest.raises(InputError, match=r"joint j2 is -0.2 rad; allowed: within \[-0.1, 2"):
        lj.path(robot, place / "w.csv", QUICK, q=q, limits={"j2": (-0.1, 2)})


def test_the_command_times_both_as_one(folder, lockedjoint):
    pytest.importorskip("toppra", reason="install toppra")
    place, q = folder
    line = "path arm.urdf w.csv --tip tool --effort samples=6 --effort tracks=4"
    line += " --effort rounds=1 --q state.yaml --acceleration 2 --jerk 50 --out-dir done"
    done = lockedjoint.here(*line.split(), cwd=place)
    assert done.returncode == 0, done.stderr
    assert "finger" in done.stderr
    assert "straight way of the joints" in " ".join(done.stdout.split())
    written = json.loads((place / "done/path.json").read_text())
    run = json.loads((place / "done/trajectory.json").read_text())
    np.testing.assert_allclose(run["positions"][0], q, atol=1e-9)
    begins = int(np.argmin(np.abs(np.array(run["times"]) - run["begins"])))
    first = written["trajectory"]["configurations"][0]
    np.testing.assert_allclose(run["positions"][begins], first, atol=1e-9)
    np.testing.assert_allclose(run["velocities"][begins], 0, atol=1e-9)
    assert max(run["speed"], run["acceleration"], run["jerk"]) <= 1 + 1e-9
    assert written["approach"]["configurations"][0] == q.tolist()


@pytest.mark.parametrize(
    ("corners", "samples", "said"),
    [
        ("blend", 5, "--effort samples=, or --corners stop."),
        ("stop", 3, "--effort samples=."),
        ("stop", 60, None),
    ],
)
def test_a_timed_tool_that_is_far_from_the_path_is_noted(
    folder, lockedjoint, corners, samples, said
):
    pytest.importorskip("toppra", reason="install toppra")
    place, _ = folder
    first = [float(number) for number in (place / "w.csv").read_text().split()[1].split(",")]
    ways = [[0, 0, 0], [0, 0.1, 0], [0, 0.1, -0.1]]
    lines = [",".join(map(str, np.add(first, way).tolist())) for way in ways]
    (place / "w.csv").write_text("x,y,z\n" + "\n".join(lines))
    line = "path arm.urdf w.csv --tip tool --effort tracks=4 --effort rounds=0 --json"
    line += f" --acceleration 2 --corners {corners} --effort samples={samples}"
    done = lockedjoint.here(*line.split(), cwd=place)
    assert done.returncode == 0, done.stderr
    off_mm = 1000 * json.loads(done.stdout)["timed"]["off_path"]
    assert (off_mm > 1) == (said is not None)
    notes = [one for one in done.stderr.splitlines() if "mm off the path" in one]
    if said is None:
        assert not notes
    else:
        (note,) = notes
        assert f"{off_mm:.2g} mm off the path" in note
        assert note.endswith(said)
