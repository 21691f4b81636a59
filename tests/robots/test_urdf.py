"""Reading URDF: what is read, and one clear sentence for what cannot be."""

import gzip
import os
from types import SimpleNamespace

import numpy as np
import pytest

from formulations.kinematics import read_xml as reading
from formulations.kinematics.chain_between import chain_between
from formulations.kinematics.read_urdf import parse_urdf, read_urdf
from formulations.kinematics.tree import RobotTree
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


def test_what_does_not_bear_on_kinematics_may_be_wrong(made):
    """Such as an effort that is no number."""
    limit = 'lower="-1" upper="1" effort="x" velocity="2"'
    text = made.urdf([made.joint("a", "0", "1", limit=limit)])
    text = text.replace("<origin", '<dynamics damping="x"/><!-- x --><origin k="x"')
    (joint,) = parse_urdf(text.encode()).joints
    assert (joint.limit.lower, joint.limit.upper, joint.limit.velocity) == (-1, 1, 2)


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
    "crossed limits": (
        lambda m: m.urdf([m.joint("a", "0", "1", limit='lower="1" upper="-1"')]),
        r"limits of joint a is \[1, -1\]",
    ),
    "limits at infinity": (
        lambda m: m.urdf([m.joint("a", "0", "1", limit='lower="inf" upper="inf"')]),
        r"limits of joint a is \[inf, inf\]; allowed: .* with a position of size",
    ),
    "limits far away": (
        lambda m: m.urdf([m.joint("a", "0", "1", limit='lower="-9e99" upper="-8e99"')]),
        "limits of joint a is .* with a position of size",
    ),
    "axis zero": (lambda m: m.urdf([m.joint("a", "0", "1", axis="0 0 0")]), "axis of joint a"),
    "axis tiny": (
        lambda m: m.urdf([m.joint("a", "0", "1", axis="1e-300 0 0")]),
        "axis of joint a is 1e-300 0 0; allowed: three numbers, not all zero",
    ),
    "xacro property": (
        lambda m: m.urdf([m.joint("a", "0", "1", xyz="0 0 ${d}")]),
        r"xyz of <origin> of joint a is 0 0 \$\{d\}; .*run xacro",
    ),
    "mimic of nothing": (
        lambda m: m.urdf([m.joint("a", "0", "1", mimic="<mimic/>")]),
        "<mimic> of joint a is without",
    ),
    "NUL in a name": (lambda _: "<robot><link name='a\0b'/></robot>", "not XML"),
    "NULs": (lambda _: b"\0" * 99, "not XML"),
    "any bytes": (lambda _: bytes(range(256)) * 9, "not XML"),
    "NUL at the end": (lambda m: m.urdf([m.joint("a", "0", "1")]) + "\0", "not XML"),
    "compressed": (lambda m: gzip.compress(m.offset_arm().encode()), "gzip; .*unpack the file"),
    "Latin-1": (lambda m: m.urdf([], "é").encode("latin-1"), "not XML.*invalid token"),
    "no such encoding": (
        lambda _: "<?xml version='1.0' encoding='x-9'?><robot/>",
        "not XML.*unknown encoding",
    ),
    "twice": (lambda m: 2 * m.urdf([], "0"), "not XML.*junk after"),
    "nested deeply": (lambda _: "<robot>" + 9999 * "<a>", "nested too deeply"),
    "a name of 12 MB": (lambda m: m.urdf([], ["x" * 12_000_000]), "a text that is too long"),
    "entities of entities": (
        lambda _: (
            "<!DOCTYPE r [<!ENTITY a0 'aaaaaaaaaa'>"
            + "".join(f"<!ENTITY a{k + 1} '{f'&a{k};' * 10}'>" for k in range(9))
            + "]><robot name='&a9;'/>"
        ),
        "<!ENTITY>",
    ),
    "entity in an attribute": (
        lambda _: "<!DOCTYPE r [<!ENTITY e 'x'>]><robot><link name='&e;'/></robot>",
        "<!ENTITY>; allowed: XML without entities",
    ),
    "entity of a file": (
        lambda _: "<!DOCTYPE r [<!ENTITY e SYSTEM 'file:///dev/null'>]><robot>&e;</robot>",
        "<!ENTITY>; allowed: XML without entities",
    ),
}
# Bad values, by how many numbers are wanted; limits may be infinite and of any size.
TRIPLES = (
    "",
    "1",
    "1 0",
    "1 0 0 3",
    "1,2,3",
    "z",
    "nan 0 1",
    "inf 0 0",
    "0 1e300 0",
    "1e999 0 0",
)
SINGLE, LARGE = ("", "x", "1 2", "nan", "1,5"), ("inf", "1e300", "-1e21")
NUMBERS = [
    *(("origin", "xyz", text) for text in TRIPLES),
    *(("origin", "rpy", text) for text in TRIPLES),
    *(("axis", "xyz", text) for text in TRIPLES),
    *(("mimic", "multiplier", text) for text in SINGLE + LARGE),
    *(("mimic", "offset", text) for text in SINGLE + LARGE),
    *(("limit", "lower", text) for text in SINGLE),
    *(("limit", "upper", text) for text in SINGLE),
]


@pytest.mark.parametrize(("tag", "attribute", "text"), NUMBERS)
def test_a_wrong_number_is_named(tag, attribute, text):
    """Warnings are errors here: nothing is computed with such a number."""
    joint = f'<parent link="0"/><child link="1"/><{tag} joint="a" {attribute}="{text}"/>'
    links = '<link name="0"/><link name="1"/>'
    robot = f'<robot>{links}<joint name="a" type="revolute">{joint}</joint></robot>'
    with pytest.raises(InputError) as caught:
        parse_urdf(robot.encode())
    assert caught.value.argument == f"{attribute} of <{tag}> of joint a"
    assert caught.value.value == text


def test_a_name_is_a_path(made, tmp_path, monkeypatch):
    (tmp_path / "arm.urdf").write_text(made.offset_arm())
    monkeypatch.chdir(tmp_path)

    class Somewhere(os.PathLike):
        def __fspath__(self):
            return "arm.urdf"

    for path in ("arm.urdf", tmp_path / "arm.urdf", Somewhere()):
        assert len(read_urdf(path).joints) == 7
    with pytest.raises(FileError, match="no such file"):
        read_urdf("none.urdf")
    with pytest.raises(FileError, match="null"):
        read_urdf("a\0b")


def test_a_file_that_is_too_large(made, tmp_path, monkeypatch):
    path = tmp_path / "arm.urdf"
    path.write_text(made.offset_arm())
    monkeypatch.setattr(reading, "LARGEST_FILE", 100)
    with pytest.raises(FileError, match="at most 100 bytes"):
        read_urdf(path)


def test_messages_stay_short(made):
    names = ["l" * 100_000 + str(k) for k in range(30)]
    robot = made.tree(made.urdf([made.joint(f"j{k}", *names[k : k + 2]) for k in range(29)]))
    with pytest.raises(InputError) as caught:
        chain_between(robot, names[0][:-2])
    assert len(str(caught.value)) < 2000


def test_time_is_linear_in_links(cpu_seconds):
    """Ten times the links take ten times as long; a hundred times if it were quadratic."""
    limit = SimpleNamespace(lower=-1.0, upper=1.0, velocity=1.0)
    more = {"type": "revolute", "limit": limit, "mimic": None}
    more |= {"origin": np.eye(4), "axis": np.array([0.0, 0.0, 1.0])}

    def seconds(n):
        joints = [SimpleNamespace(name=str(k), parent=k, child=k + 1, **more) for k in range(n)]

        def read():
            tree = RobotTree("long", tuple(range(n + 1)), tuple(joints))
            assert len(chain_between(tree, n).joints) == n

        return cpu_seconds(read)

    few, many = (min(seconds(n) for _ in range(3)) for n in (1000, 10_000))
    assert many < 50 * few


def test_a_large_cycle_is_found_in_linear_time(cpu_seconds):
    def seconds(n):
        joints = [
            SimpleNamespace(name=str(k), parent=f"{k}", child=f"{(k + 1) % n}")
            for k in range(n)
        ]

        def read():
            with pytest.raises(InputError, match="cyclic"):
                RobotTree("ring", tuple(str(k) for k in range(n)), tuple(joints))

        return cpu_seconds(read)

    few, many = (min(seconds(n) for _ in range(3)) for n in (2000, 20_000))
    assert many < 50 * few


@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_file_gets_one_sentence(fault, made, tmp_path, caplog, capfd):
    text, sentence = FAULTS[fault]
    path = tmp_path / "robot.urdf"
    content = text(made)
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(FileError, match=sentence) as caught:
        read_urdf(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not caplog.records
    assert capfd.readouterr() == ("", "")


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(FileError, match="no such file"):
        read_urdf(tmp_path / "none.urdf")
