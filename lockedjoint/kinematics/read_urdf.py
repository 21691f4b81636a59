"""Read a URDF file: the kinematics alone, each number checked as it is read; and XML of robots.

Pinocchio's reader is not used. It refuses files that can be read (mimic joints before the
joint that they follow, as in Talos and Romeo; limits without an effort), accepts axes of length
0 and cycles beside the tree, says on standard error only what is wrong, and is not there on
Windows. The kinematics are so small a part of URDF that no library is needed.

What comes in: the bytes of a file (`xml_root`), then its root element (`urdf_tree`), or a model
of yourdfpy. What goes out: a `RobotTree`, in radians and metres.

XML is read by Python's own parser, expat. No other file is opened and no entity is resolved;
prefixes of simulators' tags need no declaration. What does not bear on kinematics (meshes,
inertias, transmissions, simulator tags) is not looked at, so that it can be neither missing nor
wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, TypeVar
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from lockedjoint.formulations.io.files import read_bytes, real_in
from lockedjoint.kinematics.chain import LARGEST
from lockedjoint.kinematics.geometry import homogeneous
from lockedjoint.kinematics.tree import MOVING, Limit, Mimic, RobotTree, TreeJoint
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import FileError, InputError, MissingLibraryError

if TYPE_CHECKING:
    from yourdfpy import Robot as UrdfRobot

#: This element of a joint is none of URDF: it states the joint's `TreeJoint.speed`.
DESIGN = "lockedjoint"
# A larger file is refused: 150 000 links take 30 MB, and robots that exist less than 1 MB.
LARGEST_FILE_BYTES = 50_000_000
# A file whose elements are nested more deeply is refused.
_MOST_LEVELS = 256
# An attribute that is longer is refused.
_MOST_CHARACTERS = 1_000_000
# An error of a xacro file allows this.
_XACRO = "plain URDF, which the command `xacro FILE.urdf.xacro > FILE.urdf` makes"
# Numbers of an attribute are counted in words.
_COUNTS = {1: "one number", 3: "three numbers", 4: "four numbers"}
# A quaternion must be longer than this, which has no unit: it is divided by its length.
_SHORTEST_QUATERNION = 1e-9
_Read = TypeVar("_Read")
# A joint has one of these types.
_KINDS = (*MOVING, "fixed", "floating", "planar")
# These versions of URDF are read.
_VERSIONS = ("1.0", "1.1", "1.2")
# Rotations may be quaternions from this version on.
_QUATERNIONS = "1.1"
# A quaternion is in this attribute.
_QUATERNION = "quat_xyzw"


def urdf_tree(root: Element) -> RobotTree:
    """Read a robot from the root element of a URDF; InputError if it is wrong.

    A revolute or prismatic joint without ``<limit>`` is invalid URDF: it has the limits 0 and
    0, the defaults of the attributes, or none of its own if it mimics another. Files of xacro
    must have been expanded.
    """
    if any("xacro" in element.tag for element in root.iter()):
        raise InputError("content", "xacro", _XACRO)
    _check_version(root)
    links = tuple(attribute(link, "name", "a link") for link in root.findall("link"))
    joints = tuple(_joint(joint) for joint in root.findall("joint"))
    return RobotTree(root.get("name", "robot"), links, joints)


def yourdfpy_tree(robot: UrdfRobot) -> RobotTree:
    """Return the robot of a model of yourdfpy; InputError if it is wrong."""
    joints = []
    for joint in robot.joints:
        limit, mimic = joint.limit, joint.mimic
        if mimic is not None:
            factor = 1.0 if mimic.multiplier is None else float(mimic.multiplier)
            mimic = Mimic(mimic.joint, factor, float(mimic.offset or 0.0))
        if limit is not None:
            given = (limit.lower, limit.upper, limit.velocity)
            limit = Limit(*(float(number or 0.0) for number in given))
        joints.append(
            TreeJoint(
                joint.parent,
                joint.child,
                joint.name,
                joint.type,
                np.eye(4) if joint.origin is None else joint.origin,
                np.eye(3)[0] if joint.axis is None else joint.axis,
                _limit(joint.type, limit, mimic),
                mimic,
            )
        )
    return RobotTree(robot.name, tuple(link.name for link in robot.links), tuple(joints))


def pose_of(element: Element, where: str) -> FloatArray:
    """Return the pose that the ``<origin>`` of an element states, 4×4; InputError if wrong."""
    origin = element.find("origin")
    place = f"<origin> of {where}"
    shift = numbers(origin, "xyz", "0 0 0", place, LARGEST)
    if origin is not None and _QUATERNION in origin.attrib:
        if "rpy" in origin.attrib:
            raise InputError(place, f"with rpy and {_QUATERNION}", "one of them")
        quaternion = np.array(numbers(origin, _QUATERNION, "0 0 0 1", place, LARGEST))
        if not np.linalg.norm(quaternion) > _SHORTEST_QUATERNION:
            allowed = "a quaternion that is not 0"
            raise InputError(f"{_QUATERNION} of {place}", "0 0 0 0", allowed)
        from scipy.spatial.transform import Rotation  # takes long to load

        return homogeneous(Rotation.from_quat(quaternion).as_matrix(), shift) + 0.0
    roll, pitch, yaw = numbers(origin, "rpy", "0 0 0", place, LARGEST)
    (sr, sp, sy), (cr, cp, cy) = np.sin([roll, pitch, yaw]), np.cos([roll, pitch, yaw])
    # This is Rz(yaw) Ry(pitch) Rx(roll), as URDF has it.
    rows = [
        [cp * cy, sp * (cy * sr) - cr * sy, sp * (cr * cy) + sr * sy],
        [cp * sy, sp * (sr * sy) + cr * cy, sp * (cr * sy) - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return homogeneous(np.array(rows), shift) + 0.0  # no -0


def _check_version(root: Element) -> None:
    """Refuse versions of URDF that are not known, and what the stated one does not have."""
    version = root.get("version", _VERSIONS[0])
    if version not in _VERSIONS:
        raise InputError("version of <robot>", version, f"one of {', '.join(_VERSIONS)}")
    if version < _QUATERNIONS and any(_QUATERNION in one.attrib for one in root.iter("origin")):
        allowed = f'a file that states version="{_QUATERNIONS}", the first that has it'
        raise InputError(_QUATERNION, f"in a file of version {version}", allowed)


def _joint(joint: Element) -> TreeJoint:
    """Return the joint that a ``<joint>`` describes; InputError if it is wrong."""
    name = attribute(joint, "name", "a joint")
    where = f"joint {name}"
    kind = attribute(joint, "type", where)
    if kind not in _KINDS:
        raise InputError(f"type of {where}", kind, "one of " + ", ".join(_KINDS))
    parent, child = (_end(joint, tag, where) for tag in ("parent", "child"))
    axis = np.array(numbers(joint.find("axis"), "xyz", "1 0 0", f"<axis> of {where}", LARGEST))
    element, mimic = joint.find("mimic"), None
    if element is not None:
        place = f"<mimic> of {where}"
        driver = attribute(element, "joint", place)
        ((factor,), (offset,)) = (
            numbers(element, key, default, place, LARGEST)
            for key, default in (("multiplier", "1"), ("offset", "0"))
        )
        mimic = Mimic(driver, factor, offset)
    element, limit = joint.find("limit"), None
    if element is not None:
        # A limit that is left out is zero, as the URDF specification says.
        keys, place = ("lower", "upper", "velocity"), f"<limit> of {where}"
        limit = Limit(*(numbers(element, key, "0", place, math.inf)[0] for key in keys))
    element = joint.find(DESIGN)
    (speed,) = numbers(element, "speed", "1", f"<{DESIGN}> of {where}", LARGEST)
    origin = pose_of(joint, where)
    limits = _limit(kind, limit, mimic)
    return TreeJoint(parent, child, name, kind, origin, axis, limits, mimic, speed)


def _end(joint: Element, tag: str, where: str) -> str:
    """Return the link of a joint's ``<parent>`` or ``<child>``."""
    end = joint.find(tag)
    if end is None:
        raise InputError(where, f"without <{tag}>", "a parent and a child")
    return attribute(end, "link", f"<{tag}> of {where}")


def _limit(kind: str, limit: Limit | None, mimic: Mimic | None) -> Limit:
    """Return the limits that a joint has, from those that its file states."""
    if limit is None:
        bounded = kind in ("revolute", "prismatic") and mimic is None
        return Limit(0.0, 0.0) if bounded else Limit()
    if kind not in ("revolute", "prismatic"):
        return Limit(velocity=limit.velocity)
    return limit


def from_file(path: Path, parse: Callable[[bytes], _Read]) -> _Read:
    """Return what is parsed from a file's content; FileError, which names the file, if none."""
    return parsed(path, content_of(path), parse)


def content_of(path: Path) -> bytes:
    """Return what a file of a robot holds; FileError if it cannot be read or is too large."""
    return read_bytes(path, most=LARGEST_FILE_BYTES)


def parsed(path: Path, content: bytes, parse: Callable[[bytes], _Read]) -> _Read:
    """Return what is parsed from a content; FileError, which names its file, if none."""
    try:
        return parse(content)
    except (MissingLibraryError, FileError):
        raise
    except InputError as error:
        raise FileError(f"{path}: {error.argument}", error.value, error.allowed) from None


def xml_root(content: bytes) -> Element:
    """Return the root of the XML; InputError if it is none, or declares entities."""
    if content.startswith(b"\x1f\x8b"):
        # These are the first bytes of every gzip file.
        raise InputError("content", "compressed with gzip", "plain XML (unpack the file first)")
    builder, parser = TreeBuilder(), expat.ParserCreate()
    depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > _MOST_LEVELS:
            raise InputError("content", "nested too deeply", f"at most {_MOST_LEVELS} levels")
        if any(len(text) > _MOST_CHARACTERS for text in attributes.values()):
            allowed = f"attributes of at most {_MOST_CHARACTERS} characters"
            raise InputError("content", "with a text that is too long", allowed)
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def entity(*_: object) -> NoReturn:
        raise InputError("content", "XML with <!ENTITY>", "XML without entities")

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.EntityDeclHandler = entity
    try:
        parser.Parse(content, True)
    except (expat.ExpatError, ValueError, LookupError) as error:  # the latter: of encodings
        if isinstance(error, InputError):
            raise
        allowed = f"well-formed XML ({error})"
        if b"<" not in content:
            allowed += "; the name of a file of numbers ends in .csv"
        raise InputError("content", "not XML", allowed) from None
    return builder.close()


def is_urdf(content: bytes) -> bool:
    """Whether the text of a file is URDF by its root element."""
    try:
        return xml_root(content).tag == "robot"
    except InputError:
        return False


def attribute(element: Element | None, name: str, what: str) -> str:
    """Return an attribute that must be there; InputError, which says of what, if it is not."""
    value = None if element is None else element.get(name)
    if not value:
        raise InputError(what, f"without the attribute '{name}'", f"{what} with a {name}")
    return value


def numbers(
    element: Element | None, name: str, default: str, where: str, largest: float = math.inf
) -> list[float]:
    """Return the numbers of an attribute, as many as the default has.

    InputError if there are more or fewer, or one is NaN or larger.
    """
    text = default if element is None else element.get(name, default)
    count = len(default.split())
    try:
        values = [real_in(part) for part in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not all(abs(value) <= largest for value in values):
        size = f", of size at most {largest:g}" if largest < math.inf else ""
        allowed = f"{_COUNTS[count]}{size}"
        xacro = "${" in text or "$(" in text
        raise InputError(f"{name} of {where}", text, _XACRO if xacro else allowed)
    return values
