"""Robots from elsewhere: each against the library that it comes from."""

import json
import re
import subprocess
import sys
from io import StringIO

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from scipy.spatial.transform import Rotation

from lockedjoint.commands.app import app
from lockedjoint.kinematics.chain_between import chain_between
from lockedjoint.kinematics.read_dh_table import dh_tree
from lockedjoint.kinematics.read_robot import read_robot
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.errors import FileError, InputError
from lockedjoint.robot import Robot
from results.robots.survey import ARMS as SURVEY
from tests.made_robots import SMALL, real, toolbox_robot

EXACT = 1e-12
POINTS = 20


def drawn(arm, seed=3):
    rng = np.random.default_rng(seed)
    return [arm.sample(rng) for _ in range(POINTS)]


def test_a_model_of_yourdfpy_is_its_file(made, tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(made.offset_arm())
    ours = Robot(str(path)).arm
    theirs = Robot(yourdfpy.URDF.load(str(path)), "l7").arm
    assert theirs == ours == RobotArm(chain_between(read_robot(path), "l7"))
    assert Robot(read_robot(path)).arm == ours


def test_mimicry_and_missing_limits_of_yourdfpy(made):
    mimic = '<mimic joint="a" multiplier="-0.5" offset="0.2"/>'
    joints = [made.joint("a", "0", "1"), made.joint("b", "1", "2", "prismatic", limit="")]
    text = made.urdf([*joints, made.joint("c", "2", "3", mimic=mimic)])
    model = yourdfpy.URDF.load(StringIO(text))
    chain = chain_between(read_robot(model), "3")
    assert chain == chain_between(made.tree(text), "3")
    assert (chain.names, dict(chain.immobile)) == (("a",), {"b": 0.0})
    model.robot.joints[0].origin[0, 3] = np.nan
    with pytest.raises(InputError, match="origin of joint a"):
        read_robot(model)


@pytest.mark.parametrize("name", ["Franka", "KUKA", "UFactory", "TIAGo, torso", "PR2, torso"])
def test_a_model_of_pinocchio_is_its_file(name, made):
    declared = real(name)
    model = pin.buildModelFromUrdf(str(declared.path), mimic=True)
    arm = Robot(model, declared.tip, task=declared.task).arm
    file = declared.arm()
    assert arm.chain.names == file.chain.names
    assert np.array(arm.bounds) == pytest.approx(np.array(file.bounds))
    for point in drawn(arm):
        ours = arm.metric_jacobian(point)
        assert ours == pytest.approx(file.metric_jacobian(point), abs=EXACT)
        assert ours == pytest.approx(made.of_pinocchio(model, arm.chain, point), abs=EXACT)


def built(*joints):
    """A pinocchio model without a single frame of a body, joints j0, j1, …"""
    model, last = pin.Model(), 0
    for k, joint in enumerate(joints):
        place = pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.1 * k])), np.array([0.1, 0.2, 0.3]))
        last = model.addJoint(last, joint, place, f"j{k}")
    frame = pin.Frame("tool", last, pin.SE3(np.eye(3), np.ones(3)), pin.FrameType.OP_FRAME)
    model.addFrame(frame)
    return model


def test_every_kind_of_pinocchio_joint(made):
    axis = np.array([1.0, 2.0, 2.0]) / 3
    turning = (pin.JointModelRX(), pin.JointModelRUBZ(), pin.JointModelRevoluteUnaligned(axis))
    model = built(*turning, pin.JointModelPrismaticUnaligned(axis), pin.JointModelPY())
    arm = Robot(model, "tool", task="position", length=1.0).arm
    assert arm.chain.prismatic == (False, False, False, True, True)
    for point in drawn(arm):
        theirs = made.of_pinocchio(model, arm.chain, point)
        assert arm.metric_jacobian(point) == pytest.approx(theirs, abs=EXACT)


ROWS = (
    ("revolute", 0.31, 0.10, -1.1, 0.2),
    ("prismatic", 0.12, 0.05, 0.7, -0.4),
    ("revolute", -0.20, 0.00, 1.5707963267948966, 0.0),
    ("fixed", 0.07, 0.02, 0.3, 0.9),
    ("revolute", 0.00, 0.25, 0.0, 2.0),
    ("revolute", 0.11, -0.15, -0.6, -0.3),
)


def table(convention, degrees=False):
    unit, scale = ("deg", 180 / np.pi) if degrees else ("rad", 1.0)
    lines = [f"# convention: {convention}", f"kind,d,a,alpha_{unit},theta_{unit}"]
    lines += [
        f"{kind},{d!r},{a!r},{alpha * scale!r},{theta * scale!r}"
        for kind, d, a, alpha, theta in ROWS
    ]
    return "\n".join(lines).encode()


@pytest.mark.parametrize("convention", ["standard", "modified"])
@pytest.mark.parametrize("degrees", [False, True])
def test_tables_agree_with_the_toolbox(convention, degrees):
    arm = Robot(dh_tree(table(convention, degrees)), task="position", length=1.0).arm
    assert arm.chain.prismatic == (False, True, False, False, False)
    theirs = toolbox_robot(convention, ROWS)
    for point in drawn(arm):
        full = theirs.jacob0(np.insert(point, 3, 0.0))
        ours = arm.metric_jacobian(point)
        assert ours == pytest.approx(np.delete(full, 3, axis=1), abs=EXACT)


def test_names_limits_and_speeds_of_a_table(tmp_path):
    path = tmp_path / "Wrist.CSV"
    path.write_text(
        "# made by hand\n#Convention: Modified\n"
        "joint,kind,a,alpha_deg,d,theta_rad,lower_deg,upper_deg,velocity_rad\n"
        "pan,R,0,0,0.3,0,-90,180,2\nlift,P,0,90,0.1,0,0,0.5,\n,r,0.2,0,0,0,,,\n",
        "utf-8-sig",
    )
    arm = Robot(path, task="vx,vz", length=1.0).arm
    assert arm.chain.robot == "Wrist"
    assert arm.chain.names == ("pan", "lift", "joint_3")
    lower, upper = arm.bounds
    assert lower.tolist() == [-np.pi / 2, 0.0, -np.inf]
    assert upper.tolist() == [np.pi, 0.5, np.inf]
    assert [one.velocity for one in arm.chain.joints] == [2.0, np.inf, np.inf]


MJCF = """
<mujoco model="everything">
  <compiler angle="radian" eulerseq="zyx" meshdir="nowhere" autolimits="true"/>
  <default><joint axis="0 1 0"/><default class="slider">
    <joint type="slide" axis="1 0 1" range="-0.2 0.3"/><geom density="5"/></default></default>
  <asset><mesh name="m" file="missing.stl"/><texture name="t" file="/etc/hostname"/></asset>
  <extension><plugin plugin="mujoco.elasticity.cable"/></extension>
  <worldbody>
    <light pos="0 0 3"/><geom type="plane" size="1 1 1"/>
    <body name="base" pos="0.1 0.2 0.3" euler="0.3 0.2 -0.5">
      <body name="shoulder" pos="0 0 0.2" quat="1 0.2 -0.3 0.5">
        <joint name="pan" pos="0.05 0.02 -0.1" range="-2 2" ref="0.4"/>
        <joint name="tilt" axis="1 1 0" pos="0 0.1 0"/>
        <geom type="mesh" mesh="m"/>
        <frame pos="0.1 0 0" axisangle="0 0 1 0.7">
          <body name="arm" pos="0.3 0 0">
            <inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
            <joint name="slide" class="slider" ref="0.1"/>
            <body name="hand" pos="0 0.1 0.2" xyaxes="0 1 0 0 0 1">
              <joint name="roll" axis="0 0 1" range="-1 1"/>
              <joint name="follow" axis="1 0 0" ref="0.2"/>
              <site name="hand" pos="0.1 0.2 0.05" euler="0.1 0.2 0.3"/>
            </body>
          </body>
        </frame>
      </body>
    </body>
    <body name="ball"><freejoint/><geom size="0.1"/></body>
  </worldbody>
  <equality><joint joint1="follow" joint2="roll" polycoef="0.1 -0.5 0 0 0"/></equality>
  <actuator><motor joint="pan"/></actuator>
</mujoco>
"""


def mjcf(tmp_path, text=MJCF, name="robot.xml"):
    path = tmp_path / name
    path.write_text(text)
    return path


def plain(text=MJCF):
    """The same, compiled by mujoco as it is, without the files that are not there."""
    text = re.sub('<(plugin|mesh|texture|geom type="mesh") [^>]*/>', "", text)
    text = text.replace("<compiler ", '<compiler boundmass="1" boundinertia="1" ')
    return mujoco.MjModel.from_xml_string(text)


def of_mujoco(model, q, jacobian, place):
    """Columns of mujoco's Jacobian of a site or body, by joint, at positions by joint."""
    data = mujoco.MjData(model)
    for name, value in q.items():
        data.qpos[model.joint(name).qposadr[0]] = value
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    full = np.zeros((2, 3, model.nv))
    jacobian(model, data, *full, place)
    return {name: full.reshape(6, -1)[:, model.joint(name).dofadr[0]] for name in q}


def test_mjcf_agrees_with_mujoco(tmp_path):
    """Defaults, frames, several joints to a body, anchors, references, an equality."""
    arm = Robot(mjcf(tmp_path), "hand (site)", task="position", length=1.0).arm
    assert arm.chain.names == ("pan", "tilt", "slide", "roll")
    assert arm.chain.robot == "everything"
    lower, upper = arm.bounds
    assert lower == pytest.approx([-2, -np.inf, -0.2, -1])
    assert upper == pytest.approx([2, np.inf, 0.3, 1])
    model = plain()
    for point in drawn(arm):
        q = dict(zip(arm.chain.names, point, strict=True))
        # follow - 0.2 = 0.1 - 0.5 roll
        q["follow"] = 0.3 - 0.5 * q["roll"]
        columns = of_mujoco(model, q, mujoco.mj_jacSite, model.site("hand").id)
        columns["roll"] = columns["roll"] - 0.5 * columns.pop("follow")
        theirs = np.column_stack(list(columns.values()))
        assert arm.metric_jacobian(point) == pytest.approx(theirs, abs=EXACT)


def test_a_model_of_mujoco_is_its_file(tmp_path):
    settings = {"tip": "hand", "task": "position", "length": 1.0}
    assert Robot(plain(), **settings).arm == Robot(mjcf(tmp_path), **settings).arm


@pytest.mark.parametrize(("name", "tip"), [("Franka", "panda_link7"), ("UFactory", "link7")])
def test_real_arms_in_mujoco(name, tip):
    """Arms that mujoco has compiled from their URDF: its Jacobians, and those of the URDF."""
    declared = real(name)
    text = declared.path.read_text()
    for part in ("visual", "collision"):
        text = re.sub(f"<{part}\\b.*?</{part}>", "", text, flags=re.DOTALL)
    model = mujoco.MjModel.from_xml_string(text)
    arm, file = Robot(model, tip).arm, Robot(declared.path, tip).arm
    assert arm.chain.names == file.chain.names
    for point in drawn(arm):
        q = dict(zip(arm.chain.names, point, strict=True))
        columns = of_mujoco(model, q, mujoco.mj_jacBody, model.body(tip).id)
        ours = arm.metric_jacobian(point)
        assert ours == pytest.approx(np.column_stack(list(columns.values())), abs=EXACT)
        assert ours == pytest.approx(file.metric_jacobian(point), abs=EXACT)


LOOPS = {
    "coupled by an equality": '<connect body1="d" body2="world" anchor="0 0 0"/>',
    "joint c is coupled": '<weld body1="d" body2="b"/>',
    "joint b is coupled": '<joint joint1="b" joint2="a" polycoef="0 1 0.5 0 0"/>',
    "joint a is coupled": '<joint joint1="a"/>',
}


@pytest.mark.parametrize("sentence", LOOPS)
def test_coupled_joints_are_in_no_chain(sentence, tmp_path):
    """Ignored, they would be counted as joints that move by themselves."""
    path = mjcf(tmp_path, SMALL.replace("<equality>", f"<equality>{LOOPS[sentence]}"))
    with pytest.raises(InputError, match=sentence):
        _ = Robot(path, task="vx").arm
    off = LOOPS[sentence].replace("/>", ' active="false"/>')
    path = mjcf(tmp_path, SMALL.replace("<equality>", f"<equality>{off}"))
    assert Robot(path, task="vx").arm.size == 3


# What a tendon goes through, and the joints that an equality about it couples.
TENDONS = {
    '<fixed name="t"><joint joint="a" coef="1"/><joint joint="b" coef="-1"/></fixed>': "ab",
    '<spatial name="t"><site site="base"/><site site="mid"/></spatial>': "ab",
    '<spatial name="t"><site site="mid"/><geom geom="drum"/><site site="mid2"/></spatial>': "c",
    '<spatial name="t"><site site="mid"/><site site="mid2"/></spatial>': "",
    '<fixed name="t"><joint joint="d" coef="1"/></fixed>': "",
}
ARM_OF_THREE = """<mujoco><worldbody><site name="base"/>
<body name="a"><joint name="a" axis="1 0 0"/><geom size="0.1"/>
<body name="b" pos="0 0 1"><joint name="b" axis="0 1 0"/><geom size="0.1"/>
<site name="mid"/><site name="mid2" pos="0 1 0"/>
<body name="c" pos="0 0 1"><joint name="c" axis="1 0 0"/><geom name="drum" size="0.1"/>
</body></body></body>
<body name="d"><joint name="d"/><geom size="0.1"/></body></worldbody>
<tendon>{}<spatial name="other"><site site="base"/><site site="mid"/></spatial></tendon>
<equality><tendon tendon1="t" {}/></equality></mujoco>"""


@pytest.mark.parametrize("tendon", TENDONS)
def test_joints_that_a_tendon_couples_are_in_no_chain(tendon, tmp_path):
    """The same from the file and from the model of it, which knew nothing of tendons."""
    for active, expected in (("", TENDONS[tendon]), ('active="false"', "")):
        text = ARM_OF_THREE.format(tendon, active)
        path = mjcf(tmp_path, text)
        for source in (path, mujoco.MjModel.from_xml_string(text)):
            tree = read_robot(source)
            kinds = {joint.name: joint.type for joint in tree.joints}
            coupled = [name for name in "abc" if kinds[name] == "coupled by an equality"]
            assert coupled == list(expected)
            if expected:
                with pytest.raises(InputError, match="coupled by an equality"):
                    assert Robot(source, "c", task="vy,vz").arm
            else:
                assert Robot(source, "c", task="vy,vz").arm.size == 3


def test_names_that_are_made_are_not_those_of_the_file(tmp_path, made):
    """What has no name gets one that nothing else has."""
    text = """<mujoco><worldbody><body name="body_2"><joint name="joint_1"/><geom size="0.1"/>
    <body pos="1 0 0"><joint axis="0 1 0"/><joint name="after joint_1"/><site/><geom size="1"/>
    <body name="fixed site_0" pos="0 0 1"><joint name="fixed body_2"/><site name="site_0"/>
    <site name="fixed site_0"/><geom size="0.1"/></body></body></body></worldbody></mujoco>"""
    tree = read_robot(mjcf(tmp_path, text))
    assert {"body_2", "body_2'", "site_0", "site_0'"} <= set(tree.links)
    assert "fixed site_0 (site)" in tree.links
    moving = [one.name for one in tree.joints if one.type != "fixed"]
    assert moving[:2] == ["joint_1", "joint_1'"]
    table = "# convention: standard\njoint,kind,a,alpha_rad,d,theta_rad\n"
    table += "joint_2,R,1,0,0,0\n,R,1,0,0,0\nfixed tip,R,1,0,0,0\n"
    names = [joint.name for joint in dh_tree(table.encode()).joints]
    assert names == ["joint_2", "joint_2'", "fixed tip", "fixed tip'"]
    model = pin.Model()
    for parent, name in enumerate("ab"):
        model.addJoint(parent, pin.JointModelRX(), pin.SE3.Identity(), name)
    model.addFrame(pin.Frame("b", 1, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    assert read_robot(model).links == ("universe", "a", "b'", "b")
    hands = [made.joint("a", "t", "1"), made.joint("b", "1", "1 before b", xyz="1 0 0")]
    hands += [made.joint("c", "t", "3"), made.joint("d", "3", "4", axis="0 1 0")]
    renamed = [text.replace("1 before b", "x") for text in hands]
    of = [
        chain_between(made.tree(made.urdf(one)), "4", end).motions
        for one, end in ((hands, "1 before b"), (renamed, "x"))
    ]
    assert of[0] == of[1]


def test_free_and_ball_joints_are_in_no_chain(tmp_path):
    path = mjcf(tmp_path, SMALL.replace('type="hinge"', 'type="ball"'))
    with pytest.raises(InputError, match="joint a is ball or free"):
        _ = Robot(path, task="vx").arm
    assert Robot(path, base="a", task="vx").arm.chain.names == ("b", "c")


def test_a_library_that_is_not_there_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(InputError, match=r"mujoco is missing: .*pip install"):
        read_robot(mjcf(tmp_path))


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """A cache of robot_descriptions that has one repository, of another commit."""
    repository = tmp_path / "cache" / "example-robot-data-mine" / "example-robot-data"
    folder = repository / "robots" / "panda_description" / "urdf"
    folder.mkdir(parents=True)
    (folder / "panda.urdf").write_bytes(SURVEY[0].path.read_bytes())
    git = "git", "-C", str(repository), "-c", "user.name=a", "-c", "user.email=a@b.c"
    for words in (["init", "-q", "-b", "mine"], ["add", "-A"], ["commit", "-q", "-m", "a"]):
        subprocess.run([*git, *words], check=True, timeout=120)
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("ROBOT_DESCRIPTION_COMMIT", "mine")
    monkeypatch.delitem(sys.modules, "robot_descriptions.panda_description", raising=False)
    yield folder / "panda.urdf"
    sys.modules.pop("robot_descriptions.panda_description", None)


def test_a_robot_by_its_name(cache, capsys):
    by_name = Robot("robot_descriptions:panda_description", "panda_hand").arm
    assert by_name == Robot(cache, "panda_hand").arm
    words = ["measure", "robot_descriptions:panda_description", "--tip", "panda_hand"]
    app([*words, "--json"], standalone_mode=False)
    found = json.loads(capsys.readouterr().out)
    middle = by_name.chain.mid_range
    assert np.array(found["jacobian"]) == pytest.approx(by_name.jacobian(middle))


@pytest.mark.parametrize("name", ["", "nobody", "panda_description", "os.path", "../panda"])
def test_robots_that_are_not_in_the_cache_are_refused(name, tmp_path, monkeypatch):
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path))
    with pytest.raises(InputError, match=r"pull panda_desc|such as panda_description") as said:
        read_robot(f"robot_descriptions:{name}")
    assert "\n" not in str(said.value)


def test_files_that_mjcf_includes(tmp_path):
    """Of the same folder or one below; the robot is that of one file."""
    before, shoulder = MJCF.partition('<body name="shoulder"')[::2]
    hand, after = shoulder.partition('<body name="ball"')[::2]
    body = f'<body name="shoulder"{hand.rpartition("</body>")[0]}'
    mjcf(tmp_path, f"<mujocoinclude>{body}</mujocoinclude>", "arm.xml")
    (tmp_path / "parts").mkdir()
    mjcf(tmp_path / "parts", '<mujoco><include file="arm.xml"/></mujoco>')
    text = f'{before}<include file="parts/robot.xml"/></body><body name="ball"{after}'
    arm = Robot(mjcf(tmp_path, text), "hand", task="position").arm
    assert arm == Robot(mjcf(tmp_path), "hand", task="position").arm
    (tmp_path / "arm.xml").unlink()
    (tmp_path / "arm.xml").symlink_to(__file__)
    with pytest.raises(FileError, match=r"file of <include> is arm.xml; .* in the folder"):
        read_robot(mjcf(tmp_path, text))


def test_files_that_included_files_include(tmp_path):
    """From the folder of the whole, or beside the file that includes: as mujoco finds them."""
    (tmp_path / "parts").mkdir()
    text = '<mujoco><worldbody><include file="parts/mount.xml"/></worldbody></mujoco>'
    mount = '<body name="mount"><joint/><geom size="1"/><include file="{}"/></body>'
    links = '<mujocoinclude><body name="{}"><joint/><geom size="1"/></body></mujocoinclude>'
    mjcf(tmp_path, links.format("beside"), "parts/links.xml")
    for name, place in (
        ("links.xml", "beside"),
        ("parts/links.xml", "beside"),
        ("links.xml", "above"),
    ):
        mjcf(
            tmp_path, f"<mujocoinclude>{mount.format(name)}</mujocoinclude>", "parts/mount.xml"
        )
        if place == "above":
            mjcf(tmp_path, links.format("above"), "links.xml")
        path = mjcf(tmp_path, text)
        assert place in read_robot(path).links
        assert mujoco.MjModel.from_xml_path(str(path)).body(2).name == place


def as_quaternions(text, factor=1.0):
    """A URDF text of version 1.1 with quaternions in place of the angles of its origins."""

    def turned(found):
        angles = [float(angle) for angle in found[1].split()]
        quaternion = factor * Rotation.from_euler("xyz", angles).as_quat()
        return f'quat_xyzw="{" ".join(map(repr, quaternion.tolist()))}"'

    text = re.sub(r'rpy="([^"]*)"', turned, text)
    return text.replace("<robot ", '<robot version="1.1" ', 1)


@pytest.mark.parametrize("factor", [1.0, 0.9999, -3.0])
def test_rotations_may_be_quaternions(made, factor):
    """From version 1.1 on; also where they are no unit quaternions."""
    text = made.offset_arm()
    assert "rpy" in text
    q = np.array([0.3, -0.5, 0.2, 1.1, -0.4, 0.7, 0.1])
    by_angles, by_quaternions = (
        made.arm(each) for each in (text, as_quaternions(text, factor))
    )
    np.testing.assert_allclose(by_quaternions.jacobian(q), by_angles.jacobian(q), atol=1e-12)


def test_quaternions_are_as_pinocchio_has_them(made):
    """The arm of URDF 1.1 of which the value was found: σ is 0.009276 at this posture."""
    text = as_quaternions(made.offset_arm())
    model = pin.buildModelFromXML(text)
    chain, q = made.chain(text), np.array([0.3, -0.5, 0.2, 1.1, -0.4, 0.7, 0.1])
    own = made.arm(text, length=1.0).jacobian(q)
    data = model.createData()
    frame = model.getFrameId(chain.tip)
    pin.framesForwardKinematics(model, data, q)
    expected = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
    np.testing.assert_allclose(own, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("version", "origin", "said"),
    [
        ('version="2.0"', "", "version of <robot> is 2.0"),
        ('version="1"', "", "version of <robot> is 1;"),
        ('version="1.1.0"', "", "version of <robot>"),
        ('version=""', "", "version of <robot>"),
        ("", 'quat_xyzw="0 0 0 1"', "in a file of version 1.0"),
        ('version="1.0"', 'quat_xyzw="0 0 0 1"', "in a file of version 1.0"),
        ('version="1.1"', 'quat_xyzw="0 0 0 1" rpy="0 0 0"', "with rpy and quat_xyzw"),
        ('version="1.1"', 'quat_xyzw="0 0 0 0"', "a quaternion that is not 0"),
        ('version="1.1"', 'quat_xyzw="0 0 1"', "allowed: four numbers"),
        ('version="1.1"', 'quat_xyzw="0 0 nan 1"', "allowed: four numbers"),
    ],
)
def test_versions_of_urdf(made, version, origin, said):
    text = made.planar_urdf([0.5, 0.4, 0.3]).replace("<robot ", f"<robot {version} ")
    text = re.sub(r'(<origin xyz="[^"]*") rpy="[^"]*"', rf"\1 {origin}", text, count=1)
    assert origin in text
    with pytest.raises(InputError, match=said):
        made.tree(text)
    for known in ("1.0", "1.1", "1.2"):
        made.tree(made.planar_urdf([0.5]).replace("<robot ", f'<robot version="{known}" '))
