"""Read a URDF file with yourdfpy: links and joints, checked to form one tree.

What does not bear on kinematics (meshes, inertias, transmissions, simulator tags) is removed
before yourdfpy parses the file, so that it can be neither missing nor wrong.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from nlp.arrays import FloatArray
from nlp.errors import FileError, InputError
from nlp.files import read_bytes

if TYPE_CHECKING:
    from lxml.etree import _Element
    from yourdfpy import Joint

MOVING = ("revolute", "continuous", "prismatic")
KINDS = (*MOVING, "fixed", "floating", "planar")
_KINEMATIC = ("parent", "child", "origin", "axis", "limit", "mimic")
_INSTALL = "an installed yourdfpy, which 'pip install yourdfpy' provides"


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
        for joint in self.joints:
            for side, link in (("parent", joint.parent), ("child", joint.child)):
                if link not in self.links:
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
            path.insert(0, above[tip])
            tip = path[0].parent
        return tuple(path)


def read_urdf(path: Path) -> RobotTree:
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
        `limit.lower` and `limit.upper` are radians or metres, infinite without limits.

    Raises
    ------
    FileError
        If the file cannot be read, is no URDF, is malformed or does not describe one tree.
    InputError
        If the library that reads URDF is not installed.
    """
    content = read_bytes(path)
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

    reduced = BytesIO(etree.tostring(_kinematic_part(_xml(content))))
    try:
        robot = yourdfpy.URDF.load(reduced, build_scene_graph=False, load_meshes=False).robot
    except (ValueError, TypeError, IndexError) as reason:
        allowed = f"numbers where URDF wants numbers ({reason})"
        raise InputError("a value", "malformed", allowed) from None
    for joint in robot.joints:
        lower, upper = _limits(joint)
        joint.limit = yourdfpy.Limit(lower=lower, upper=upper)
        joint.origin = np.eye(4) if joint.origin is None else joint.origin
        _check_finite("origin", joint, joint.origin)
        if joint.type in MOVING:
            joint.axis = _axis(joint)
        if joint.mimic is not None:
            _check_finite("<mimic>", joint, [joint.mimic.multiplier, joint.mimic.offset])
    return RobotTree(robot.name, tuple(link.name for link in robot.links), tuple(robot.joints))


def _xml(content: bytes) -> _Element:
    """Root of the XML; undeclared name spaces, which simulators' tags have, are no error."""
    from lxml import etree

    parser = etree.XMLParser(recover=True, resolve_entities=False, no_network=True)
    root = etree.fromstring(content, parser) if content.strip() else None
    faults = [e for e in parser.error_log if e.type_name != "NS_ERR_UNDEFINED_NAMESPACE"]
    if root is None or faults:
        why = f" ({faults[0].message}, line {faults[0].line})" if faults else ""
        raise InputError("content", "not XML", f"well-formed XML{why}")
    if root.tag != "robot":
        raise InputError("root element", f"<{root.tag}>", "<robot>, as in URDF")
    if any("xacro" in str(element.tag) for element in root.iter()):
        raise InputError("content", "xacro", "plain URDF: run xacro on it first")
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
        parts = {tag: joint.find(tag) for tag in _KINEMATIC}
        for tag, attribute in (("parent", "link"), ("child", "link"), ("mimic", "joint")):
            part = parts[tag]
            if part is not None:
                _attribute(part, attribute, f"<{tag}> of joint {name}")
            elif tag != "mimic":
                raise InputError(f"joint {name}", f"without <{tag}>", "a parent and a child")
        copied = etree.SubElement(reduced, "joint", name=name, type=kind)
        for tag, part in parts.items():
            if part is not None:
                etree.SubElement(copied, tag, dict(part.attrib))
    return reduced


def _attribute(element: _Element, name: str, what: str) -> str:
    value = element.get(name)
    if not value:
        raise InputError(what, f"without the attribute '{name}'", f"{what} with a {name}")
    return str(value)


def _limits(joint: Joint) -> tuple[float, float]:
    if joint.type not in ("revolute", "prismatic"):
        return -np.inf, np.inf
    if joint.limit is None:
        allowed = "a <limit>, which revolute and prismatic joints must have"
        raise InputError(f"joint {joint.name}", f"{joint.type} without limits", allowed)
    # By the URDF specification a limit that is left out is zero.
    lower, upper = (float(side or 0.0) for side in (joint.limit.lower, joint.limit.upper))
    if not lower <= upper:
        shown = f"[{lower:g}, {upper:g}]"
        raise InputError(f"limits of joint {joint.name}", shown, "lower <= upper")
    return lower, upper


def _check_finite(part: str, joint: Joint, numbers: npt.ArrayLike) -> None:
    if not np.all(np.isfinite(numbers)):
        raise InputError(f"{part} of joint {joint.name}", "not finite", "finite numbers")


def _axis(joint: Joint) -> FloatArray:
    axis = np.asarray(joint.axis, dtype=float)
    length = float(np.linalg.norm(axis))
    if axis.shape != (3,) or not 1e-9 < length < np.inf:
        shown = " ".join(f"{entry:g}" for entry in axis)
        allowed = "three numbers, finite and not all zero"
        raise InputError(f"axis of joint {joint.name}", shown, allowed)
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
        shown = ", ".join([link for link in tree.links if link in error.args[1]][:4])
        allowed = "a tree of links and joints"
        raise RobotError("robot", f"cyclic (through {shown})", allowed) from None
