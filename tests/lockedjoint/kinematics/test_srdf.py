"""SRDF: planning groups, named states, pairs of links that may touch, unknown names."""

import json
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import lockedjoint as lj
from lockedjoint.kinematics.srdf import Srdf
from lockedjoint.nlp.errors import FileError
from tests import made_robots as made

KINDS = {"j6": {"limit": 'lower="-3" upper="3" effort="1" velocity="1"'}}
PAIRS = '<disable_collisions link1="l{}" link2="l{}" reason="Default"/>'
CONTENT = """<robot name="made">
  <virtual_joint name="floor" type="fixed" parent_frame="world" child_link="l0"/>
  <group name="chain"><chain base_link="l1" tip_link="l7"/></group>
  <group name="joints">
    <joint name="floor"/>{joints}
  </group>
  <group name="links"><link name="l1"/><link name="l2"/><link name="l3"/></group>
  <group name="gripper"><joint name="finger"/></group>
  <group name="both"><group name="joints"/><group name="gripper"/></group>
  <group name="gaps"><joint name="j0"/><joint name="j2"/></group>
  <group name="branched"><joint name="finger"/><joint name="thumb"/></group>
  <group name="and_fixed">{joints}<joint name="mount"/></group>
  <group name="chains">
    <chain base_link="l0" tip_link="l4"/><chain base_link="l4" tip_link="flange"/>
  </group>
  <group name="and_chain"><joint name="j0"/><chain base_link="l1" tip_link="flange"/></group>
  <group_state name="home" group="joints">{home}</group_state>
  <group_state name="home" group="gripper"><joint name="finger" value="0.5"/></group_state>
  <group_state name="away" group="joints"><joint name="j0" value="1"/></group_state>
  <group_state name="away" group="gaps"><joint name="j0" value="-1"/></group_state>
  <end_effector name="hand" parent_link="flange" group="gripper" parent_group="joints"/>
  <passive_joint name="thumb"/>
  {more}
</robot>"""


def srdf(more=""):
    joints = "".join(f'<joint name="j{k}"/>' for k in range(7))
    home = "".join(f'<joint name="j{k}" value="{0.1 * k}"/>' for k in range(7))
    return CONTENT.format(joints=joints, home=home, more=more)


@pytest.fixture(scope="module")
def text():
    """Seven joints, a flange that is fixed to the last, a finger and a thumb beyond it."""
    joints = made.serial(["0.1 0.05 0.3"] * 7, **KINDS)
    joints += [
        made.joint("mount", "l7", "flange", "fixed"),
        made.joint("finger", "flange", "f"),
        made.joint("thumb", "flange", "t"),
    ]
    return made.urdf(joints)


@pytest.fixture
def folder(text, tmp_path):
    (tmp_path / "arm.urdf").write_text(text)
    (tmp_path / "arm.srdf").write_text(srdf())
    return tmp_path


def robot(folder, group=None, **more):
    return lj.Robot(folder / "arm.urdf", srdf=folder / "arm.srdf", group=group, **more)


@pytest.mark.parametrize(
    ("group", "base", "tip", "count"),
    [
        ("chain", "l1", "l7", 6),
        ("joints", "l0", "flange", 7),
        ("links", "l0", "l3", 3),
        ("both", "l0", "f", 8),
        # Links that are fixed to the last one that moves are named.
        ("and_fixed", "l0", "flange", 7),
        ("chains", "l0", "flange", 7),
        ("and_chain", "l0", "flange", 7),
    ],
)
def test_a_group_says_what_moves(folder, group, base, tip, count):
    made_robot = robot(folder, group)
    chain = made_robot.chain
    assert (chain.base, chain.tip, len(chain.joints)) == (base, tip, count)
    assert f"group {group}" in repr(made_robot)
    assert f"Group {group} moves {tip} relative to {base}." in chain.notes
    # The same arm as when both ends are given.
    other = lj.Robot(folder / "arm.urdf", tip=tip, base=base)
    assert other.chain.motions == chain.motions


def test_a_tip_that_is_given_counts_more_than_that_of_the_group(folder):
    chain = robot(folder, "joints", tip="l7").chain
    assert (chain.tip, len(chain.joints)) == ("l7", 7)
    with pytest.raises(lj.InputError, match="group joints is without finger"):
        robot(folder, "joints", tip="f")
    assert robot(folder, "joints", tip="f", locked={"finger": 0.1}).chain.tip == "f"


@pytest.mark.parametrize(
    ("group", "said"),
    [
        ("Joints", "nearest: joints"),
        ("gaps", "group gaps is without j1"),
        ("branched", "with branches.*one chain.*joints"),
    ],
)
def test_a_group_that_is_no_arm_is_refused(folder, group, said):
    with pytest.raises(lj.InputError, match=said):
        robot(folder, group)


def test_a_group_needs_the_file(folder):
    with pytest.raises(lj.InputError, match="group only with an SRDF file"):
        lj.Robot(folder / "arm.urdf", group="joints")


def test_states_have_names(folder):
    made_robot = robot(folder, "joints")
    point, notes = made_robot.configuration("home")
    np.testing.assert_allclose(point, 0.1 * np.arange(7))
    assert "finger" in notes[0]  # a state of two groups is one
    assert made_robot.states["away"] == {"j0": 1.0}
    assert made_robot.states["gaps/away"] == {"j0": -1.0}
    # Those of a group that is chosen later are its own.
    later = made_robot.changed(group="both")
    assert {"joints/away", "gaps/away"} <= set(later.states)
    assert "away" not in later.states
    assert later.chain.tip == "f"
    own = made_robot.changed(states={"home": {"j0": 9.0}})
    assert own.states["home"] == {"j0": 9.0}


def test_what_is_read_is_shown(folder, lockedjoint):
    shown = robot(folder, "joints")._repr_html_()
    assert "groups: chain, joints, links" in shown
    assert "home" in shown
    assert "Virtual joints of arm.srdf are left aside: floor." in shown
    line = "measure arm.urdf --srdf arm.srdf --group joints --q home --json"
    done = lockedjoint.here(*line.split(), cwd=folder)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["tip"] == "flange"
    assert any("states groups chain, joints" in note for note in found["notes"])
    assert "Virtual joints" in done.stderr


def test_names_that_the_robot_does_not_have_are_noted(folder):
    more = PAIRS.format(1, 99) + '<thing/><group name="x"><joint name="nobody"/></group>'
    more += '<group name="y"><group name="z"/></group><group_state name="s" group="none"/>'
    (folder / "arm.srdf").write_text(srdf(more).replace('name="made"', 'name="other"'))
    notes = " ".join(robot(folder, "joints").chain.notes)
    for said in ("links that the robot does not have: l99", "does not have: nobody"):
        assert said in notes
    assert "is for robot other, and this one is made" in notes
    assert "not read: thing" in notes
    assert "Group y of arm.srdf has groups that the file does not have: z." in notes
    assert "State s is of group none, which is not there." in notes
    for group, said in (("x", "joint of group x is nobody"), ("y", "group in group y is z")):
        with pytest.raises(lj.InputError, match=said):
            robot(folder, group)


def test_pairs_that_may_touch(folder):
    """Each element of SRDF, by names in either order."""
    more = (
        '<disable_default_collisions link="l3"/><enable_collisions link1="l5" link2="l3"/>'
        + PAIRS.format(6, 1)
    )
    (folder / "arm.srdf").write_text(srdf(more))
    read = Srdf.read(folder / "arm.srdf")
    assert read.may_touch("l1", "l6")
    assert read.may_touch("l6", "l1")
    assert read.may_touch("l3", "l0")
    assert not read.may_touch("l3", "l5")
    assert not read.may_touch("l2", "l6")


def test_clearance_does_not_look_at_pairs_that_may_touch(text, tmp_path):
    pytest.importorskip("coal")
    shaped = made.with_shapes(text, range(8), '<sphere radius="0.05"/>')
    (tmp_path / "arm.urdf").write_text(shaped)
    (tmp_path / "arm.srdf").write_text(srdf(PAIRS.format(6, 1) + PAIRS.format(0, 4)))
    plain = lj.Robot(tmp_path / "arm.urdf", tip="l7", clearance=0.01)
    told = robot(tmp_path, "joints", tip="l7", clearance=0.01)
    pairs = [{one.apart.names(pair) for pair in one.apart.pairs} for one in (plain, told)]
    assert pairs[0] - pairs[1] == {("l1", "l6"), ("l0", "l4")}
    assert pairs[1] < pairs[0]
    assert {told.apart.names(pair) for pair in told.apart.allowed} == pairs[0] - pairs[1]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("<robot><group/></robot>", "group is without the attribute 'name'"),
        ("<robot><xacro:x/></robot>", r"xacro FILE.srdf.xacro > FILE.srdf"),
        ("<mujoco/>", "root element is <mujoco>"),
        ('<robot><group name="a"/><group name="a"/></robot>', "group a is there twice"),
        ('<robot><group name="a"><group name="a"/></group></robot>', "part of itself"),
        (
            '<robot><group name="g"/><group_state name="s" group="g">'
            '<joint name="j" value="nan"/></group_state></robot>',
            "joint j of group_state s is nan",
        ),
        ('<!DOCTYPE r [<!ENTITY a "b">]><robot/>', "ENTITY"),
        ("<robot", "well-formed XML"),
        ('<robot><disable_collisions link1="a"/></robot>', "link2"),
    ],
)
def test_a_file_that_is_wrong_is_refused_in_one_sentence(content, said, folder, lockedjoint):
    (folder / "bad.srdf").write_text(content)
    given = ["measure", "arm.urdf", "--tip", "l7", "--srdf", "bad.srdf"]
    done = lockedjoint.here(*given, cwd=folder)
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1
    with pytest.raises(FileError, match=said):
        Srdf.read(folder / "bad.srdf")


@pytest.mark.parametrize("last", ["", '<group name="g0"/>'])
def test_groups_in_circles_are_refused_and_deep_ones_read(last, tmp_path):
    deep = "".join(f'<group name="g{k}"><group name="g{k + 1}"/></group>' for k in range(5000))
    file = tmp_path / "deep.srdf"
    file.write_text(f'<robot>{deep}<group name="g5000">{last}</group></robot>')
    if last:
        with pytest.raises(FileError, match="part of itself"):
            Srdf.read(file)
    else:
        assert len(Srdf.read(file).groups) == 5001


def test_a_state_with_several_numbers_is_left_aside(tmp_path):
    content = (
        '<robot><group name="g"/><group_state name="s" group="g"><joint name="ball"'
        ' value="0 0 0 1"/><joint name="j" value="1"/></group_state></robot>'
    )
    (tmp_path / "a.srdf").write_text(content)
    read = Srdf.read(tmp_path / "a.srdf")
    assert read.states[0].positions == {"j": 1.0}
    assert "ball" in read.notes[0]


ROBOTS = Path(
    distribution("example-robot-data").locate_file(
        "cmeel.prefix/share/example-robot-data/robots"
    )
)


def test_the_panda_is_what_pinocchio_reads():
    """Its state, and the pairs that are looked at: pinocchio's reader of SRDF is another."""
    files = [
        str(ROBOTS / f"panda_description/{kind}/panda.{kind}") for kind in ("urdf", "srdf")
    ]
    model = pin.buildModelFromUrdf(files[0])
    pin.loadReferenceConfigurations(model, files[1])
    q = np.asarray(model.referenceConfigurations["default"])
    panda = lj.Robot(files[0], srdf=files[1], group="arm_and_hand")
    for name, at in panda.states["default"].items():
        assert q[model.joints[model.getJointId(name)].idx_q] == pytest.approx(at)
    packages = [str(ROBOTS.parents[1])]
    kind = pin.GeometryType.COLLISION
    shapes = pin.buildGeomFromUrdf(model, files[0], kind, package_dirs=packages)
    shapes.addAllCollisionPairs()

    def pairs():
        objects = shapes.geometryObjects
        links = [
            tuple(
                sorted(model.frames[objects[k].parentFrame].name for k in (p.first, p.second))
            )
            for p in shapes.collisionPairs
        ]
        return {pair for pair in links if pair[0] != pair[1]}

    before = pairs()
    pin.removeCollisionPairs(model, shapes, files[1])
    assert {pair for pair in before if panda.srdf.may_touch(*pair)} == before - pairs()
    assert before - pairs()


@pytest.mark.parametrize(
    "file", sorted(ROBOTS.glob("*/srdf/*.srdf")), ids=lambda path: path.stem
)
def test_files_of_robots_that_exist_are_read(file):
    """Also those with states of no group, and groups of groups that are not there."""
    read = Srdf.read(file)
    assert read.states_of() or not read.states
    assert all(len(pair) == 2 for pair in read.touching)
