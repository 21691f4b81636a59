"""measure-robot, posture and robots as a stranger meets them: real processes."""

import json
import sys

import numpy as np
import pytest

from formulations import measures
from formulations.__main__ import main


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
    for line in (
        "worst case sigma",
        "starts",
        "worst case direction",
        "characteristic length",
        "midway",
    ):
        assert line in found.stdout
    best = json.loads((tmp_path / "here/best.json").read_text())
    again = lockedjoint.here(
        "measure-robot", robot, "--configuration", "here/best.json", "--json", cwd=tmp_path
    )
    assessed = json.loads(again.stdout)
    assert assessed["worst_case_sigma"] == pytest.approx(best["worst_case_sigma"], abs=1e-12)
    measured = lockedjoint.here("measure", "here/best.json", "--json", cwd=tmp_path)
    judged = json.loads(measured.stdout)
    assert judged["worst_case_sigma"] == pytest.approx(best["worst_case_sigma"], abs=1e-12)
    matrix = np.array(best["jacobian"])
    assert measures.worst_case_sigma(matrix) == pytest.approx(best["worst_case_sigma"])


def test_assess_shows_everything_that_was_asked_for(lockedjoint, robot, tmp_path):
    done = lockedjoint.here(
        *("measure-robot", robot, "--length", 0.4, "--task", "vx,vy,wz", "--frame", "tip"),
        *("--held", "j1=0.5", "--locked", 2, "--point", "0,0,0.1", "--out", "a.json"),
        *("--configuration", "j0=0.1,j4=-1", "--base", "l0", "--tip", "l7"),
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "a.json").read_text())
    assert found["characteristic_length"] == 0.4
    assert (found["locked_at"], found["task"]) == ({"j1": 0.5}, ["vx", "vy", "wz"])
    assert np.array(found["jacobian"]).shape == (3, 6)
    assert len(found["failures"]) == 15
    assert f"and {15 - 12} failures" in done.stdout


# Behind an arrow what the sentence has; more of these are in tests/test_bad_input.py.
WRONG = """
measure-robot broken.urdf -> well-formed XML
measure-robot robot.urdf --tip hand -> tip is hand; allowed: one of the links
measure-robot robot.urdf --tip L7 -> nearest: l7.
measure-robot robot.urdf --base l_0 -> nearest: l0.
measure-robot robot.urdf --held J1=0 -> nearest: j1.
measure-robot robot.urdf --configuration J3=0 -> nearest: j3.
measure-robot robot.urdf --configuration 1e400,0,0,0,0,0,0 -> a finite number
measure-robot robot.urdf --configuration 1 -> 7 of them (j0, j1
measure-robot robot.urdf --length 1e300 -> length is 1e+300; allowed: 1e-20 to
measure-robot robot.urdf --tip l6 -> more than the 6 task directions
measure-robot free.urdf --held j3=1e308 --task vx -> joint j3 is 1e+308
measure-robot free.urdf --configuration j3=1e30 -> joint j3 is 1e+30; allowed
measure-robot stuck.urdf -> j0, j1, j2, j4, j5, j6; j3 cannot move
measure-robot stuck.urdf --held j3=1 --task vx -> within [0, 0]
measure-robot stuck.urdf --base l3 --tip l4 -> free joints move (j3 cannot
measure-robot stuck.urdf --configuration j3=0 --task vx -> joint is j3, which cannot move
measure-robot branched.urdf -> --tip is missing; allowed: a link of made
posture robot.urdf --point 0,1e160,0 -> point is 1e+160
posture point.urdf --formulation isotropy -> all revolute joints meet
posture planar.urdf -> directions in which the tip can move at some posture
"""


@pytest.mark.parametrize("line", WRONG.strip().splitlines())
def test_wrong_input_is_one_sentence(robot, made, tmp_path, line, monkeypatch, capfd):
    """By the entry point itself, in this process: so many of them take long to start."""
    arguments, _, sentence = line.partition(" -> ")
    text = robot.read_text()
    stuck, rest = text.split('name="j3"')
    stuck += 'name="j3"' + rest.replace('lower="-2" upper="2"', "", 1)
    branches = [made.joint("a", "0", "1"), made.joint("b", "0", "2")]
    for name, content in (
        ("broken", text[:100]),
        ("free", text.replace('type="revolute">', 'type="continuous">')),
        ("stuck", stuck),
        ("point", made.urdf(made.serial(["0 0 0"] * 7))),
        ("branched", made.urdf(branches)),
        ("planar", made.urdf(made.serial(["0.3 0 0"] * 8, ["0 0 1"] * 8))),
    ):
        (tmp_path / f"{name}.urdf").write_text(content)
    before = sorted(tmp_path.iterdir())
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["lockedjoint", *arguments.split()])
    with pytest.raises(SystemExit) as ended:
        main()
    shown = capfd.readouterr()
    assert (ended.value.code, shown.out, shown.err.count("\n")) == (2, "", 1)
    assert shown.err.startswith("Error: ")
    assert sentence in shown.err
    assert sorted(tmp_path.iterdir()) == before


def test_what_is_suspicious_is_a_note(lockedjoint, made, tmp_path):
    """On standard error, and in the result; the posture that is found has the same columns."""
    joints = made.serial(
        ["0.1 0.05 0.3"] * 5,
        made.AXES[:5],
        j1={"limit": 'lower="-170" upper="170"'},
        j3={"limit": 'lower="0.5" upper="0.5"'},
    )
    (tmp_path / "robot.urdf").write_text(made.urdf(joints))
    search = ("--starts", 2, "--workers", 1, "--formulation", "residual", "--out", "best.json")
    for command, more in (
        ("posture", search),
        ("measure-robot", ("--configuration", "best.json")),
    ):
        done = lockedjoint.here(
            command, "robot.urdf", "--task", "position", *more, "--json", cwd=tmp_path
        )
        assert done.returncode == 0, done.stderr
        *notes, last = [*done.stderr.splitlines(), *[""] * (command != "posture")]
        assert ("may have been missed" in last) == (command == "posture")
        assert notes[0].endswith("cannot move and have no column: j3 at 0.5.")
        assert notes[1].endswith("may be degrees, but URDF has radians: j1.")
        found = json.loads(done.stdout)
        assert [f"Note: {note}" for note in found["notes"]] == notes
        assert found["immobile"] == {"j3": 0.5}
        assert list(found["configuration"]) == ["j0", "j1", "j2", "j4"]
        assert np.array(found["jacobian"]).shape == (3, 4)


def test_a_structural_failure_is_a_result(made, tmp_path, monkeypatch, capfd):
    """With the advice, exit status 0, and a file that measure-robot reads."""
    tool = made.joint("tool", "l7", "tool", "fixed", xyz="0 0 0.1")
    arm = made.spherical_shoulder_and_wrist()
    (tmp_path / "srs.urdf").write_text(
        arm.replace("</robot>", f'<link name="tool"/>{tool}</robot>')
    )
    monkeypatch.chdir(tmp_path)
    again = ("measure-robot", "srs.urdf", "--configuration", "best.json")
    for arguments in (("posture", "srs.urdf", "--out", "best.json"), again):
        monkeypatch.setattr(sys, "argv", ["lockedjoint", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        shown = capfd.readouterr().out
        assert not ended.value.code
        (line,) = [one for one in shown.splitlines() if one.startswith("structural")]
        assert "j3: no posture keeps full rank" in line
        assert line.endswith("try --task position")
    found = json.loads((tmp_path / "best.json").read_text())
    assert (found["starts"], found["reached_best"]) == (0, 0)
    (failure,) = found["structural"]
    assert (failure["joint"], failure["kind"]) == ("j3", "structural")
