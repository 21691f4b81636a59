"""One robot: its file is read once, and whatever states a configuration is understood."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pytest

import lockedjoint as lj
from lockedjoint.recovery import failures
from lockedjoint.workspaces import workspace_size
from tests import made_robots as made

OPENED = list[str]()
WATCHED = list[Path]()
BOX = '<box size="0.01 0.01 0.01"/>'
Q = {f"j{k}": 0.1 * (k + 1) for k in range(7)}


def _watch(event: str, arguments: tuple[object, ...]) -> None:
    if event == "open" and WATCHED and str(arguments[0]) == str(WATCHED[0]):
        OPENED.append(str(arguments[0]))


sys.addaudithook(_watch)


@pytest.fixture
def file(tmp_path):
    """The file of an arm; every time that it is opened is counted."""
    path = tmp_path / "arm.urdf"
    path.write_text(made.offset_arm())
    WATCHED[:], OPENED[:] = [path], []
    yield path
    WATCHED.clear()


COMMANDS = (
    "measure {} --q state.json",
    "posture {} --starts 1 --workers 1",
    "posture {} --starts 1 --workers 1 --clearance 0.001",
    "path {} way.csv --effort samples=3 --effort tracks=2 --effort rounds=0",
    "path {} way.csv --effort samples=3 --effort tracks=2 --effort rounds=0 --clearance 0.001",
    "recover {} --q state.json --locked j0 --at 9,9,9 --effort starts=10 --effort boxes=10",
    "recover {} --q state.json --locked j0 --at 9,9,9 --effort starts=10 --effort boxes=10"
    " --clearance 0.001",
    "workspace {} --tip l5 --effort voxel=0.5 --effort slice_degrees=45",
    "prove-workspace {} --tip l4 --effort finest=3 --effort halvings=0",
    "codegen {} --out-dir code",
)


@pytest.mark.parametrize("line", COMMANDS)
def test_every_command_reads_the_file_once(lockedjoint, file, line, monkeypatch):
    monkeypatch.setattr(workspace_size, "_SAMPLE_POINTS", 10)
    if "--clearance" in line:
        pytest.importorskip("coal")
        boxes = made.with_shapes(file.read_text(), range(1, 8), BOX)
        file.write_text(boxes)
    folder = file.parent
    (folder / "state.json").write_text(json.dumps(Q))
    (folder / "way.csv").write_text("x,y,z\n0.4,0.2,1.2\n0.4,0.25,1.2\n")
    OPENED.clear()
    done = lockedjoint.here(*line.format(file).split(), cwd=folder)
    assert done.returncode in (0, 1), done.stderr
    assert len(OPENED) == 1, line


def test_every_function_reads_the_file_once(file):
    robot = lj.Robot(file)
    assert len(OPENED) == 1
    lj.measure(robot, Q)
    lj.posture(robot, starts=1, workers=1)
    lj.posture(robot.changed(length=0.2), starts=1, workers=1)
    assert len(OPENED) == 1
    lj.measure(file, Q)
    assert len(OPENED) == 2


def test_what_is_left_after_failures_is_made_once(file):
    """One `Damage`, and with it one chain, however many parts of the search use it."""
    robot = lj.Robot(file)
    with patch.object(failures.Damage, "of", wraps=failures.Damage.of) as made_of:
        lj.recover(robot, Q, lj.Locked("j0"), lj.Pose((9, 9, 9)), starts=10, boxes=10)
    assert made_of.call_count == 1


def test_a_state_may_be_numbers_names_a_message_or_a_file(file, tmp_path):
    robot, values = lj.Robot(file, states={"ready": Q}), list(Q.values())
    message = SimpleNamespace(name=[*Q, "gripper"], position=[*values, 0.04])
    plain = {"name": message.name, "position": message.position}
    (tmp_path / "state.json").write_text(json.dumps(plain))
    rows = [f"name: {json.dumps(message.name)}", f"position: {message.position}", "---"]
    (tmp_path / "state.yaml").write_text("header: {frame_id: ''}\n" + "\n".join(rows))
    pairs = ",".join(f"{name}={value}" for name, value in reversed(Q.items()))
    for stated in (values, np.array(values), Q, "ready", pairs, ",".join(map(str, values))):
        point, notes = robot.configuration(stated)
        assert (point.tolist(), notes) == (values, ())
    for whole in (message, tmp_path / "state.json", str(tmp_path / "state.yaml")):
        point, notes = robot.configuration(whole)
        assert point.tolist() == values
        assert notes == ("Joints that are not of the arm are left aside: gripper.",)


def test_missing_joints_are_named(file):
    robot = lj.Robot(file)
    some = {name: value for name, value in Q.items() if name not in ("j2", "j5")}
    for call in (
        lambda: lj.measure(robot, some),
        lambda: lj.recover(robot, some, lj.Locked("j0"), lj.Pose((9, 9, 9))),
    ):
        with pytest.raises(lj.InputError, match="without j2, j5; allowed: every joint"):
            call()
    with pytest.raises(lj.InputError, match=r"q is 5 numbers; allowed: 7 of them \(j0, j1"):
        lj.measure(robot, list(some.values()))


def test_an_ambiguous_tip_lists_all_links_and_their_joints():
    branches = [made.joint(f"a{k}", "0", f"hand{k}") for k in range(5)]
    text = made.urdf([*branches, made.joint("b", "hand4", "thumb")])
    with pytest.raises(lj.InputError) as caught:
        lj.Robot(made.tree(text))
    hands = ", ".join(f"hand{k} (1 joint)" for k in range(4))
    assert f"{hands}, thumb (2 joints)" in str(caught.value)


def test_a_single_failure_needs_no_list_and_locks_where_it_is(file):
    robot, far = lj.Robot(file), lj.Pose((9, 9, 9))
    how = {"starts": 10, "boxes": 1000}
    alone = lj.recover(robot, Q, lj.Locked("j3"), far, **how)
    listed = lj.recover(robot, Q, [lj.Locked("j3", Q["j3"])], far, **how)
    assert alone.verdict == listed.verdict
    assert alone.tried == listed.tried


def test_a_robot_shows_itself(file):
    robot = lj.Robot(file, tip="l7:0,0,0.1", task="position", states={"ready": Q})
    assert repr(robot) == "<Robot made: 7 joints from l0 to l7, task vx,vy,vz>"
    shown = robot._repr_html_()
    assert "<svg" in shown
    assert all(f"<td>{name}</td>" in shown for name in Q)
    assert "states: ready" in shown
    moved = made.arm(file.read_text(), task="position").chain
    assert not np.allclose(robot.chain.end, moved.end)


VERBS = {
    "measure": lj.measure,
    "measure at q": lambda given: lj.measure(given, Q),
    "posture": lj.posture,
    "path": lambda given: lj.path(given, "way.csv"),
    "recover": lambda given: lj.recover(given, Q, lj.Locked("j0"), lj.Pose((9, 9, 9))),
    "workspace": lj.workspace,
    "prove_workspace": lj.prove_workspace,
    "view": lj.view,
    "codegen": lj.codegen,
}


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_takes_a_robot_and_none_a_part_of_one(file, verb):
    """In one sentence, before any work: the arm alone has no links that could collide."""
    robot = lj.Robot(file)
    for part in (robot.arm, robot.chain):
        with pytest.raises(
            lj.InputError, match="allowed: a Robot, of which that is a part, or"
        ):
            VERBS[verb](part)
