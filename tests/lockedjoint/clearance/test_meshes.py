"""Meshes: where a robot's file may have them opened, and the units and axes that they state."""

import json
import re
import shutil
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import numpy as np
import pytest
import trimesh

import lockedjoint as lj
from lockedjoint.clearance.around_shapes import capsule_around
from lockedjoint.clearance.distances import distance
from lockedjoint.clearance.meshes import mesh_file, stated_unit
from lockedjoint.clearance.read_clearance import Obstacles
from lockedjoint.clearance.shapes import Shape, mesh
from lockedjoint.nlp.errors import FileError, InputError

coal = pytest.importorskip("coal", reason="install coal")
pytest.importorskip("collada", reason="install pycollada")

EDGES = np.array([50.0, 20.0, 10.0])  # in the units of a file


def collada(path: Path, unit: str = "", up: str = "") -> Path:
    """Write a box in COLLADA that states a unit and an axis that is up."""
    text = trimesh.creation.box(EDGES).export(file_type="dae").decode()
    text = re.sub("<(unit|up_axis).*?(/>|</up_axis>)", "", text)
    end = text.index("</asset>")
    stated = f'<unit name="u" meter="{unit}"/>' if unit else ""
    stated += f"<up_axis>{up}</up_axis>" if up else ""
    path.write_text(text[:end] + stated + text[end:])
    return path


def robots() -> Path:
    """Where the robots of example-robot-data are."""
    try:
        return Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
    except PackageNotFoundError:
        pytest.skip("install example-robot-data")


def extent(shape) -> np.ndarray:
    """The edges of a shape along the axes of its link, as coal has it."""
    points = np.array(coal.MeshLoader().load(str(shape.file), np.array(shape.size)).vertices())
    return np.ptp(points @ shape.pose[:3, :3].T, axis=0)


@pytest.mark.parametrize("up", ["Z_UP", "Y_UP", "X_UP", ""])
@pytest.mark.parametrize(("unit", "metres"), [("", 1.0), ("0.001", 1e-3), ("0.0254", 0.0254)])
def test_the_unit_that_a_file_states_counts_and_the_axis_does_not(tmp_path, up, unit, metres):
    """As in RViz and MoveIt."""
    file = collada(tmp_path / "box.dae", unit, up)
    scale = (1.0, 2.0, 3.0)
    np.testing.assert_allclose(extent(mesh(file)), metres * EDGES, rtol=1e-6)
    np.testing.assert_allclose(extent(mesh(file, scale)), metres * EDGES * scale, rtol=1e-6)
    (shape,) = Obstacles.read(file).bodies[0][1]
    np.testing.assert_allclose(extent(shape), metres * EDGES, rtol=1e-6)
    assert stated_unit(file) == metres


@pytest.mark.parametrize("number", [1, 2, 3])
def test_meshes_of_tiago_lie_where_it_is_drawn(number):
    """Links are drawn from STL, without axes, and kept apart from COLLADA with ``Y_UP``."""
    name = "tiago_description/meshes/arm"
    folder = robots() / "example-robot-data/robots" / name
    ends = []
    for file in (f"arm_{number}.stl", f"arm_{number}_collision.dae"):
        shape = mesh(folder / file)
        points = np.array(
            coal.MeshLoader().load(str(shape.file), np.array(shape.size)).vertices()
        )
        ends.append([points.min(axis=0), points.max(axis=0)] @ shape.pose[:3, :3].T)
    np.testing.assert_allclose(*ends, atol=2e-3)


@pytest.mark.parametrize("ending", ["stl", "obj", "ply"])
def test_other_formats_are_in_metres(tmp_path, ending):
    file = tmp_path / f"box.{ending}"
    trimesh.creation.box(EDGES).export(file)
    np.testing.assert_allclose(extent(mesh(file)), EDGES, rtol=1e-6)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("0.001", "0"), "unit of .* is 0;"),
        (("0.001", "-1"), "unit"),
        (("0.001", "nan"), "unit"),
        (("0.001", "1e300"), "unit"),
        (("<asset>", "<asset"), "well-formed COLLADA"),
        (("<asset>", "<!DOCTYPE a [<!ENTITY a 'b'>]><asset>"), "COLLADA|without entities"),
    ],
)
def test_what_states_no_unit_is_refused(tmp_path, change, said):
    file = collada(tmp_path / "box.dae", "0.001", "Z_UP")
    file.write_text(file.read_text().replace(*change))
    with pytest.raises(FileError, match=said):
        mesh(file)


def test_a_mesh_is_opened_in_the_package_alone(tmp_path):
    """Not wherever a robot of strangers says: by absolute and relative paths, and links."""
    robot = tmp_path / "work" / "pack" / "urdf" / "arm.urdf"
    for place in ("urdf", "meshes", "deep/er"):
        folder = robot.parents[1] / place
        folder.mkdir(parents=True)
        (folder / "a.stl").write_text("a")
    for outside in (tmp_path / "work" / "a.stl", tmp_path / "a.stl", robot.with_name("a.txt")):
        outside.write_text("a")
    robot.with_name("link.stl").symlink_to(tmp_path / "a.stl")
    robot.with_name("text.stl").symlink_to(robot.with_name("a.txt"))
    fine = ["a.stl", "../meshes/a.stl", "package://pack/meshes/a.stl", "../deep/er/a.stl"]
    fine += ["package://other/deep/er/a.stl", "package://a.stl", "package:///pack/meshes/a.stl"]
    assert all(mesh_file(name, robot) for name in fine)
    inside = str(robot.with_name("a.stl"))
    refused = [inside, f"file://{inside}", f"package://{inside}", str(tmp_path / "a.stl")]
    refused += [
        "../../a.stl",
        "../../../a.stl",
        "a.txt",
        "link.stl",
        "text.stl",
        "http://a.stl",
    ]
    refused += ["package://../../../../a.stl", "", "package://", "..", "meshes/a.stl"]
    assert not [name for name in refused if mesh_file(name, robot)]
    shutil.copy(robot.with_name("a.stl"), robot.parents[1] / "package.xml")
    far = robot.parents[1] / "urdf" / "x" / "y" / "arm.urdf"
    far.parent.mkdir(parents=True)
    assert mesh_file("../../../meshes/a.stl", far)
    assert not mesh_file("../../../../a.stl", far)


def test_every_mesh_of_robots_that_exist_is_found():
    """But for files of another machine, which Romeo names."""
    named = [
        (name, file)
        for file in robots().rglob("*.urdf")
        for name in set(re.findall(r'<mesh[^>]* filename="([^"]+)"', file.read_text("utf-8")))
        if not name.startswith("file:///usr/")
    ]
    assert len(named) > 1000
    assert not [
        name for name, file in named if not (mesh_file(name, file) or ":///usr" in name)
    ]


SPHERE = '<collision><geometry><sphere radius="{}"/></geometry></collision>'.format


def with_spheres(made, radii):
    """A planar arm of which link k has a sphere of a radius about its joint."""
    text = made.planar_urdf([0.5] * 5)
    for k, radius in enumerate(radii):
        text = text.replace(
            f'<link name="l{k}"/>', f'<link name="l{k}">{SPHERE(radius)}</link>'
        )
    return text


def test_links_without_a_pair_are_said(made, tmp_path, lockedjoint):
    """A link that is in contact with all others wherever they are drops out, aloud."""
    (tmp_path / "arm.urdf").write_text(with_spheres(made, [0.05, 0.05, 50, 0.05, 0.05]))
    robot = lj.Robot(tmp_path / "arm.urdf", task="vx,vy", clearance=0.01)
    assert robot.apart.unchecked == ("l2",)
    (tmp_path / "way.csv").write_text("x,y,z\n1.5,0.5,0\n1.5,0.6,0\n")
    task = ("--task", "vx,vy", "--clearance", "0.01")
    found = lockedjoint.here(
        "posture", "arm.urdf", *task, "--starts", "2", "--json", cwd=tmp_path
    )
    assert json.loads(found.stdout)["clearance"]["unchecked"] == ["l2"]
    effort = ("--effort", "samples=5", "--effort", "tracks=10")
    found = lockedjoint.here(
        "path", "arm.urdf", "way.csv", *task, *effort, "--json", cwd=tmp_path
    )
    assert json.loads(found.stdout)["unchecked_links"] == ["l2"]
    assert "no distance is looked at: l2" in found.stderr
    q = [0.3, 0.4, 0.5, 0.4, 0.3]
    answer = lj.recover(
        robot.changed(task=None), q, lj.Locked("j1"), lj.Pose((1.2, 1.2, 0.0)), starts=100
    )
    assert any("l2" in note for note in answer.to_dict()["notes"])
    (tmp_path / "arm.urdf").write_text(with_spheres(made, [50] * 5))
    found = lockedjoint.here("posture", "arm.urdf", *task, cwd=tmp_path)
    assert found.returncode == 1
    assert "not always in contact" in found.stderr
    (tmp_path / "arm.urdf").write_text(with_spheres(made, [0.1]))
    with pytest.raises(InputError, match="not adjacent"):
        _ = lj.Robot(tmp_path / "arm.urdf", task="vx,vy", clearance=0.01).apart


def test_capsules_and_quaternions_of_shapes(tmp_path):
    """A capsule that a quaternion turns: its distance to a sphere in closed form."""
    half = np.sqrt(0.5)
    capsule = f"""<collision><origin xyz="1 0 0" quat_xyzw="0 {half} 0 {half}"/><geometry>
    <capsule radius="0.1" length="0.6"/></geometry></collision>"""
    text = f'<robot name="a" version="1.1"><link name="a">{capsule}</link></robot>'
    (tmp_path / "a.urdf").write_text(text)
    (_, (shape,), _) = Obstacles.read(tmp_path / "a.urdf").bodies[0]
    assert shape.kind == "capsule"
    ball = Shape("sphere", (0.2,), None, np.eye(4))
    at = coal.Transform3s(shape.pose[:3, :3], shape.pose[:3, 3])
    for place, expected in (([2.0, 0, 0], 1 - 0.3 - 0.3), ([1.2, 0, 1.0], 1 - 0.3)):
        there = coal.Transform3s(np.eye(3), np.array(place, dtype=float))
        gap = distance((shape, at), (ball, there))[0]
        assert gap == pytest.approx(expected, abs=1e-6)
    around = capsule_around([shape], np.eye(4))
    assert around.radius == pytest.approx(0.1, abs=1e-4)
    assert np.linalg.norm(around.end - around.start) == pytest.approx(0.6, abs=1e-4)
