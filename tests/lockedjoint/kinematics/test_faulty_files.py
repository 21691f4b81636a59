"""What a faulty file of a robot gets: one sentence that names it, and no other output."""

import gzip
import re

import pytest

from lockedjoint.kinematics.read_robot import read_robot
from lockedjoint.nlp.errors import FileError
from tests import made_robots as made
from tests.made_robots import SMALL

# URDF: a file's content, and a pattern of its sentence.


def _robot(joints="", links="01"):
    return made.urdf([joints], links)


def _joint(name="a", ends="01", more=""):
    parent, child = ends
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/>'
        f'<child link="{child}"/>{more or "<limit/>"}</joint>'
    )


_ONE = _robot(_joint())
_ENTITY = "<!ENTITY>; allowed: XML without entities"
FAULTS = [
    (_ONE[:-9], "not XML"),
    ("<sdf/>", "<sdf>.*<robot>"),
    ("<robot><xacro:macro/></robot>", "xacro FILE.urdf.xacro > FILE.urdf"),
    ("<robot name='x'/>", "without a <link>"),
    ("<robot><link/></robot>", "a link is without .*'name'"),
    (_ONE.replace(' name="a"', ""), "a joint is without .*'name'"),
    (_ONE.replace("revolute", "screw"), "type of joint a is screw; allowed: one of revolute"),
    (_ONE.replace('<parent link="0"/>', ""), "joint a is without <parent>"),
    (_ONE.replace('parent link="0"', "parent"), "<parent> of joint a is without"),
    (_robot(_joint(), "0"), "child of joint a is 1; allowed: the name of a <link>"),
    (_robot(_joint(), "011"), "link 1 is there 2 times"),
    (_robot(_joint() + _joint("a", "12"), "012"), "joint a is there 2 times"),
    (_robot(_joint("a", "02") + _joint("b", "12"), "012"), "child of 2 joints.*closed loops"),
    (_robot(_joint(), "01x"), "pieces that start at 0, x"),
    (_robot(_joint() + _joint("b", "10")), r"robot is cyclic \(through 0, 1\)"),
    (_robot(_joint("a", "12") + _joint("b", "21"), "012"), r"cyclic \(through 1, 2\)"),
    *(
        (_robot(_joint(more=f"<{more}/>")), said)
        for more, said in (
            ('limit lower="1" upper="-1"', r"limits of joint a is \[1, -1\]"),
            ('limit lower="inf" upper="inf"', r"is \[inf, inf\]; allowed: .* position of size"),
            ('limit lower="-9e99" upper="-8e99"', "is .* with a position of size"),
            ('axis xyz="0 0 0"', "axis of joint a"),
            ('axis xyz="1e-300 0 0"', "a is 1e-300 0 0; allowed: three numbers, not all zero"),
            ('origin xyz="0 0 ${d}"', r"<origin> of joint a is 0 0 \$\{d\}; .*xacro FILE"),
            ("mimic", "<mimic> of joint a is without"),
        )
    ),
    ("<robot><link name='a\0b'/></robot>", "not XML"),
    (gzip.compress(_ONE.encode()), "gzip; .*unpack the file"),
    (_robot(links="é").encode("latin-1"), "not XML.*invalid token"),
    ("<?xml version='1.0' encoding='x-9'?><robot/>", "not XML.*unknown encoding"),
    (2 * _ONE, r"not XML.*junk after[^;]*\)\.$"),
    ("1,0,1\n0,1,1\n", "not XML.*; the name of a file of numbers ends in .csv"),
    ("<robot>" + 9999 * "<a>", "nested too deeply"),
    (_robot(links=["x" * 12_000_000]), "a text that is too long"),
    ("<!DOCTYPE r [<!ENTITY e 'x'>]><robot name='&e;'/>", _ENTITY),
    ("<!DOCTYPE r [<!ENTITY e SYSTEM 'file:///dev/null'>]><robot>&e;</robot>", _ENTITY),
]

# Denavit–Hartenberg tables and MJCF: the sentence, and the content.

GOOD = "# convention: standard\nkind,a,d,alpha_rad,theta_rad\nR,1,0,0,0\n"
TABLES = {
    "convention is missing": GOOD.replace("# convention: standard", "#"),
    "convention is craig": GOOD.replace("standard", "craig"),
    "column is b": GOOD.replace("kind,a,", "kind,b,"),
    "table is without kind": "# convention: standard\na,d,alpha_rad,theta_rad\n1,0,0,0",
    "table is without rows": GOOD.replace("R,1,0,0,0\n", ""),
    "content is no table": "# convention: standard\n",
    "content is no table; allowed: a line": GOOD.replace(",0,0\n", ',"0,0\n'),
    "column alpha is without a unit": GOOD.replace("alpha_rad", "alpha"),
    "column alpha is missing": GOOD.replace("alpha_rad,", ""),
    "column theta is there twice": GOOD.replace("alpha_rad", "theta_deg"),
    "column upper is without a unit": GOOD.replace("alpha_rad", "upper,alpha_rad"),
    "row 1 is of 4 cells": GOOD.replace("R,1,0,0,0", "R,1,0,0"),
    "kind in row 1 is screw": GOOD.replace("R,", "screw,"),
    "a in row 1 is x": GOOD.replace("R,1", "R,x"),
    "theta_rad in row 1 is inf": GOOD.replace("0,0\n", "0,inf\n"),
    "origin of joint fixed tip": GOOD.replace("R,1", "R,1e300"),
    "content is not in UTF-8": b"\xff\xfe\x00",
    "table is of 10001 rows; allowed: at most 10000 rows": GOOD + "R,1,0,0,0\n" * 10_000,
}
_LAST, _INCLUDE = '<body name="d" pos="0 0 1"/>', '<include file="{}"/>'.format
_MANY = "<body/><site/>" * 9_998 + "<site/><site/>"
REFUSED = {
    sentence: SMALL.replace(before, after)
    for sentence, before, after in (
        ("is ../robot.xml; allowed: one in the folder", _LAST, _INCLUDE("../robot.xml")),
        ("/x; allowed: a file that can be read", _LAST, _INCLUDE("x")),
        ("is robot.xml; allowed: every file once", _LAST, _INCLUDE("robot.xml")),
        ("content is MJCF with <attach>", _LAST, "<attach/>"),
        ("content is MJCF with <replicate>", _LAST, '<replicate count="1000000000"/>'),
        ("content is MJCF that mujoco refuses", "<equality>", "<equality><tendon/>"),
        ("content is 20004 bodies", _LAST, _MANY),
        ("MJCF that mujoco refuses", "hinge", "screw"),
        ("content is not XML", "co>", ""),
        ("content is XML with <!ENTITY>", "<mujoco>", "<!DOCTYPE m [<!ENTITY e 'x'>]><mujoco>"),
        ("origin of joint b", 'name="b" pos="0 0 1"', 'name="b" pos="0 0 1e30"'),
        ("mujoco refuses (Error: axis too small", 'axis="0 1 0" type', 'axis="0 0 0" type'),
        ("<sdf>; allowed: <robot> (URDF) or <mujoco> (MJCF)", SMALL, "<sdf/>"),
    )
}

CASES = [("robot.urdf", content, sentence) for content, sentence in FAULTS]
CASES += [
    (name, content, re.escape(sentence))
    for name, cases in (("arm.csv", TABLES), ("robot.xml", REFUSED))
    for sentence, content in cases.items()
]


@pytest.mark.parametrize(("name", "content", "sentence"), CASES, ids=range(len(CASES)))
def test_one_sentence(name, content, sentence, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(FileError, match=sentence) as caught:
        read_robot(path)
    assert str(tmp_path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")
    assert [one.name for one in tmp_path.iterdir()] == [name]  # no log of mujoco
