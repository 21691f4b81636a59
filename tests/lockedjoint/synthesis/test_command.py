"""``lockedjoint realise``, from its arguments to its files and messages."""

import json
from functools import partial
from xml.etree import ElementTree

import numpy as np
import pytest

from lockedjoint.formulations.joints.models import arm
from lockedjoint.formulations.measures import worst_case_sigma
from lockedjoint.nlp.starts import generator

PLANAR = [[-np.sqrt(2 / 3), np.sqrt(1 / 6), np.sqrt(1 / 6)], [0, -np.sqrt(0.5), np.sqrt(0.5)]]


@pytest.fixture
def folder(tmp_path, optimum):
    (tmp_path / "planar.json").write_text(json.dumps(PLANAR), encoding="utf-8")
    np.save(tmp_path / "seven.npy", optimum)
    both = [{"jacobian": PLANAR}, {"jacobian": optimum.tolist()}]
    (tmp_path / "both.json").write_text(json.dumps(both), encoding="utf-8")
    return tmp_path


@pytest.fixture
def realise(lockedjoint, folder):
    return partial(lockedjoint.here, "realise", cwd=folder)


@pytest.fixture
def found(lockedjoint, folder):
    """Return what a command says as JSON."""
    return partial(lockedjoint.json, cwd=folder)


def test_urdf_on_standard_output(realise, optimum):
    done = realise("both.json#1", "--order", "given", "--to", "urdf")
    assert done.returncode == 0, done.stderr
    joints = ElementTree.fromstring(done.stdout).findall("joint")
    moving = [joint for joint in joints if joint.get("type") != "fixed"]
    axes = [joint.find("axis").get("xyz").split() for joint in moving]
    np.testing.assert_allclose(np.array(axes, float).T, optimum[3:], atol=1e-15)


def test_json_holds_everything(found):
    found = found("realise", "seven.npy", "--criterion", "clearance")
    assert found["distinct"] == 5040
    assert found["worst_case_sigma"] == pytest.approx(0.57148, abs=1e-5)
    assert [joint["column"] for joint in found["joints"]] == found["order"]
    assert found["dh"]["convention"] == "standard"
    assert found["urdf"].startswith("<?xml")
    assert found["deviation"] < 1e-12


def test_figures_and_axes(realise, folder):
    assert realise("planar.json", "--to", "figure", "--out", "arm.png").returncode == 0
    assert (folder / "arm.png").read_bytes().startswith(b"\x89PNG")
    assert "end effector  0  0  0" in realise("planar.json").stdout
    table = realise("planar.json", "--to", "modified-dh")
    assert "alpha before" in table.stdout


def test_clearance_is_the_default_and_links_that_touch_are_named(realise, folder):
    (folder / "fold.json").write_text("[[0.5, 1.0, 0.2], [0.0, 0.0, 0.001]]", encoding="utf-8")

    def run(*arguments):
        done = realise(*arguments, "--json")
        assert done.returncode == 0
        return json.loads(done.stdout), done.stderr

    chosen, said = run("seven.npy")
    assert (chosen["criterion"], chosen["touching"], said) == ("clearance", [], "")
    assert chosen["gap"] > 0
    assert chosen["worst_case_sigma"] == pytest.approx(chosen["worst_case_sigma_given"])
    flat, said = run("fold.json", "--order", "given", "--slide", "never")
    assert flat["order"] == [0, 1, 2]
    assert flat["touching"]
    assert "Note: links 0 and 1" in said
    apart, said = run("fold.json", "--order", "given")
    assert (apart["touching"], apart["slid"], said) == ([], True, "")
    assert not run("fold.json", "--criterion", "total-length")[0]["slid"]


def test_a_column_that_is_nearly_a_joints_is_refused_with_what_would_do(realise, folder):
    near = np.load(folder / "seven.npy")
    near[3:, 2] *= 1.0002
    np.save(folder / "near.npy", near)
    refused = realise("near.npy")
    assert refused.returncode == 2
    assert "off by 2.0e-04, try --relative-tolerance 1e-03" in refused.stderr
    allowed = realise("near.npy", "--relative-tolerance", "1e-3", "--order", "given")
    assert allowed.returncode == 0, allowed.stderr


def test_a_table_as_csv_is_a_robot(realise, found):
    realise("seven.npy", "--to", "dh", "--out", "dh.csv", "--order", "given")
    robot = found("measure", "dh.csv", "--length", 1)
    assert robot["worst_case_sigma"] == pytest.approx(0.57148, abs=1e-5)


def test_speeds_of_prismatic_joints_are_in_the_urdf(realise, lockedjoint, folder):
    """The robot that `measure` reads has the Jacobian's worst case, in metres."""
    model = arm("lever-revolute(length=0.3):5,prismatic(speed=0.5):2")
    np.save(folder / "mix.npy", model.jacobian(model.sample(generator(0, 0))))
    made = realise("mix.npy", "--to", "urdf", "--out", "mix.urdf")
    assert "prismatic joints move 0.5 m, 0.5 m per unit of the Jacobian" in made.stderr
    command = ("measure", "mix.urdf", "--length", 1, "--json")
    robot = lockedjoint.here(*command, cwd=folder)
    sigma = json.loads(robot.stdout)["worst_case_sigma"]
    assert sigma == pytest.approx(worst_case_sigma(np.load(folder / "mix.npy")), abs=1e-12)
    assert "multiplies columns of J" in robot.stderr


def test_what_is_no_answer_is_said_to_be_none(realise, folder, optimum):
    described = {"model": "free", "verdict": "not solved", "jacobian": optimum.tolist()}
    (folder / "failed.json").write_text(json.dumps(described))
    assert "free, not solved: no answer" in realise("failed.json").stderr
