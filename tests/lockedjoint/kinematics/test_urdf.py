"""Reading URDF: what is read, and which number is wrong; see also test_faulty_files."""

import numpy as np
import pytest

from lockedjoint.kinematics import read_urdf as reading
from lockedjoint.kinematics.read_robot import read_robot
from lockedjoint.kinematics.read_urdf import urdf_tree, xml_root
from lockedjoint.nlp.errors import FileError, InputError

LINK_WITH_BAD_MESH = (
    '<link name="tip"><visual><geometry><nonsense/></geometry></visual>'
    "<inertial><mass/></inertial></link>"
)


def test_reads_kinematics_and_nothing_else(made):
    turn = {"rpy": "0 0 1.5707963267948966", "axis": "0 2 0"}
    text = made.urdf([made.joint("a", "base", "tip", xyz="1 2 3", **turn)])
    text = text.replace("</robot>", '<gazebo:thing/><transmission name="t"/></robot>')
    robot = made.tree(text.replace('<link name="tip"/>', LINK_WITH_BAD_MESH))
    assert (robot.root, robot.leaves) == ("base", ("tip",))
    (joint,) = robot.joints
    turned = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
    assert np.array(joint.origin) == pytest.approx(np.array(turned), abs=1e-12)
    assert joint.axis.tolist() == [0.0, 1.0, 0.0]
    assert (joint.limit.lower, joint.limit.upper) == (-2.0, 2.0)


def test_what_does_not_bear_on_kinematics_may_be_wrong(made):
    """Such as an effort that is no number."""
    limit = 'lower="-1" upper="1" effort="x" velocity="2"'
    text = made.urdf([made.joint("a", "0", "1", limit=limit)])
    text = text.replace("<origin", '<dynamics damping="x"/><!-- x --><origin k="x"')
    (joint,) = made.tree(text).joints
    assert (joint.limit.lower, joint.limit.upper, joint.limit.velocity) == (-1, 1, 2)


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


# Bad values, by how many numbers are wanted; limits may be infinite and of any size.
TRIPLES = ("", "1", "1 0", "1 0 0 3", "1,2,3", "z", "nan 0 1", "inf 0 0", "0 1e300 0")
TRIPLES += ("1e999 0 0",)
SINGLE, LARGE = ("", "x", "1 2", "nan", "1,5"), ("inf", "1e300", "-1e21")
WANTED = {
    TRIPLES: (("origin", "xyz"), ("origin", "rpy"), ("axis", "xyz")),
    SINGLE + LARGE: (("mimic", "multiplier"), ("mimic", "offset")),
    SINGLE: (("limit", "lower"), ("limit", "upper")),
}
NUMBERS = [(*one, text) for texts, of in WANTED.items() for one in of for text in texts]


@pytest.mark.parametrize(("tag", "attribute", "text"), NUMBERS)
def test_a_wrong_number_is_named(tag, attribute, text):
    """Warnings are errors here: nothing is computed with such a number."""
    joint = f'<parent link="0"/><child link="1"/><{tag} joint="a" {attribute}="{text}"/>'
    links = '<link name="0"/><link name="1"/>'
    robot = f'<robot>{links}<joint name="a" type="revolute">{joint}</joint></robot>'
    with pytest.raises(InputError) as caught:
        urdf_tree(xml_root(robot.encode()))
    assert caught.value.argument == f"{attribute} of <{tag}> of joint a"
    assert caught.value.value == text


def test_a_name_is_a_path(made, tmp_path, monkeypatch):
    (tmp_path / "arm.urdf").write_text(made.offset_arm())
    monkeypatch.chdir(tmp_path)
    for path in ("arm.urdf", tmp_path / "arm.urdf"):
        assert len(read_robot(path).joints) == 7
    for path, said in (("none.urdf", "no such file"), ("a\0b", "null")):
        with pytest.raises(FileError, match=said):
            read_robot(path)


def test_a_file_that_is_too_large(made, tmp_path, monkeypatch):
    path = tmp_path / "arm.urdf"
    path.write_text(made.offset_arm())
    monkeypatch.setattr(reading, "LARGEST_FILE_BYTES", 100)
    with pytest.raises(FileError, match="at most 100 bytes"):
        read_robot(path)
