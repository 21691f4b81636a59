"""The task for pink on docs/robots.md, on an arm whose joints turn without end."""

import re
from pathlib import Path

import numpy as np
import pytest

import lockedjoint as lj

pink = pytest.importorskip("pink", reason="install pin-pink")
pin = pytest.importorskip("pinocchio", reason="install pin")

URDF = """<robot name="arm"><link name="l0"/><link name="l1"/><link name="l2"/><link name="l3"/>
<joint name="a" type="continuous"><parent link="l0"/><child link="l1"/>
<axis xyz="0 0 1"/></joint>
<joint name="b" type="continuous"><parent link="l1"/><child link="l2"/>
<origin xyz="0.4 0 0.1"/><axis xyz="0 0 1"/></joint>
<joint name="c" type="continuous"><parent link="l2"/><child link="l3"/>
<origin xyz="0.3 0 0"/><axis xyz="0 0 1"/></joint>
<link name="tip"/><joint name="t" type="fixed"><parent link="l3"/><child link="tip"/>
<origin xyz="0.2 0 0"/></joint></robot>"""


@pytest.mark.parametrize("seed", range(3))
def test_error_and_slope_are_those_of_the_arm(seed):
    page = (Path(__file__).parents[2] / "docs/robots.md").read_text("utf-8")
    code = re.search(r"^joints = .*?(?=^start = )", page, re.DOTALL | re.MULTILINE)[0]
    model = pin.buildModelFromXML(URDF)
    arm = lj.RobotArm.read(model, "tip", task="vx,vy")
    names = {"np": np, "pink": pink, "pin": pin, "model": model, "arm": arm}
    exec(compile(code, "example", "exec"), names)
    angles = np.random.default_rng(seed).uniform(-3, 3, 3)
    q = np.stack([np.cos(angles), np.sin(angles)], axis=1).ravel()
    configuration = pink.Configuration(model, model.createData(), q)
    task = names["WorstCaseTask"](cost=1.0)
    sigma, gradient = arm.worst_case(angles)
    assert task.compute_error(configuration) == pytest.approx(sigma - task.target, abs=1e-12)
    assert task.compute_jacobian(configuration)[0] == pytest.approx(gradient, abs=1e-12)
