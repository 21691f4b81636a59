"""URDF, read by pinocchio, yourdfpy and MuJoCo: the same robot, Jacobian and masses."""

import io
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio
import pytest
import yourdfpy

from formulations import measures
from formulations.realise.from_jacobian import realise
from formulations.realise.links import LINK_RADIUS, room, slide_apart
from formulations.realise.write_urdf import JOINT_LENGTH, JOINT_RADIUS, MASS, urdf
from nlp.errors import InputError


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


def mass_matrix(text, q):
    model = pinocchio.buildModelFromXML(text)
    return np.array(pinocchio.crba(model, model.createData(), q, pinocchio.Convention.LOCAL))


def test_mujoco_finds_the_same_jacobian_and_the_same_masses(arm):
    model = mujoco.MjModel.from_xml_string(urdf(arm))
    data = mujoco.MjData(model)
    for q in displacements(arm):
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        linear, angular = np.zeros((2, 3, arm.joints))
        place = arm.pose(q)[:3, 3]
        mujoco.mj_jac(model, data, linear, angular, place, model.nbody - 1)
        found = np.vstack([linear, angular])
        np.testing.assert_allclose(found, arm.full_jacobian(q), atol=1e-9)
        mass = np.zeros((arm.joints, arm.joints))
        for row, unit in zip(mass, np.eye(arm.joints), strict=True):
            mujoco.mj_mulM(model, data, row, unit)
        np.testing.assert_allclose(mass, mass_matrix(urdf(arm), q), rtol=1e-6, atol=1e-9)


def test_mujoco_steps_every_arm(arm):
    """For a fifth of a second, under gravity, from where links do not collide at once."""
    model = mujoco.MjModel.from_xml_string(urdf(arm))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    if not room(arm).touching:
        assert data.ncon == 0
    for _ in range(100):
        mujoco.mj_step(model, data)
    assert data.time == pytest.approx(0.2)  # it is set back to 0 where a state is not finite
    assert all(np.all(np.isfinite(value)) for value in (data.qpos, data.qvel, data.qacc))
    assert data.warning.number.sum() == 0


def test_inertias_are_those_of_the_solid_bodies(optimum):
    """Against pinocchio's own formulas for cylinders, put together by it."""
    arm = realise(optimum)
    model = pinocchio.buildModelFromXML(urdf(arm))
    size, places = arm.size, np.vstack([arm.points, arm.end_effector])
    for i in range(6):
        span = places[i + 1] - places[i]
        length = np.linalg.norm(span)
        shapes = [
            (JOINT_RADIUS * size, JOINT_LENGTH * size, np.zeros(3), arm.directions[i]),
            (LINK_RADIUS * size, length, span / 2, span / length),
        ]
        volumes = np.array([radius**2 * long for radius, long, _, _ in shapes])
        total = pinocchio.Inertia.Zero()
        for (radius, long, centre, axis), share in zip(
            shapes, volumes / volumes.sum(), strict=True
        ):
            turn = pinocchio.Quaternion.FromTwoVectors(np.array([0.0, 0, 1]), axis).matrix()
            own = pinocchio.Inertia.FromCylinder(MASS * share, radius, long)
            total += pinocchio.SE3(turn, centre).act(own)
        np.testing.assert_allclose(model.inertias[i + 1].matrix(), total.matrix(), atol=1e-12)


@pytest.mark.parametrize("length", [1e-6, 1e6])
def test_sizes_that_cannot_be_stepped_are_refused(optimum, length):
    with pytest.raises(InputError, match="size of the manipulator is"):
        urdf(realise(optimum, length=length))


def test_what_slides_apart_stays_the_same_robot():
    arm = realise(np.array([[-1.0, 0.2, 0.9, 0.4], [0.0, 1.0, 0.5, -1.0]]))
    text = urdf(slide_apart(arm))
    matrix, _ = pinocchio_jacobian(text, np.zeros(4))
    np.testing.assert_allclose(matrix[:2], arm.jacobian(), atol=1e-12)
