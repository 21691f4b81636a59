"""Reading URDF: what is read, and one clear sentence for what cannot be."""

import builtins

import numpy as np
import pytest

from formulations.robots.read_urdf import parse_urdf, read_urdf
from nlp.errors import FileError, InputError


def test_reads_kinematics_and_nothing_else(made):
    text = made.urdf(
        [
            made.joint(
                "a", "base", "tip", xyz="1 2 3", rpy="0 0 1.5707963267948966", axis="0 2 0"
            )
        ]
    ).replace("</robot>", '<gazebo:thing/><transmission name="t"/></robot>')
    robot = parse_urdf(text.replace('<link name="tip"/>', LINK_WITH_BAD_MESH).encode())
    assert (robot.root, robot.leaves) == ("base", ("tip",))
    (joint,) = robot.joints
    turned = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
    assert np.array(joint.origin) == pytest.approx(np.array(turned), abs=1e-12)
    assert joint.axis.tolist() == [0.0, 1.0, 0.0]
    assert (joint.limit.lower, joint.limit.upper) == (-2.0, 2.0)


LINK_WITH_BAD_MESH = (
    '<link name="tip"><visual><geometry><nonsense/></geometry></visual>'
    "<inertial><mass/></inertial></link>"
)


def test_limits_by_kind(made):
    joints = [
        made.joint("a", "0", "1", "continuous"),
        made.joint("b", "1", "2", "prismatic", limit='upper="0.5"'),
        made.joint("c", "2", "3", "fixed"),
    ]
    limits = {one.name: one.limit for one in made.tree(made.urdf(joints)).joints}
    found = {name: (limit.lower, limit.upper) for name, limit in limits.items()}
    assert found["a"] == (-np.inf, np.inf)
    assert found["b"] == (0.0, 0.5)  # what is left out is zero, says the specification
    assert found["c"] == (-np.inf, np.inf)


FAULTS = {
    "cut short": (lambda m: m.urdf([m.joint("a", "0", "1")])[:-9], "not XML"),
    "empty": (lambda _: " ", "not XML"),
    "not a robot": (lambda _: "<sdf/>", "<sdf>.*<robot>"),
    "xacro": (lambda _: "<robot><xacro:macro/></robot>", "run xacro"),
    "no links": (lambda _: "<robot name='x'/>", "without a <link>"),
    "nameless link": (lambda _: "<robot><link/></robot>", "a link is without .*'name'"),
    "nameless joint": (
        lambda m: m.urdf([m.joint("a", "0", "1").replace('name="a"', "")]),
        "a joint is without .*'name'",
    ),
    "unknown kind": (
        lambda m: m.urdf([m.joint("a", "0", "1", "screw")]),
        "type of joint a is screw; allowed: one of revolute",
    ),
    "no parent": (
        lambda m: m.urdf([m.joint("a", "0", "1").replace('<parent link="0"/>', "")], "01"),
        "joint a is without <parent>",
    ),
    "parent of nothing": (
        lambda m: m.urdf([m.joint("a", "0", "1").replace('link="0"', "")], "01"),
        "<parent> of joint a is without",
    ),
    "unknown link": (
        lambda m: m.urdf([m.joint("a", "0", "1")], "0"),
        "child of joint a is 1; allowed: the name of a <link>",
    ),
    "repeated link": (
        lambda m: m.urdf([m.joint("a", "0", "1")], "011"),
        "link 1 is there 2 times",
    ),
    "repeated joint": (
        lambda m: m.urdf([m.joint("a", "0", "1"), m.joint("a", "1", "2")]),
        "joint a is there 2 times",
    ),
    "two parents": (
        lambda m: m.urdf([m.joint("a", "0", "2"), m.joint("b", "1", "2")]),
        "link 2 is the child of 2 joints.*closed loops",
    ),
    "in pieces": (
        lambda m: m.urdf([m.joint("a", "0", "1")], "01x"),
        "pieces that start at 0, x",
    ),
    "a cycle": (
        lambda m: m.urdf([m.joint("a", "0", "1"), m.joint("b", "1", "0")]),
        r"robot is cyclic \(through 0, 1\)",
    ),
    "a loop": (lambda m: m.urdf([m.joint("a", "0", "0")]), r"robot is cyclic \(through 0\)"),
    "a cycle beside": (
        lambda m: m.urdf([m.joint("a", "1", "2"), m.joint("b", "2", "1")], "012"),
        r"cyclic \(through 1, 2\)",
    ),
    "no limits": (
        lambda m: m.urdf([m.joint("a", "0", "1", limit="")]),
        "joint a is revolute without limits",
    ),
    "crossed limits": (
        lambda m: m.urdf([m.joint("a", "0", "1", limit='lower="1" upper="-1"')]),
        r"limits of joint a is \[1, -1\]",
    ),
    "limit not a number": (
        lambda m: m.urdf([m.joint("a", "0", "1", limit='lower="x" upper="1"')]),
        "numbers where URDF wants numbers",
    ),
    "limit NaN": (
        lambda m: m.urdf([m.joint("a", "0", "1", limit='lower="nan" upper="1"')]),
        "limits of joint a",
    ),
    "axis zero": (lambda m: m.urdf([m.joint("a", "0", "1", axis="0 0 0")]), "axis of joint a"),
    "axis short": (lambda m: m.urdf([m.joint("a", "0", "1", axis="0 1")]), "axis of joint a"),
    "origin NaN": (
        lambda m: m.urdf([m.joint("a", "0", "1", xyz="0 nan 0")]),
        "origin of joint a",
    ),
    "origin short": (lambda m: m.urdf([m.joint("a", "0", "1", xyz="0 1")]), "malformed|origin"),
    "mimic of nothing": (
        lambda m: m.urdf([m.joint("a", "0", "1", mimic="<mimic/>")]),
        "<mimic> of joint a is without",
    ),
    "mimic NaN": (
        lambda m: m.urdf([m.joint("a", "0", "1", mimic='<mimic joint="b" offset="nan"/>')]),
        "<mimic> of joint a is not finite",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_file_gets_one_sentence(fault, made, tmp_path, caplog, capfd):
    text, sentence = FAULTS[fault]
    path = tmp_path / "robot.urdf"
    path.write_text(text(made))
    with pytest.raises(FileError, match=sentence) as caught:
        read_urdf(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not caplog.records
    assert capfd.readouterr() == ("", "")


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(FileError, match="no such file"):
        read_urdf(tmp_path / "none.urdf")


def test_a_library_that_is_not_there_is_named(monkeypatch, made, tmp_path):
    imported = builtins.__import__

    def without(name, *rest, **more):
        if name == "yourdfpy":
            raise ModuleNotFoundError(name)
        return imported(name, *rest, **more)

    path = tmp_path / "robot.urdf"
    path.write_text(made.offset_arm())
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(InputError, match="pip install"):
        read_urdf(path)
