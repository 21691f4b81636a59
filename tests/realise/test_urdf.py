"""URDF, read by pinocchio and yourdfpy: the same robot, the same Jacobian, the same measure."""

import io
from xml.etree import ElementTree

import numpy as np
import pinocchio
import pytest
import yourdfpy

from formulations import measures
from formulations.realise.from_jacobian import realise
from formulations.realise.write_urdf import urdf


def displacements(arm):
    rng = np.random.default_rng(0)
    return [np.zeros(arm.joints), *rng.uniform(-3, 3, (3, arm.joints))]


def pinocchio_jacobian(text, q):
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    tip = model.getFrameId("tip")
    frame = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
    matrix = pinocchio.computeFrameJacobian(model, data, q, tip, frame)
    return np.array(matrix), np.array(data.oMf[tip].homogeneous)


def test_pinocchio_finds_the_same_jacobian(arm):
    text = urdf(arm)
    for q in displacements(arm):
        matrix, pose = pinocchio_jacobian(text, q)
        np.testing.assert_allclose(matrix, arm.full_jacobian(q), atol=1e-9)
        np.testing.assert_allclose(pose, arm.pose(q), atol=1e-9)


def test_yourdfpy_finds_the_same_jacobian(arm):
    """It knows poses only: columns from its joint frames and axes."""
    robot = yourdfpy.URDF.load(io.StringIO(urdf(arm)), build_scene_graph=True)
    for q in displacements(arm):
        robot.update_cfg(q)
        tip = robot.get_transform("tip", "base")
        np.testing.assert_allclose(tip, arm.pose(q), atol=1e-9)
        for i, joint in enumerate(robot.actuated_joints):
            frame = robot.get_transform(joint.child, "base")
            axis = frame[:3, :3] @ joint.axis
            moves = np.cross(axis, tip[:3, 3] - frame[:3, 3])
            slides = joint.type == "prismatic"
            column = [*axis, 0, 0, 0] if slides else [*moves, *axis]
            np.testing.assert_allclose(column, arm.full_jacobian(q)[:, i], atol=1e-9)


def test_the_measure_of_the_robot_is_that_of_the_jacobian(optimum):
    matrix, _ = pinocchio_jacobian(urdf(realise(optimum)), np.zeros(7))
    np.testing.assert_allclose(matrix, optimum, atol=1e-9)
    worst = measures.worst_case_sigma(optimum)
    assert measures.worst_case_sigma(matrix) == pytest.approx(worst, abs=1e-9)


def test_every_link_can_be_seen_and_bodies_lie_where_they_should(arm):
    robot = ElementTree.fromstring(urdf(arm))
    links = {link.get("name"): link for link in robot.findall("link")}
    assert list(links) == ["base", *(f"link{i}" for i in range(arm.joints)), "tip"]
    assert all(link.find("visual/geometry") is not None for link in links.values())
    places = np.vstack([arm.points, arm.end_effector])
    for i in range(arm.joints):
        *_, body = links[f"link{i}"].findall("visual")
        if body.find("material").get("name") != "link":
            np.testing.assert_array_equal(places[i], places[i + 1])  # nothing to span
            continue
        centre = np.array(body.find("origin").get("xyz").split(), dtype=float)
        _, pitch, yaw = map(float, body.find("origin").get("rpy").split())
        along = [np.cos(yaw) * np.sin(pitch), np.sin(yaw) * np.sin(pitch), np.cos(pitch)]
        half = float(body.find("geometry/cylinder").get("length")) / 2
        np.testing.assert_allclose(centre - half * np.array(along), 0, atol=1e-12)
        np.testing.assert_allclose(2 * centre, places[i + 1] - places[i], atol=1e-12)
