"""Degrees and millimetres can be stated, and numbers that can hardly be meant are noted."""

import json

import numpy as np
import pytest

import lockedjoint as lj
from lockedjoint.commands.app import app
from lockedjoint.commands.vocabulary import OF_JOINTS, WORDS
from lockedjoint.kinematics.read_dh_table import dh_tree
from lockedjoint.paths.waypoints import read_pose
from tests import made_robots as made

DEGREES = np.pi / 180
SLIDES = {"kind": "prismatic", "limit": 'lower="-0.2" upper="0.3"'}
OFFSETS = ["0.1 0 0.2", "0 0.1 0.1", "0.2 0 0", "0 0 0.25", "0 0 0.2"]


@pytest.fixture(scope="module")
def text():
    """An arm of four revolute joints and one that slides, the third."""
    joints = made.serial(OFFSETS, made.AXES[:5], j2=SLIDES)
    return made.urdf([*joints, made.joint("end", "l5", "l6", "fixed", xyz="0.1 0 0.1")])


@pytest.fixture(scope="module")
def robot(text):
    return lj.Robot(made.tree(text), task="position")


@pytest.fixture
def folder(text, tmp_path):
    (tmp_path / "arm.urdf").write_text(text)
    return tmp_path


IN_DEGREES = np.array([10.0, -20.0, 0.1, 30.0, 40.0])
IN_RADIANS = IN_DEGREES * [DEGREES, DEGREES, 1.0, DEGREES, DEGREES]
NAMED = dict(zip(("j0", "j1", "j2", "j3", "j4"), IN_DEGREES.tolist(), strict=True))


@pytest.mark.parametrize(
    "stated",
    [
        IN_DEGREES,
        NAMED,
        ",".join(map(str, IN_DEGREES)),
        ",".join(f"{k}={v}" for k, v in NAMED.items()),
    ],
)
def test_a_configuration_in_degrees(robot, stated):
    point, notes = robot.configuration(lj.InDegrees(stated))
    np.testing.assert_allclose(point, IN_RADIANS)
    assert notes == ()
    measured = lj.measure(robot, lj.InDegrees(stated))
    assert measured.worst_case_sigma == lj.measure(robot, point).worst_case_sigma


def test_files_and_states_keep_their_own_unit(robot, tmp_path):
    file = tmp_path / "q.json"
    file.write_text(json.dumps(IN_RADIANS.tolist()))
    for stated in (str(file), lj.InDegrees(str(file))):
        np.testing.assert_allclose(robot.configuration(stated)[0], IN_RADIANS)
    file.write_text(json.dumps({"angles": "deg", "q": NAMED}))
    np.testing.assert_allclose(robot.configuration(str(file))[0], IN_RADIANS)
    file.write_text(json.dumps({"angles": "grad", "q": NAMED}))
    with pytest.raises(lj.InputError, match="rad or deg"):
        robot.configuration(str(file))
    known = robot.changed(states={"up": dict(zip(NAMED, IN_RADIANS, strict=True))})
    np.testing.assert_allclose(known.configuration(lj.InDegrees("up"))[0], IN_RADIANS)


def test_limits_and_locked_joints_in_degrees(robot):
    changed = robot.changed(
        locked=lj.InDegrees({"j4": 40.0}),
        limits=lj.InDegrees({"j1": (-30.0, 30.0), "j2": (-0.1, 0.1)}),
    )
    assert dict(changed.chain.locked_at) == {"j4": pytest.approx(40 * DEGREES)}
    by_name = {joint.name: joint for joint in changed.chain.joints}
    assert by_name["j1"].upper == pytest.approx(30 * DEGREES)
    assert by_name["j2"].upper == 0.1
    assert changed.changed(task="all").chain == changed.chain  # converted once
    # Of a joint that slides and has locked, too.
    still = robot.changed(locked=lj.InDegrees({"j2": 0.1}))
    np.testing.assert_allclose(
        still.configuration(lj.InDegrees(NAMED))[0], np.delete(IN_RADIANS, 2)
    )


def test_a_pose_in_degrees():
    ours = read_pose("0.3,0.4,1,10,20,90", "deg")
    angles = ",".join(str(x * DEGREES) for x in (10, 20, 90))
    theirs = read_pose(f"0.3,0.4,1,{angles}")
    np.testing.assert_allclose(ours.rotation, theirs.rotation, atol=1e-12)
    same = "0.3,0.4,1,0,0,0,1"
    assert read_pose(same, "deg") == read_pose(same)
    assert read_pose("0.3,0.4,1", "deg") == read_pose("0.3,0.4,1")


@pytest.mark.parametrize(
    ("text", "words"),
    [("300,400,1000", "millimetres"), ("0.3,0.4,1,0,45,0", "degrees")],
)
def test_a_pose_that_can_hardly_be_meant_is_noted(text, words):
    pose = read_pose(text)
    assert words in " ".join(pose.notes)
    assert pose.within([0.01]).notes == pose.notes
    assert read_pose("0.3,0.4,1,0,4.5,0").notes == ()


def test_positions_that_can_hardly_be_meant_are_noted():
    free = {f"j{k}": {"kind": "continuous"} for k in range(4)}
    robot = lj.Robot(made.tree(made.urdf(made.serial(OFFSETS[:4], made.AXES[:4], **free))))
    (note,) = robot.configuration([0.0, 30.0, 0.5, -90.0])[1]
    assert "j1 at 30, j3 at -90" in note
    assert robot.configuration([0.0, 6.0, 0.5, -6.0])[1] == ()


SAME = [
    "measure arm.urdf --task position --q {q}",
    "measure arm.urdf --task position --locked j0={j0} --q {rest}",
    "recover arm.urdf --task position --q {q} --locked j0 --at 0.35,0.2,0.8",
    "recover arm.urdf --q {q} --reduced j1={low}:{high} --at 0.35,0.2,0.8 --task position",
]


@pytest.mark.parametrize("line", SAME)
def test_commands_take_degrees(line, folder, lockedjoint):
    said = []
    for values, unit in ((IN_RADIANS, "rad"), (IN_DEGREES, "deg")):
        low, high = (-25, 25) if unit == "deg" else (-25 * DEGREES, 25 * DEGREES)
        q = ",".join(map(repr, values.tolist()))
        rest = ",".join(f"j{k}={float(values[k])!r}" for k in range(1, 5))
        given = line.format(q=q, rest=rest, j0=repr(float(values[0])), low=low, high=high)
        done = lockedjoint.here(*given.split(), "--angles", unit, "--json", cwd=folder)
        assert done.returncode in (0, 1), done.stderr
        found = json.loads(done.stdout)
        said.append(found.get("worst_case_sigma", found.get("verdict")))
    assert (
        said[0] == pytest.approx(said[1]) if isinstance(said[0], float) else said[0] == said[1]
    )


def test_every_command_with_angles_takes_the_option():
    """And no other."""
    angled = {*OF_JOINTS, *(name for name, word in WORDS.items() if word.in_degrees)}
    seen = 0
    for name in app.list_commands(None):
        command = app.get_command(None, name)
        for one in (command, *getattr(command, "commands", {}).values()):
            own = {parameter.name for parameter in one.params}
            assert ("angles" in own) == bool(own & angled), one.name
            seen += "angles" in own
    assert seen >= 8


TABLE = """# convention: standard
kind,a{a},d{d},alpha{u},theta{u}
R,{x},{y},{half},0
R,{x},0,0,0
"""


def test_tables_in_millimetres():
    metres = dh_tree(TABLE.format(a="", d="_m", u="_rad", x=0.3, y=0.2, half=0.5).encode())
    for ending, factor in (("_mm", 1000), ("_cm", 100)):
        other = dh_tree(
            TABLE.format(
                a=ending, d=ending, u="_rad", x=0.3 * factor, y=0.2 * factor, half=0.5
            ).encode()
        )
        for ours, theirs in zip(other.joints, metres.joints, strict=True):
            np.testing.assert_allclose(ours.origin, theirs.origin, atol=1e-12)
        assert other.remarks == ()
    twice = "# convention: standard\nkind,a,a_mm,d,alpha_rad,theta_rad\nR,1,1,1,1,1\n"
    with pytest.raises(lj.InputError, match="column a"):
        dh_tree(twice.encode())


def test_entries_of_tables_that_can_hardly_be_meant_are_noted():
    large = dh_tree(TABLE.format(a="", d="", u="_rad", x=300, y=0, half=90).encode())
    lengths, angles = large.remarks
    assert "millimetres" in lengths
    assert "a of row 1, a of row 2" in lengths
    assert "degrees" in angles
    assert "alpha_rad of row 1" in angles
    assert set(large.remarks) <= set(lj.Robot(large).chain.notes)
    stated = dh_tree(TABLE.format(a="_mm", d="_mm", u="_deg", x=300, y=0, half=90).encode())
    assert stated.remarks == ()


def test_degrees_of_a_slider_that_cannot_move_are_metres():
    """Where a joint has locked before, `recover` reads the configuration as `measure` does."""
    text = made.urdf(made.serial(["0.3 0 0"] * 5, made.AXES[:5], j0=SLIDES))
    robot = lj.Robot(made.tree(text), tip="l5", task="vx,vy", locked={"j0": 0.1})
    q = lj.InDegrees({"j0": 0.1, "j1": 10, "j2": 20, "j3": 30, "j4": 40})
    goal = lj.Pose((0.6, 0.2, 0.5))
    told, radians = (
        lj.recover(robot, one, lj.Locked("j2"), goal, starts=5, boxes=10, time_limit=5.0)
        for one in (q, {n: v if n == "j0" else np.radians(v) for n, v in q.stated.items()})
    )
    assert told.verdict == radians.verdict


@pytest.mark.parametrize("unit", ["deg", "rad"])
def test_a_joint_state_states_its_unit(unit, tmp_path):
    robot = lj.Robot(
        made.tree(made.urdf(made.serial(["0.3 0 0"] * 4, made.AXES[:4]))),
        tip="l4",
        task="vx,vy",
    )
    file = tmp_path / "state.json"
    state = {"angles": unit, "name": list(robot.chain.names), "position": [0.1, 0.2, 0.3, 0.4]}
    file.write_text(json.dumps(state))
    scale = np.pi / 180 if unit == "deg" else 1.0
    assert robot.configuration(str(file))[0] == pytest.approx(
        scale * np.array(state["position"])
    )
    file.write_text(json.dumps({**state, "angles": ["deg"]}))
    with pytest.raises(lj.InputError, match="rad or deg"):
        robot.configuration(str(file))


def test_locked_positions_that_can_hardly_be_meant_are_noted():
    limit = 'lower="-100" upper="100" effort="1" velocity="1"'
    tree = made.tree(
        made.urdf(made.serial(["0.3 0 0"] * 5, made.AXES[:5], j4={"limit": limit}))
    )
    robot = lj.Robot(tree, tip="l5", task="vx,vy", locked={"j4": 90.0})
    assert any("may be degrees: j4 at 90" in note for note in robot.chain.notes)


def test_positions_in_messages_say_their_unit(folder, lockedjoint):
    """Also after they were stated in degrees."""
    for q, said in (
        ("10,-200,0.1,30,40", "joint j1 is -3.490659 rad; allowed: within [-2, 2] rad"),
        ("10,-20,30,30,40", "joint j2 is 30 m; allowed: within [-0.2, 0.3] m"),
    ):
        line = ["measure", "arm.urdf", "--task", "position", f"--q={q}", "--angles", "deg"]
        done = lockedjoint.here(*line, cwd=folder)
        assert done.returncode == 2
        assert said in done.stderr


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("measure arm.urdf --task position", ("q (rad or m)", "characteristic length (m)")),
        ("recover arm.urdf --locked j0 --at 0.35,0.2,0.8 --task position", ("(rad or m)",)),
        ("recover arm.urdf --locked j0 --at 9,0,0 --task position", ("nearest q (rad or m)",)),
        ("workspace arm.urdf --effort voxel=0.5", ("limits of j1 (rad)", "limits of j2 (m)")),
    ],
)
def test_what_is_printed_says_its_unit(line, said, folder, lockedjoint):
    done = lockedjoint.here(*line.split(), "--angles", "deg", cwd=folder)
    for words in said:
        assert words in done.stdout, done.stderr


def test_a_configuration_that_is_written_says_its_unit(folder, lockedjoint):
    line = "measure arm.urdf --task position --q 10,-20,0.1,30,40 --angles deg --out q.json"
    assert lockedjoint.here(*line.split(), cwd=folder).returncode == 0
    assert json.loads((folder / "q.json").read_text())["angles"] == "rad"
    again = "measure arm.urdf --task position --q q.json --angles deg --json"
    found = json.loads(lockedjoint.here(*again.split(), cwd=folder).stdout)
    np.testing.assert_allclose(list(found["q"].values()), IN_RADIANS)


def test_angles_of_obstacles_and_orientations_that_can_hardly_be_meant(folder, lockedjoint):
    (folder / "wall.urdf").write_text(
        '<robot name="wall"><link name="wall"><collision><origin xyz="9 9 9"/><geometry>'
        '<box size="1 1 1"/></geometry></collision></link></robot>'
    )
    read = WORDS["obstacles"].read("--obstacles", f"{folder}/wall.urdf@1,2,3,0,0,90")
    assert "degrees" in read.notes[0]
    robot = lj.Robot(folder / "arm.urdf", obstacles=read)
    assert any("wall.urdf" in note and "degrees" in note for note in robot.chain.notes)
    assert WORDS["obstacles"].read("--obstacles", f"{folder}/wall.urdf@1,2,3,0,0,3").notes == ()
    (folder / "flat.urdf").write_text(made.planar_urdf([0.5, 0.4, 0.3, 0.2]))
    line = "workspace flat.urdf --effort voxel=0.5 --effort slice_degrees=45 --orientation 0,0,"
    for angles, noted in (("45", True), ("0.5", False)):
        done = lockedjoint.here(*f"{line}{angles}".split(), cwd=folder)
        assert ("--orientation beyond two turns" in done.stderr) == noted, done.stderr
        how = {"voxel": 0.5, "slice_degrees": 45}
        stated = np.array([0, 0, float(angles)])
        notes = lj.workspace(folder / "flat.urdf", orientation=stated, **how).notes
        assert any("orientation beyond two turns" in note for note in notes) == noted


@pytest.mark.parametrize(
    ("line", "asked"),
    [
        ("--q=0,-20,0.1,30,40", True),
        ("--q=j0=0,j1=-20,j2=0.1,j3=30,j4=40", True),
        ("--locked j3=120", True),
        ("--q=0,-4,0.1,0,0", False),  # outside, but an angle that radians may have
        ("--q=0,0,30,0,0", False),  # metres
        ("--q=0,-2000,0.1,0,0 --angles deg", False),
    ],
)
def test_a_refused_angle_asks_for_degrees(line, asked, folder, lockedjoint):
    words = ("measure", "arm.urdf", "--task", "vx,vy", *line.split())
    done = lockedjoint.here(*words, cwd=folder)
    assert done.returncode == 2
    assert "allowed: within" in done.stderr
    assert ("in degrees? --angles deg" in done.stderr) == asked, done.stderr


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("measure example --locked elbow=800", "joint elbow is 13.96263 rad; allowed:"),
        ("measure example --q 0,0,0,300,0,0,0", "joint elbow is 5.235988 rad; allowed:"),
        ("posture example --locked elbow=-800", "joint elbow is -13.96263 rad; allowed:"),
        (
            "recover example --locked elbow=800 --at 1,0,0",
            "joint elbow is 13.96263 rad; all",
        ),
        (
            "recover example --reduced elbow=500:900 --at 1,0,0",
            "range of elbow is [8.7",
        ),
        (
            "workspace example --limits elbow=-800:800",
            "limits of elbow is [-13.96",
        ),
        (
            "path example way.csv --limits elbow=500:900",
            "limits of elbow is [8.7",
        ),
    ],
)
def test_what_was_stated_in_degrees_is_refused_in_both_units(line, said, folder, lockedjoint):
    """Nobody is asked for degrees who has stated them."""
    (folder / "way.csv").write_text("x,y,z\n0.45,-0.15,0.3\n0.5,0.2,0.35\n")
    words = line.split()
    done = lockedjoint.here(*words, "--angles", "deg", cwd=folder)
    assert done.returncode == 2
    assert said in done.stderr
    assert "[-0.4, 2.4] rad, which is [-22.91831, 137.5099]°." in done.stderr
    assert "degrees" not in done.stderr
    same = lockedjoint.here(*words, cwd=folder)
    assert same.returncode == 2
    assert "[-0.4, 2.4] rad" in same.stderr


@pytest.mark.parametrize(
    ("line", "radians", "degrees"),
    [
        ("path example way.csv --effort samples=6 --limits elbow=", "-800:800", "-800:800"),
        (
            "recover example --q 0,0,0,0.1,0,0,0 --at 0.5,0.2,0.4 --reduced elbow=",
            "-9:9",
            "-800:900",
        ),
        ("measure endless.urdf --task vx,vy --locked j0=", "900", "900"),
        ("workspace endless.urdf --effort voxel=0.5 --orientation=", "0,0,14", "0,0,800"),
    ],
)
def test_only_large_radians_are_noted(line, radians, degrees, folder, made, lockedjoint):
    """Limits beyond the robot's own, a joint without limits, an orientation."""
    (folder / "way.csv").write_text("x,y,z\n0.45,-0.15,0.3\n0.5,0.2,0.35\n")
    text = made.planar_urdf([0.5, 0.4, 0.3, 0.2], "").replace('"revolute"', '"continuous"')
    (folder / "endless.urdf").write_text(text)
    for unit, value, noted in (("rad", radians, True), ("deg", degrees, False)):
        done = lockedjoint.here(*f"{line}{value}".split(), "--angles", unit, cwd=folder)
        assert done.returncode in (0, 1), done.stderr
        assert done.stdout
        assert ("may be degrees" in done.stderr) == noted, (unit, done.stderr)


@pytest.mark.parametrize(("x", "asked"), [(450, True), (15, False)])
def test_a_place_out_of_reach_asks_for_millimetres(x, asked, folder, lockedjoint):
    (folder / "way.csv").write_text(f"x,y,z\n{x},0.1,0.3\n{x},0.2,0.3\n")
    for words, remedy in (
        (("path", "arm.urdf", "way.csv"), "name the column x_mm"),
        (("posture", "arm.urdf", "--task", "position", f"--at={x},0.1,0.3"), "a JSON file"),
    ):
        done = lockedjoint.here(*words, cwd=folder)
        assert done.returncode == 2
        assert "out of reach" in done.stderr
        found = "in millimetres?" in done.stderr and remedy in done.stderr
        assert found == asked, done.stderr
