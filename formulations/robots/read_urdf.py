"""Read a URDF file with yourdfpy: links and joints, checked to form one tree.

What does not bear on kinematics (meshes, inertias, transmissions, simulator tags) is removed
before yourdfpy parses the file, so that it can be neither missing nor wrong. Numbers are
checked before, so that an error names the joint and the attribute.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from formulations.robots.chain import LARGEST
from nlp.arrays import FloatArray
from nlp.errors import FileError, InputError
from nlp.files import read_bytes, real_in

if TYPE_CHECKING:
    from lxml.etree import _Element
    from yourdfpy import Joint

MOVING = ("revolute", "continuous", "prismatic")
KINDS = (*MOVING, "fixed", "floating", "planar")
_XACRO = "plain URDF (run xacro on the file first)"
_KINEMATIC = ("parent", "child", "origin", "axis", "limit", "mimic")
# How many numbers each attribute has.
_NUMBERS = {
    "origin": (("xyz", 3), ("rpy", 3)),
    "axis": (("xyz", 3),),
    "limit": (("lower", 1), ("upper", 1), ("velocity", 1)),
    "mimic": (("multiplier", 1), ("offset", 1)),
}
_INSTALL = "an installed yourdfpy, which 'pip install yourdfpy' provides"
# Limits may be of any size, and infinite.
_LARGEST = {"limit": math.inf}
# An axis that is shorter is taken for zero.
_SHORTEST_AXIS = 1e-9
# In bytes; 150 000 links take 30 MB, and robots that exist less than 1 MB.
_LARGEST_FILE = 50_000_000


class RobotError(InputError):
    """A robot that is malformed, or that needs more than this library supports."""


@dataclass(frozen=True, eq=False)
class RobotTree:
    """Links and joints that form one tree.

    Attributes
    ----------
    name
        Name of the robot.
    links
        Names of its links.
    joints
        Joints of yourdfpy, with every field given that `read_urdf` lists.

    Raises
    ------
    RobotError
        If names repeat, a joint names a link that does not exist, or the links do not form
        one tree.
    """

    name: str
    links: tuple[str, ...]
    joints: tuple[Joint, ...]

    def __post_init__(self) -> None:
        named = [("link", link) for link in self.links]
        named += [("joint", joint.name) for joint in self.joints]
        for (kind, name), count in Counter(named).items():
            if count > 1:
                raise RobotError(f"{kind} {name}", f"there {count} times", "every name once")
        links = set(self.links)
        for joint in self.joints:
            for side, link in (("parent", joint.parent), ("child", joint.child)):
                if link not in links:
                    allowed = "the name of a <link> of the robot"
                    raise RobotError(f"{side} of joint {joint.name}", link, allowed)
        _check_tree(self)

    @property
    def root(self) -> str:
        """The link that is no joint's child."""
        children = {joint.child for joint in self.joints}
        return next(link for link in self.links if link not in children)

    @property
    def leaves(self) -> tuple[str, ...]:
        """Links that are no joint's parent."""
        parents = {joint.parent for joint in self.joints}
        return tuple(link for link in self.links if link not in parents)

    def path(self, tip: str) -> tuple[Joint, ...]:
        """Joints from the root to a link, in order."""
        above = {joint.child: joint for joint in self.joints}
        path: list[Joint] = []
        while tip in above:
            path.append(above[tip])
            tip = path[-1].parent
        return tuple(reversed(path))


def read_urdf(path: str | os.PathLike[str]) -> RobotTree:
    """Read a robot.

    Parameters
    ----------
    path
        A URDF file; xacro files must have been expanded.

    Returns
    -------
    RobotTree
        Of each joint, `origin` is the pose in the parent's frame, a homogeneous 4×4 matrix
        in metres; `axis` is a unit vector in the joint's frame if the joint moves; and
        `limit.lower` and `limit.upper` are radians or metres, infinite without limits and
        where their size is above `LARGEST`. A
        revolute or prismatic joint without ``<limit>`` is invalid URDF: it has the limits
        0 and 0, the defaults of the attributes, or none of its own if it mimics another.

    Raises
    ------
    FileError
        If the file cannot be read, is no URDF, is malformed or does not describe one tree.
    InputError
        If the library that reads URDF is not installed.
    """
    path = Path(path)
    content = read_bytes(path, most=_LARGEST_FILE)
    try:
        return parse_urdf(content)
    except InputError as error:
        if error.argument == "yourdfpy":
            raise
        where = f"{path}: {error.argument}"
        raise FileError(where, error.value, error.allowed) from None


def parse_urdf(content: bytes) -> RobotTree:
    """Read a robot from the text of a URDF file; InputError if it is none."""
    try:
        import yourdfpy
        from lxml import etree
    except ModuleNotFoundError:
        raise InputError("yourdfpy", "not installed", _INSTALL) from None

    reduced = BytesIO(etree.tostring(_kinematic_part(xml_root(content))))
    robot = yourdfpy.URDF.load(reduced, build_scene_graph=False, load_meshes=False).robot
    for joint in robot.joints:
        lower, upper = _limits(joint)
        speed = joint.limit.velocity if joint.limit is not None else None
        # Files that know no speed write 0; nothing could move.
        speed = float(speed) if speed else np.inf
        joint.limit = yourdfpy.Limit(lower=lower, upper=upper, velocity=abs(speed))
        joint.origin = np.eye(4) if joint.origin is None else joint.origin
        if joint.type in MOVING:
            joint.axis = _axis(joint)
    return RobotTree(robot.name, tuple(link.name for link in robot.links), tuple(robot.joints))


def xml_root(content: bytes) -> _Element:
    """Root of the XML; undeclared name spaces, which simulators' tags have, are no error."""
    from lxml import etree

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
    if root.tag != "robot":
        raise InputError("root element", f"<{root.tag}>", "<robot>, as in URDF")
    if any("xacro" in str(element.tag) for element in root.iter()):
        raise InputError("content", "xacro", _XACRO)
    return root


def _kinematic_part(root: _Element) -> _Element:
    """Return what of the robot bears on kinematics; check that all required parts exist."""
    from lxml import etree

    reduced = etree.Element("robot", name=root.get("name", "robot"))
    for link in root.findall("link"):
        etree.SubElement(reduced, "link", name=_attribute(link, "name", "a link"))
    for joint in root.findall("joint"):
        name = _attribute(joint, "name", "a joint")
        kind = _attribute(joint, "type", f"joint {name}")
        if kind not in KINDS:
            raise InputError(f"type of joint {name}", kind, "one of " + ", ".join(KINDS))
        # Where a part is there several times, the first counts.
        parts = {part.tag: part for part in reversed(joint) if part.tag in _KINEMATIC}
        for tag, attribute in (("parent", "link"), ("child", "link"), ("mimic", "joint")):
            part = parts.get(tag)
            if part is not None:
                _attribute(part, attribute, f"<{tag}> of joint {name}")
            elif tag != "mimic":
                raise InputError(f"joint {name}", f"without <{tag}>", "a parent and a child")
        copied = etree.SubElement(reduced, "joint", name=name, type=kind)
        for tag, part in parts.items():
            etree.SubElement(copied, tag, part.attrib)
            for attribute, count in _NUMBERS.get(tag, ()):
                text = part.get(attribute)
                if text is not None:
                    where = f"{attribute} of <{tag}> of joint {name}"
                    check_numbers(where, text, count, _LARGEST.get(tag, LARGEST))
    return reduced


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


def _limits(joint: Joint) -> tuple[float, float]:
    no_limit = joint.limit is None
    if joint.type not in ("revolute", "prismatic") or (no_limit and joint.mimic is not None):
        return -np.inf, np.inf
    # By the URDF specification a limit that is left out is zero.
    lower = 0.0 if no_limit else joint.limit.lower or 0.0
    upper = 0.0 if no_limit else joint.limit.upper or 0.0
    if not lower <= upper or lower > LARGEST or upper < -LARGEST:
        shown = f"[{lower:g}, {upper:g}]"
        allowed = f"lower <= upper, with a position of size at most {LARGEST:g} between them"
        raise InputError(f"limits of joint {joint.name}", shown, allowed)
    return (
        lower if lower >= -LARGEST else -np.inf,
        upper if upper <= LARGEST else np.inf,
    )


def _axis(joint: Joint) -> FloatArray:
    axis = np.asarray(joint.axis, dtype=float)
    length = float(np.linalg.norm(axis))
    if length <= _SHORTEST_AXIS:
        shown = " ".join(f"{entry:g}" for entry in axis)
        raise InputError(f"axis of joint {joint.name}", shown, "three numbers, not all zero")
    return np.asarray(axis / length)


def _check_tree(tree: RobotTree) -> None:
    if not tree.links:
        raise RobotError("robot", "without a <link>", "at least one link")
    children = Counter(joint.child for joint in tree.joints)
    for link, count in children.items():
        if count > 1:
            allowed = "one parent at most: closed loops are not supported"
            raise RobotError(f"link {link}", f"the child of {count} joints", allowed)
    roots = [link for link in tree.links if link not in children]
    if len(roots) > 1:
        shown = ", ".join(roots[:4])
        raise RobotError("robot", f"in pieces that start at {shown}", "one connected tree")
    try:
        TopologicalSorter({joint.child: [joint.parent] for joint in tree.joints}).prepare()
    except CycleError as error:
        cycle = set(error.args[1])
        shown = ", ".join([link for link in tree.links if link in cycle][:4])
        allowed = "a tree of links and joints"
        raise RobotError("robot", f"cyclic (through {shown})", allowed) from None
