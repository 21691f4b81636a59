"""Read a URDF file with yourdfpy.

What does not bear on kinematics (meshes, inertias, transmissions, simulator tags) is removed
before yourdfpy parses the file, so that it can be neither missing nor wrong. Numbers are
checked before, so that an error names the joint and the attribute.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from formulations.robots.chain import LARGEST
from formulations.robots.tree import MOVING, Limit, Mimic, RobotTree, TreeJoint, joint_between
from nlp.errors import FileError, InputError, MissingLibraryError
from nlp.files import read_bytes, real_in

if TYPE_CHECKING:
    from lxml.etree import _Element
    from yourdfpy import Robot as UrdfRobot
    from yourdfpy import TreeJoint as UrdfJoint

KINDS = (*MOVING, "fixed", "floating", "planar")
_XACRO = "plain URDF (run xacro on the file first)"
_KINEMATIC = ("parent", "child", "origin", "axis", "limit", "mimic")
# How many numbers each attribute has.
_NUMBERS = {
    **{("origin", "xyz"): 3, ("origin", "rpy"): 3, ("axis", "xyz"): 3},
    **{("limit", "lower"): 1, ("limit", "upper"): 1, ("limit", "velocity"): 1},
    **{("mimic", "multiplier"): 1, ("mimic", "offset"): 1},
}
_REQUIRED = (("parent", "link"), ("child", "link"), ("mimic", "joint"))
_NAMES = {attribute for _, attribute in _REQUIRED}
# Limits may be of any size, and infinite.
_LARGEST = {"limit": math.inf}
# In bytes; 150 000 links take 30 MB, and robots that exist less than 1 MB.
LARGEST_FILE = 50_000_000


def read_urdf(path: str | os.PathLike[str]) -> RobotTree:
    """Read a robot.

    Parameters
    ----------
    path
        A URDF file; xacro files must have been expanded.

    Returns
    -------
    RobotTree
        A revolute or prismatic joint without ``<limit>`` is invalid URDF: it has the limits
        0 and 0, the defaults of the attributes, or none of its own if it mimics another.

    Raises
    ------
    FileError
        If the file cannot be read, is no URDF, is malformed or does not describe one tree.
    InputError
        If the library that reads URDF is not installed.
    """
    return from_file(Path(path), parse_urdf)


def from_file(path: Path, parse: Callable[[bytes], RobotTree]) -> RobotTree:
    """Return what is parsed from a file's content; FileError, which names the file, if none."""
    content = read_bytes(path, most=LARGEST_FILE)
    try:
        return parse(content)
    except MissingLibraryError:
        raise
    except InputError as error:
        where = f"{path}: {error.argument}"
        raise FileError(where, error.value, error.allowed) from None


def parse_urdf(content: bytes) -> RobotTree:
    """Read a robot from the text of a URDF file; InputError if it is none."""
    root = xml_root(content)
    if root.tag != "robot":
        raise InputError("root element", f"<{root.tag}>", "<robot>, as in URDF")
    return urdf_tree(root)


def is_urdf(content: bytes) -> bool:
    """Whether the text of a file is URDF by its root element."""
    try:
        return bool(xml_root(content).tag == "robot")
    except MissingLibraryError:
        raise
    except InputError:
        return False


def urdf_tree(root: _Element) -> RobotTree:
    """Read a robot from the root element of a URDF; InputError if it is wrong."""
    if any("xacro" in str(element.tag) for element in root.iter()):
        raise InputError("content", "xacro", _XACRO)
    reduced = _kinematic_part(root)
    try:
        import yourdfpy
        from lxml import etree
    except ModuleNotFoundError:
        raise MissingLibraryError("yourdfpy") from None
    content = BytesIO(etree.tostring(reduced))
    return yourdfpy_tree(
        yourdfpy.URDF.load(content, build_scene_graph=False, load_meshes=False).robot
    )


def yourdfpy_tree(robot: UrdfRobot) -> RobotTree:
    """Return the robot of a model of yourdfpy; InputError if it is wrong."""
    links = tuple(link.name for link in robot.links)
    return RobotTree(robot.name, links, tuple(_joint(joint) for joint in robot.joints))


def _joint(joint: UrdfJoint) -> TreeJoint:
    mimic = joint.mimic
    if mimic is not None:
        factor = 1.0 if mimic.multiplier is None else float(mimic.multiplier)
        mimic = Mimic(mimic.joint, factor, float(mimic.offset or 0.0))
    return joint_between(
        *(joint.parent, joint.child, joint.name, joint.type),
        np.eye(4) if joint.origin is None else joint.origin,
        (1.0, 0.0, 0.0) if joint.axis is None else joint.axis,
        _limit(joint),
        mimic,
    )


def xml_root(content: bytes) -> _Element:
    """Return the root of the XML; InputError if it is none, or declares entities.

    Undeclared name spaces, which simulators' tags have, are no error.
    """
    try:
        from lxml import etree
    except ModuleNotFoundError:
        raise MissingLibraryError("lxml", "yourdfpy") from None

    if content.startswith(b"\x1f\x8b"):
        raise InputError(
            "content", "compressed with gzip", "plain URDF (unpack the file first)"
        )
    # Entities are not resolved, and no other file or address is read.
    parser = etree.XMLParser(recover=True, resolve_entities=False, no_network=True)
    root = None
    # Where nothing can be recovered, lxml raises; its log has the fault all the same.
    with suppress(etree.XMLSyntaxError):
        root = etree.fromstring(content, parser) if content.strip() else None
    faults = [e for e in parser.error_log if e.type_name != "NS_ERR_UNDEFINED_NAMESPACE"]
    if root is None or faults:
        why = f" ({faults[0].message.strip()}, line {faults[0].line})" if faults else ""
        raise InputError("content", "not XML", f"well-formed XML{why}")
    declared = root.getroottree().docinfo.internalDTD
    if declared is not None and declared.entities():
        raise InputError("content", "XML with <!ENTITY>", "URDF without entities")
    return root


def _kinematic_part(root: _Element) -> _Element:
    """Leave of the robot what bears on kinematics; check that all required parts exist."""
    name = root.get("name", "robot")
    root.attrib.clear()
    root.set("name", name)
    for element in list(root):
        if element.tag == "link":
            link = _attribute(element, "name", "a link")
            element.clear()
            element.set("name", link)
        elif element.tag == "joint":
            _keep_kinematics(element)
        else:
            root.remove(element)
    return root


def _keep_kinematics(joint: _Element) -> None:
    name = _attribute(joint, "name", "a joint")
    kind = _attribute(joint, "type", f"joint {name}")
    if kind not in KINDS:
        raise InputError(f"type of joint {name}", kind, "one of " + ", ".join(KINDS))
    parts: dict[str, _Element] = {}
    for part in list(joint):
        # Where a part is there several times, the first counts.
        if part.tag in _KINEMATIC and part.tag not in parts:
            parts[part.tag] = part
        else:
            joint.remove(part)
    for tag, attribute in _REQUIRED:
        if tag in parts:
            _attribute(parts[tag], attribute, f"<{tag}> of joint {name}")
        elif tag != "mimic":
            raise InputError(f"joint {name}", f"without <{tag}>", "a parent and a child")
    for tag, part in parts.items():
        for attribute, text in part.items():
            count = _NUMBERS.get((tag, attribute), 0)
            if count:
                where = f"{attribute} of <{tag}> of joint {name}"
                check_numbers(where, text, count, _LARGEST.get(tag, LARGEST))
            elif attribute not in _NAMES:
                del part.attrib[attribute]


def check_numbers(where: str, text: str, count: int, largest: float) -> None:
    """Raise InputError unless a text has so many numbers, none of them NaN or too large."""
    try:
        numbers = [real_in(part) for part in text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(abs(number) <= largest for number in numbers):
        size = f", of size at most {largest:g}" if largest < math.inf else ""
        allowed = f"{'one number' if count == 1 else 'three numbers'}{size}"
        raise InputError(where, text, _XACRO if "${" in text or "$(" in text else allowed)


def _attribute(element: _Element, name: str, what: str) -> str:
    value = element.get(name)
    if not value:
        raise InputError(what, f"without the attribute '{name}'", f"{what} with a {name}")
    return str(value)


def _limit(joint: UrdfJoint) -> Limit:
    limit = joint.limit
    speed = float((limit.velocity if limit else None) or 0.0)
    if joint.type not in ("revolute", "prismatic") or (limit is None and joint.mimic):
        return Limit(velocity=speed)
    # By the URDF specification a limit that is left out is zero.
    lower, upper = (limit.lower, limit.upper) if limit else (None, None)
    return Limit(float(lower or 0.0), float(upper or 0.0), speed)
