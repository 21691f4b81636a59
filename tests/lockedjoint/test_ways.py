"""The ways of the verbs: how many rooms a call enters, and that a damaged arm is made once.

A room is a folder of modules. It is entered if a function of one of its files runs in a call,
modules that are imported on the way left aside: `sys.setprofile` sees both.
"""

from __future__ import annotations

import sys
import threading
from contextlib import closing
from pathlib import Path
from unittest.mock import patch

import pytest

import lockedjoint as lj
from lockedjoint.recovery.failures import Damage
from tests import made_robots as made

ROOT = Path(lj.__file__).resolve().parents[1]
MOST = 10
STOREYS = ("lockedjoint", "formulations", "nlp")
Q = {f"j{k}": 0.1 * (k + 1) for k in range(7)}
HERE = lj.Pose((0.4, 0.2, 1.2))


def rooms(call):
    """Return the folders among whose files the call runs functions."""
    entered, importing = set(), [0]

    def look(frame, event, _):
        code = frame.f_code
        if code.co_name == "_find_and_load" and code.co_filename.startswith(
            "<frozen importlib"
        ):
            importing[0] += {"call": 1, "return": -1}.get(event, 0)
        elif event == "call" and not importing[0]:
            entered.add(code.co_filename)

    sys.setprofile(look)
    threading.setprofile(look)
    try:
        call()
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    files = [Path(name).resolve() for name in entered if not name.startswith("<")]
    inside = [file.relative_to(ROOT) for file in files if file.is_relative_to(ROOT)]
    return {str(file.parent) for file in inside if file.parts[0] in STOREYS}


def look_at(robot):
    pytest.importorskip("viser")
    with closing(lj.view(robot, address="localhost:0")):
        pass


VERBS = {
    "measure": lambda arm, _: lj.measure(arm, Q),
    "posture": lambda arm, _: lj.posture(arm, starts=2, workers=1),
    "path": lambda arm, way: lj.path(
        lj.Robot(arm, task="position"), way, samples=3, tracks=2, rounds=0
    ),
    "recover": lambda arm, _: lj.recover(arm, Q, lj.Locked("j0"), HERE, starts=10, boxes=100),
    "view": lambda arm, _: look_at(arm),
    "codegen": lambda arm, _: lj.codegen(arm),
    "compare": lambda *_: lj.compare(7, models=("unit-revolute",), starts=1, workers=1),
    "workspace": lambda *_: lj.workspace(planar(), voxel=0.2, slice_degrees=20),
    "prove_workspace": lambda *_: lj.prove_workspace(planar(), finest=0.5, halvings=0),
}


def planar():
    return lj.Robot(made.tree(made.planar_urdf([0.5, 0.4, 0.3])), task="vx,vy")


LONG = ("compare",)
MARKED = [pytest.param(verb, marks=[pytest.mark.long] * (verb in LONG)) for verb in VERBS]


@pytest.mark.parametrize("verb", MARKED)
def test_a_verb_enters_few_rooms(verb, tmp_path):
    arm, way = tmp_path / "arm.urdf", tmp_path / "way.csv"
    arm.write_text(made.offset_arm())
    way.write_text("x,y,z\n0.4,0.2,1.2\n0.4,0.25,1.2\n")
    entered = rooms(lambda: VERBS[verb](arm, way))
    assert {"lockedjoint", "lockedjoint/kinematics"} & entered or verb == "compare"
    assert len(entered) <= MOST, sorted(entered)


def test_recover_makes_the_damaged_arm_once():
    robot = lj.Robot(made.tree(made.offset_arm()))
    with (
        patch.object(Damage, "of", wraps=Damage.of) as damage,
        patch.object(
            lj.Robot, "with_locked", autospec=True, side_effect=lj.Robot.with_locked
        ) as left,
    ):
        lj.recover(robot, Q, lj.Locked("j0"), HERE, starts=10, boxes=100)
    assert (damage.call_count, left.call_count) == (1, 1)
