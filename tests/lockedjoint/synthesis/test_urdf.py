"""URDF, read by pinocchio, MuJoCo, Bullet and Drake: the same robot, Jacobian and masses."""

from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio
import pytest

from lockedjoint.nlp.errors import InputError
from lockedjoint.synthesis.from_jacobian import realise
from lockedjoint.synthesis.links import LINK_RADIUS, link_gap
from lockedjoint.synthesis.write_urdf import JOINT_LENGTH, JOINT_RADIUS, MASS_KG, urdf


def displacements(arm):
    rng = np.random.default_rng(0)
    return [np.zeros(arm.joints), *rng.uniform(-3, 3, (3, arm.joints))]


def test_pinocchio_finds_the_same_jacobian(arm):
    model = pinocchio.buildModelFromXML(urdf(arm))
    data, tip = model.createData(), model.getFrameId("tip")
    for q in displacements(arm):
        frame = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
        matrix = pinocchio.computeFrameJacobian(model, data, q, tip, frame)
        np.testing.assert_allclose(matrix, arm.full_jacobian(q), atol=1e-9)
        np.testing.assert_allclose(data.oMf[tip].homogeneous, arm.pose(q), atol=1e-9)


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
    if not link_gap(arm).touching:
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
        volume = sum(radius**2 * long for radius, long, _, _ in shapes)
        total = pinocchio.Inertia.Zero()
        for radius, long, centre, axis in shapes:
            turn = pinocchio.Quaternion.FromTwoVectors(np.array([0.0, 0, 1]), axis).matrix()
            mass = MASS_KG * radius**2 * long / volume
            own = pinocchio.Inertia.FromCylinder(mass, radius, long)
            total += pinocchio.SE3(turn, centre).act(own)
        np.testing.assert_allclose(model.inertias[i + 1].matrix(), total.matrix(), atol=1e-12)


@pytest.mark.parametrize("length", [1e-6, 1e6])
def test_sizes_that_cannot_be_stepped_are_refused(optimum, length):
    with pytest.raises(InputError, match="size of the manipulator is"):
        urdf(realise(optimum, metres=length))


# Across every axis of the planar arms, too.
GRAVITY = (3.0, -5.0, -8.0)


def solids(arm):
    """How many bodies each link collides with."""
    links = ElementTree.fromstring(urdf(arm)).findall("link")
    return {one.get("name"): len(one.findall("collision")) for one in links}


@pytest.mark.long
def test_pybullet_loads_and_steps_every_arm(arm, tmp_path):
    """The same poses and masses, and a fifth of a second under gravity."""
    bullet = pytest.importorskip("pybullet", reason="the extra simulators")
    path = tmp_path / "arm.urdf"
    path.write_text(urdf(arm), encoding="utf-8")
    world = bullet.connect(bullet.DIRECT)
    try:
        flags = bullet.URDF_USE_INERTIA_FROM_FILE
        robot = bullet.loadURDF(str(path), useFixedBase=True, flags=flags)
        infos = [bullet.getJointInfo(robot, k) for k in range(bullet.getNumJoints(robot))]
        moving = [one[0] for one in infos if one[2] != bullet.JOINT_FIXED]
        assert len(moving) == arm.joints
        for k, found in enumerate(moving):
            assert len(bullet.getCollisionShapeData(robot, found)) == solids(arm)[f"link{k}"]
        for q in displacements(arm):
            for joint, value in zip(moving, q.tolist(), strict=True):
                bullet.resetJointState(robot, joint, value)
            state = bullet.getLinkState(robot, infos[-1][0], computeForwardKinematics=True)
            np.testing.assert_allclose(state[4], arm.pose(q)[:3, 3], atol=1e-6)
            mass = np.array(bullet.calculateMassMatrix(robot, q.tolist()))
            wanted = mass_matrix(urdf(arm), q)
            slack = 1e-5 * np.abs(wanted).max()
            np.testing.assert_allclose(mass, wanted, rtol=1e-4, atol=slack)
        for joint in moving:
            bullet.resetJointState(robot, joint, 0.0)
        bullet.setGravity(*GRAVITY)
        for _ in range(48):
            bullet.stepSimulation()
        states = np.array([one[:2] for one in bullet.getJointStates(robot, moving)])
        assert np.all(np.isfinite(states))
        assert np.any(states)
    finally:
        bullet.disconnect(world)


@pytest.mark.long
def test_drake_loads_and_steps_every_arm(arm):
    """The same Jacobian and masses, and a fifth of a second under gravity."""
    pytest.importorskip("pydrake", reason="the extra simulators")
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
    from pydrake.multibody.tree import JacobianWrtVariable
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=1e-3)
    plant.mutable_gravity_field().set_gravity_vector(np.array(GRAVITY))
    Parser(plant).AddModelsFromString(urdf(arm), "urdf")
    ground, tip = plant.world_frame(), plant.GetFrameByName("tip")
    plant.WeldFrames(ground, plant.GetFrameByName("base"))
    plant.Finalize()
    diagram = builder.Build()
    for name, count in solids(arm).items():
        assert len(plant.GetCollisionGeometriesForBody(plant.GetBodyByName(name))) == count
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    for q in displacements(arm):
        plant.SetPositions(own, q)
        found = plant.CalcJacobianSpatialVelocity(
            own, JacobianWrtVariable.kQDot, tip, np.zeros(3), ground, ground
        )
        found = np.vstack([found[3:], found[:3]])
        np.testing.assert_allclose(found, arm.full_jacobian(q), atol=1e-9)
        wanted = mass_matrix(urdf(arm), q)
        np.testing.assert_allclose(plant.CalcMassMatrix(own), wanted, rtol=1e-6, atol=1e-9)
    plant.SetPositions(own, np.zeros(arm.joints))
    Simulator(diagram, context).AdvanceTo(0.2)
    state = plant.GetPositionsAndVelocities(own)
    assert np.all(np.isfinite(state))
    assert np.any(state)
