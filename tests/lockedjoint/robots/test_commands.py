"""measure and posture as a stranger meets them."""

import json

import numpy as np
import pinocchio as pin
import pytest

from lockedjoint.formulations import measures
from lockedjoint.paths.waypoints import read_pose


@pytest.fixture
def robot(made, tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(made.offset_arm())
    return path


def test_posture_then_assess_then_measure(lockedjoint, robot, tmp_path):
    found = lockedjoint.here(
        "posture", robot, "--starts", 3, "--out", "here/best.json", cwd=tmp_path
    )
    assert found.returncode == 0, found.stderr
    assert "worst case sigma" in found.stdout
    best = json.loads((tmp_path / "here/best.json").read_text())
    sigma = pytest.approx(best["worst_case_sigma"], abs=1e-12)
    assert measures.worst_case_sigma(np.array(best["jacobian"])) == sigma
    for words in (("measure", robot, "--q"), ("measure",)):
        again = lockedjoint.json(*words, "here/best.json", cwd=tmp_path)
        assert again["worst_case_sigma"] == sigma


def test_assess_shows_everything_that_was_asked_for(lockedjoint, robot, tmp_path):
    done = lockedjoint.here(
        *("measure", robot, "--length", 0.4, "--task", "tip:vx,vy,wz"),
        *("--locked", "j1=0.5", "--failures", 2, "--out", "a.json"),
        *("--q", "j0=0.1,j2=0,j3=0,j4=-1,j5=0,j6=0", "--base", "l0", "--tip", "l7:0,0,0.1"),
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "a.json").read_text())
    assert found["characteristic_length"] == 0.4
    assert (found["locked"], found["task"]) == ({"j1": 0.5}, ["vx", "vy", "wz"])
    assert np.array(found["jacobian"]).shape == (3, 6)
    assert len(found["by_failure"]) == 15
    assert f"and {15 - 12} failures" in done.stdout


@pytest.mark.parametrize(
    "columns", ["kind,a,d,alpha_rad,theta_rad", "A, D_mm,Alpha_deg,theta_deg"]
)
def test_a_table_without_a_convention_is_no_jacobian(lockedjoint, columns, tmp_path):
    row = ",".join("0" for _ in columns.split(","))
    (tmp_path / "arm.csv").write_text(f"# my arm\n{columns}\n{row}\n{row}\n")
    done = lockedjoint.here("measure", "arm.csv", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(
        "Error: arm.csv: convention is missing; allowed: a line '# conv"
    )


def test_a_measure_loads_no_scipy(lockedjoint, robot):
    """It would take half of the time of the command."""
    lockedjoint.python(
        "import sys, lockedjoint as lj\n"
        f"print(lj.measure({str(robot)!r}))\n"
        "loaded = [name for name in sys.modules if name.startswith('scipy')]\n"
        "assert not loaded, loaded\n"
    )


def test_what_is_suspicious_is_a_note(lockedjoint, made, tmp_path):
    """On standard error, and in the result; the posture that is found has the same columns."""
    limits = {"j1": {"limit": 'lower="-170" upper="170"'}}
    limits["j3"] = {"limit": 'lower="0.5" upper="0.5"'}
    joints = made.serial(["0.1 0.05 0.3"] * 5, made.AXES[:5], **limits)
    (tmp_path / "robot.urdf").write_text(made.urdf(joints))
    search = ("--starts", 2, "--workers", 1, "--formulation", "residual", "--out", "best.json")
    again = ("--q", "best.json")
    for command, more in (("posture", search), ("measure", again)):
        words = (command, "robot.urdf", "--task", "position", *more, "--json")
        done = lockedjoint.here(*words, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        *notes, last = [*done.stderr.splitlines(), *[""] * (command != "posture")]
        assert ("may have been missed" in last) == (command == "posture")
        assert notes[0].endswith("cannot move and have no column: j3 at 0.5.")
        assert notes[1].endswith("were taken for radians, and may be degrees: j1.")
        found = json.loads(done.stdout)
        assert [f"Note: {note}" for note in found["notes"]] == notes
        assert found["immobile"] == {"j3": 0.5}
        assert list(found["q"]) == ["j0", "j1", "j2", "j4"]
        assert np.array(found["jacobian"]).shape == (3, 4)


def test_a_structural_failure_is_a_result(lockedjoint, made, tmp_path):
    """With the advice, exit status 0, and a file that measure reads."""
    tool = made.joint("tool", "l7", "tool", "fixed", xyz="0 0 0.1")
    arm = made.spherical_shoulder_and_wrist()
    arm = arm.replace("</robot>", f'<link name="tool"/>{tool}</robot>')
    (tmp_path / "srs.urdf").write_text(arm)
    again = ("measure", "srs.urdf", "--q", "best.json")
    for words in (("posture", "srs.urdf", "--out", "best.json"), again):
        done = lockedjoint.here(*words, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        words = " ".join(done.stdout.split())
        assert "structural j3: no posture keeps full rank" in words
        assert "meet one line; try --task position" in words
    found = json.loads((tmp_path / "best.json").read_text())
    assert (found["starts"], found["reached_best"]) == (0, 0)
    (failure,) = found["structural"]
    assert (failure["joint"], failure["kind"]) == ("j3", "structural")


def test_where_the_tool_is_can_be_given_to_at(lockedjoint, made, robot, tmp_path):
    """The line of the text, and the key of the JSON; judged by pinocchio."""
    q = [0.3, -0.9, 0.4, 1.1, -0.2, 0.8, 0.5]
    measured = ("measure", robot, "--q=" + ",".join(map(str, q)))
    (line,) = (
        line
        for line in lockedjoint.here(*measured, cwd=tmp_path).stdout.splitlines()
        if line.startswith("tool at")
    )
    pose = line.removeprefix("tool at (m, rad)").strip()
    tool = lockedjoint.json(*measured, cwd=tmp_path)["tool"]
    assert [float(number) for number in pose.split(",")] == pytest.approx(
        list(tool.values()), abs=1e-5
    )
    (tmp_path / "tool.json").write_text(json.dumps(tool))
    model, names = pin.buildModelFromXML(robot.read_text()), [f"j{k}" for k in range(7)]
    expected = made.pose_in_pinocchio(model, names, q, "l7")
    for text in (pose, str(tmp_path / "tool.json")):
        read = read_pose(text)
        assert read.position == pytest.approx(expected.translation, abs=2e-5)
        assert read.rotation == pytest.approx(expected.rotation, abs=3e-5)


def test_a_posture_says_whether_links_were_looked_at(lockedjoint, robot, tmp_path):
    done = lockedjoint.here("posture", robot, "--starts", 1, cwd=tmp_path)
    (line,) = (one for one in done.stdout.splitlines() if one.startswith("collisions"))
    assert line.split(maxsplit=1)[1] == "not checked (--clearance)"
