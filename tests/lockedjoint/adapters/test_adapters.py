"""The worst case of one arm inside pink, mink, placo and JAX, against differences taken there.

The arm has continuous joints, which pinocchio counts as (cos θ, sin θ), and a finger.
"""

import re
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import lockedjoint as lj
from lockedjoint.robot import Robot

AXES = ("0 0 1", "0 1 0", "0 0 1", "0 1 0")
JOINTS = "".join(
    f"""<joint name="j{k}" type="{"continuous" if k % 2 else "revolute"}"><parent link="l{k}"/>
<child link="l{k + 1}"/><origin xyz="0.1 0.05 0.3"/><axis xyz="{axis}"/>
<limit lower="-3" upper="3" effort="1" velocity="2"/></joint>"""
    for k, axis in enumerate(AXES)
)
INERTIA = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
MASS = f'<inertial><mass value="1"/>{INERTIA}</inertial>'
LINKS = "".join(
    f'<link name="{n}">{MASS}</link>' for n in ("l1", "l2", "l3", "l4", "tool", "f")
)
URDF = f"""<robot name="arm"><link name="l0"/>{LINKS}
<joint name="finger" type="prismatic"><parent link="l0"/><child link="f"/><axis xyz="1 0 0"/>
<limit lower="0" upper="1" effort="1" velocity="2"/></joint>{JOINTS}
<joint name="t" type="fixed"><parent link="l4"/><child link="tool"/>
<origin xyz="0.2 0 0.1"/></joint>
</robot>"""
TARGET, STEP = 5.0, 1e-6  # never reached, so that e = s − target


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    path = tmp_path_factory.mktemp("adapters") / "arm.urdf"
    path.write_text(URDF, encoding="utf-8")
    return Robot(path, "tool", task="position")


@pytest.fixture
def arm(robot):
    return robot.arm


@pytest.fixture(params=range(3))
def angles(request):
    return np.random.default_rng(request.param).uniform(-2.9, 2.9, len(AXES))


def slopes(value, size):
    """Central differences of a function of a tangent vector."""
    steps = STEP * np.eye(size)
    return np.array([(value(step) - value(-step)) / (2 * STEP) for step in steps])


def pink(text=URDF):
    """Pink's task, its model, and its configuration at angles by name moved by a tangent."""
    host = pytest.importorskip("pink", reason="install pin-pink")
    pin = pytest.importorskip("pinocchio")
    from lockedjoint.adapters.pink import WorstCaseTask

    model = pin.buildModelFromXML(text)

    def at(angles, tangent):
        q = pin.neutral(model)
        for name, angle in angles.items():
            joint = model.joints[model.getJointId(name)]
            q[joint.idx_q : joint.idx_q + joint.nq] = (
                angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
            )
        return host.Configuration(model, model.createData(), pin.integrate(model, q, tangent))

    return WorstCaseTask, model, at


def mink():
    """The same of mink."""
    host = pytest.importorskip("mink", reason="install mink")
    mujoco = pytest.importorskip("mujoco")
    from lockedjoint.adapters.mink import MinkWorstCaseTask

    model = mujoco.MjModel.from_xml_string(URDF)

    def at(angles, tangent):
        q = model.qpos0.copy()
        for name, angle in angles.items():
            q[model.joint(name).qposadr] = angle
        mujoco.mj_integratePos(model, q, tangent, 1.0)
        configuration = host.Configuration(model)
        configuration.update(q)
        return configuration

    return MinkWorstCaseTask, model, at


@pytest.mark.parametrize("host", [pink, mink])
def test_a_task_and_its_slope(robot, arm, angles, host):
    task_class, model, at = host()
    named = dict(zip(arm.chain.names, angles, strict=True))
    task, here = task_class(robot, model, TARGET), at(named, np.zeros(model.nv))
    smooth = arm.smooth_worst_case(angles)[0]
    assert task.compute_error(here) == pytest.approx(smooth - TARGET, abs=1e-12)
    slope = slopes(lambda step: task.compute_error(at(named, step))[0], model.nv)
    assert task.compute_jacobian(here)[0] == pytest.approx(slope, abs=1e-6)
    assert task_class(robot, model, 0.0).compute_error(here) == 0.0
    if host is pink:
        from lockedjoint.adapters.pink import WorstCaseBarrier

        barrier = WorstCaseBarrier(robot, model, 0.1)
        assert barrier.compute_barrier(here) == pytest.approx(smooth - 0.1, abs=1e-12)
        assert barrier.compute_jacobian(here)[0] == pytest.approx(slope, abs=1e-6)


@pytest.mark.parametrize("host", [pink, mink])
def test_a_compiled_task(robot, angles, host):
    task_class, model, at = host()
    here = at(dict(zip(robot.arm.chain.names, angles, strict=True)), np.zeros(model.nv))
    plain = task_class(robot, model, TARGET)
    quick = task_class(robot, model, TARGET, compiled=True)
    assert quick.compute_error(here) == pytest.approx(plain.compute_error(here), abs=1e-12)
    row = quick.compute_jacobian(here)
    assert row == pytest.approx(plain.compute_jacobian(here), abs=1e-9)
    row[:] = 0.0  # it is the caller's own
    assert np.any(quick.compute_jacobian(here))
    with pytest.raises(lj.InputError, match="compiled is"):
        task_class(robot, model, TARGET, compiled=1)


def test_placo_has_no_half_spaces_of_continuous_joints(robot, tmp_path):
    placo = pytest.importorskip("placo", reason="install placo")
    from lockedjoint.adapters.placo import WorstCaseConstraint

    (tmp_path / "arm.urdf").write_text(URDF, encoding="utf-8")
    wrapper = placo.RobotWrapper(str(tmp_path / "arm.urdf"), placo.Flags.ignore_collisions)
    with pytest.raises(lj.InputError, match="j1"):
        WorstCaseConstraint(robot, placo.KinematicsSolver(wrapper), TARGET)


@pytest.mark.parametrize("weight", [1.0, None])
def test_placo(robot, arm, angles, weight, tmp_path):
    """A step gains what it must, and no less: where only regularisation stands against it."""
    placo = pytest.importorskip("placo", reason="install placo")
    from lockedjoint.adapters.placo import WorstCaseConstraint

    (tmp_path / "arm.urdf").write_text(URDF.replace("continuous", "revolute"), encoding="utf-8")
    wrapper = placo.RobotWrapper(str(tmp_path / "arm.urdf"), placo.Flags.ignore_collisions)
    solver = placo.KinematicsSolver(wrapper)
    solver.mask_fbase(True)
    solver.add_regularization_task(1e-9)
    for name, angle in zip(arm.chain.names, 0.8 * angles, strict=True):
        wrapper.set_joint(name, angle)
    wrapper.update_kinematics()
    task = WorstCaseConstraint(robot, solver, TARGET, weight, gain=1e-5)
    before = task.update()
    assert before == pytest.approx(float(arm.smooth_worst_case(0.8 * angles)[0]))
    solver.solve(True)
    wrapper.update_kinematics()
    gained = task.update() - before
    assert gained == pytest.approx(1e-5 * (TARGET - before), rel=0.01)


def test_jax(robot, arm, angles):
    jax = pytest.importorskip("jax", reason="install jax")
    from lockedjoint.adapters import jax as adapter

    with jax.enable_x64(True):
        many = np.stack([angles, angles[::-1]])
        assert adapter.jacobian(robot)(many) == pytest.approx(
            np.stack([arm.jacobian(q) for q in many]), abs=1e-12
        )
        sigma = jax.jit(adapter.worst_case(robot))(many)
        assert sigma == pytest.approx(arm.worst_case(many)[0], abs=1e-12)
        smooth = adapter.smooth_worst_case(robot, 0.02)
        value, slope = arm.smooth_worst_case(many, 0.02)
        assert smooth(many) == pytest.approx(value, abs=1e-12)
        assert jax.vmap(jax.grad(smooth))(many) == pytest.approx(slope, abs=1e-9)
        second = slopes(lambda step: arm.smooth_worst_case(angles + step, 0.02)[1], 4)
        assert jax.hessian(smooth)(angles) == pytest.approx(second, abs=1e-4)
        for wrong in (angles[:3], many.T, np.nan * angles, "abcd", angles.astype(np.float32)):
            with pytest.raises(lj.InputError, match="configurations is"):
                smooth(wrong)
        with pytest.raises(lj.InputError, match=r"shape \(3,\)"):
            jax.jit(jax.grad(smooth))(angles[:3])
        single = adapter.worst_case(robot, single=True)(angles.astype(np.float32))
        assert single == pytest.approx(arm.worst_case(angles)[0], abs=1e-5)
    with pytest.raises(lj.InputError, match="float64"):  # to which JAX turns them in silence
        adapter.worst_case(robot)(angles)
    with pytest.raises(lj.InputError, match="width is"):
        adapter.smooth_worst_case(robot, -1.0)


BAD = [
    *(("target", value) for value in (np.nan, -0.1, np.inf, "0.2", None)),
    *(("gain", value) for value in (np.nan, -0.1, 1.1, "1", True)),
    *(("cost", value) for value in (-1.0, [1.0])),
    *(("width", value) for value in (0.0, np.nan)),
    *(("robot", None), ("model", "arm.urdf"), ("lm_damping", -1.0)),
]


@pytest.mark.parametrize("host", [pink, mink])
@pytest.mark.parametrize(("name", "value"), BAD)
def test_what_no_task_takes(robot, host, name, value):
    task_class, model, _ = host()
    with pytest.raises(lj.InputError, match=f"{name} is "):
        task_class(**{"robot": robot, "model": model, "target": 0.2, name: value})
    if host is pink and name in ("target", "width", "robot", "model"):
        from lockedjoint.adapters.pink import WorstCaseBarrier

        named = "least" if name == "target" else name
        with pytest.raises(lj.InputError, match=f"{named} is "):
            WorstCaseBarrier(**{"robot": robot, "model": model, "least": 0.1, named: value})


def test_a_host_that_is_missing_is_named(monkeypatch):
    """And the face loads no other host."""
    for host in ("pink", "mink", "placo", "jax"):
        monkeypatch.setitem(sys.modules, host, None)
        monkeypatch.delitem(sys.modules, f"lockedjoint.adapters.{host}", raising=False)
        with pytest.raises(lj.InputError, match=f"{host} is missing: .*pip install"):
            import_module(f"lockedjoint.adapters.{host}")


def test_a_joint_that_the_model_has_not_is_named(robot):
    task_class, model, _ = pink(URDF.replace('"j2"', '"elbow"'))
    with pytest.raises(lj.InputError, match="j2"):
        task_class(robot, model, TARGET)


@pytest.mark.slow
def test_the_page_follows_its_line_in_pink_and_mink(lockedjoint, tmp_path):
    """Each of its runs asserts that the tool is off by less than 0.1 mm."""
    for library in ("pink", "mink", "daqp", "matplotlib", "pinocchio"):
        pytest.importorskip(library)
    page = Path(__file__).parents[3] / "docs" / "howto" / "use_in_other_tools.md"
    text = page.read_text("utf-8").partition("## JAX")[0]
    cells = re.findall(
        r"^```\{code-cell\} ipython3\n(.*?)^```$", text, re.MULTILINE | re.DOTALL
    )
    code = "\n".join(re.sub(r"\A---\n.*?\n---\n", "", cell, flags=re.DOTALL) for cell in cells)
    said = lockedjoint.python(code, tmp_path, MPLBACKEND="agg")
    least = [float(found) for found in re.findall(r"least σ ([0-9.]+)", said)]
    assert len(least) == 4
    assert least[1] > 2 * least[0]
    assert least[3] > 2 * least[2]
