"""Read a URDF file, with yourdfpy, into a tree of our own.

What does not bear on kinematics (meshes, inertias, transmissions, simulator tags) is left
aside before it is parsed, so that it can be neither missing nor wrong.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from formulations.robots.tree import KINDS, MOVING, Mimic, RobotTree, TreeJoint
from nlp.errors import FileError, InputError

if TYPE_CHECKING:
    from lxml.etree import _Element

_KINEMATIC = ("parent", "child", "origin", "axis", "limit", "mimic")
_INSTALL = "an installed yourdfpy, which 'pip install yourdfpy' provides"


class RobotFileError(FileError):
    """A URDF file that cannot be read or understood."""


def read_urdf(path: Path) -> RobotTree:
    """Read a robot.

    Parameters
    ----------
    path
        A URDF file; xacro files must have been expanded.

    Raises
    ------
    RobotFileError
        If the file cannot be read, is no URDF, is malformed or does not describe one tree.
    InputError
        If the library that reads URDF is not installed.
    """
    try:
        content = path.read_bytes()
    except OSError as reason:
        why = (reason.strerror or str(reason)).lower()
        raise RobotFileError("file", str(path), f"a file that can be read ({why})") from None
    try:
        return parse_urdf(content)
    except InputError as error:
        if isinstance(error, RobotFileError) or error.argument == "yourdfpy":
            raise
        where = f"{path}: {error.argument}"
        raise RobotFileError(where, error.value, error.allowed) from None


def parse_urdf(content: bytes) -> RobotTree:
    """Read a robot from the text of a URDF file; InputError if it is none."""
    try:
        import yourdfpy
        from lxml import etree
    except ModuleNotFoundError:
        raise InputError("yourdfpy", "not installed", _INSTALL) from None
    from io import BytesIO

    reduced = _kinematic_part(_xml(content))
    try:
        model = yourdfpy.URDF.load(
            BytesIO(etree.tostring(reduced)), build_scene_graph=False, load_meshes=False
        )
    except (ValueError, TypeError, IndexError) as reason:
        allowed = f"numbers where URDF wants numbers ({reason})"
        raise InputError("a value", "malformed", allowed) from None
    joints = tuple(_joint(joint) for joint in model.robot.joints)
    return RobotTree(model.robot.name, tuple(link.name for link in model.robot.links), joints)


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
    """Return what of the robot bears on kinematics, with all that must be there, there."""
    from lxml import etree

    reduced = etree.Element("robot", name=root.get("name", "robot"))
    for link in root.findall("link"):
        etree.SubElement(reduced, "link", name=_attribute(link, "name", "a link"))
    for joint in root.findall("joint"):
        name = _attribute(joint, "name", "a joint")
        kind = _attribute(joint, "type", f"joint {name}")
        if kind not in KINDS:
            raise InputError(f"type of joint {name}", kind, "one of " + ", ".join(KINDS))
        copied = etree.SubElement(reduced, "joint", name=name, type=kind)
        for tag in _KINEMATIC:
            found = joint.find(tag)
            if found is not None:
                etree.SubElement(copied, tag, dict(found.attrib))
        for tag in ("parent", "child"):
            end = joint.find(tag)
            if end is None:
                raise InputError(f"joint {name}", f"without <{tag}>", "a parent and a child")
            _attribute(end, "link", f"<{tag}> of joint {name}")
        mimic = joint.find("mimic")
        if mimic is not None:
            _attribute(mimic, "joint", f"<mimic> of joint {name}")
    return reduced


def _attribute(element: _Element, name: str, what: str) -> str:
    value = element.get(name)
    if not value:
        raise InputError(what, f"without the attribute '{name}'", f"{what} with a {name}")
    return str(value)


def _joint(joint: Any) -> TreeJoint:
    lower, upper = _limits(joint)
    origin = np.eye(4) if joint.origin is None else np.asarray(joint.origin, dtype=float)
    if not np.all(np.isfinite(origin)):
        raise InputError(f"origin of joint {joint.name}", "not finite", "finite numbers")
    mimic = joint.mimic
    return TreeJoint(
        name=joint.name,
        kind=joint.type,
        parent=joint.parent,
        child=joint.child,
        origin=tuple(tuple(row) for row in origin.tolist()),
        axis=_axis(joint) if joint.type in MOVING else (1.0, 0.0, 0.0),
        lower=lower,
        upper=upper,
        mimic=None if mimic is None else _mimic(joint.name, mimic),
    )


def _axis(joint: Any) -> tuple[float, float, float]:
    axis = np.asarray(joint.axis, dtype=float)
    length = float(np.linalg.norm(axis))
    if axis.shape != (3,) or not 1e-9 < length < np.inf:
        shown = " ".join(f"{entry:g}" for entry in axis)
        allowed = "three numbers, finite and not all zero"
        raise InputError(f"axis of joint {joint.name}", shown, allowed)
    x, y, z = (axis / length).tolist()
    return x, y, z


def _mimic(name: str, mimic: Any) -> Mimic:
    if not (np.isfinite(mimic.multiplier) and np.isfinite(mimic.offset)):
        raise InputError(f"<mimic> of joint {name}", "not finite", "finite numbers")
    return Mimic(mimic.joint, float(mimic.multiplier), float(mimic.offset))


def _limits(joint: Any) -> tuple[float, float]:
    if joint.type not in ("revolute", "prismatic"):
        return -np.inf, np.inf
    if joint.limit is None:
        allowed = "a <limit>, which revolute and prismatic joints must have"
        raise InputError(f"joint {joint.name}", f"{joint.type} without limits", allowed)
    # By the URDF specification a limit that is left out is zero.
    lower, upper = (
        0.0 if side is None else float(side) for side in (joint.limit.lower, joint.limit.upper)
    )
    if not lower <= upper:
        shown = f"[{lower:g}, {upper:g}]"
        raise InputError(f"limits of joint {joint.name}", shown, "lower <= upper")
    return lower, upper
