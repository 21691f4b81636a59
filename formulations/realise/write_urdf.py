"""URDF of a manipulator, with links that can be seen.

At zero displacement every link's frame is parallel to the frame of the base, so that joint
origins are differences of points and axes are the directions themselves: no angle is
rounded. Numbers are written with every digit.
"""

from collections.abc import Sequence
from xml.etree import ElementTree as Tree

import numpy as np
import numpy.typing as npt

from formulations.realise.manipulator import Manipulator
from nlp.arrays import FloatArray

JOINT_COLOUR = "0.00 0.45 0.70 1"
LINK_COLOUR = "0.90 0.62 0.00 1"
TIP_COLOUR = "0.84 0.37 0.00 1"
# Sizes of bodies, in parts of the manipulator's size.
LINK_RADIUS, JOINT_RADIUS, JOINT_LENGTH, TIP_RADIUS = 0.012, 0.022, 0.09, 0.02
SPEED, EFFORT = 3.14, 100.0
_ORIGIN = np.zeros(3)


def urdf(manipulator: Manipulator, name: str = "lockedjoint") -> str:
    """Return the manipulator as URDF.

    Links are ``base``, ``link0``, ``link1``, … and ``tip``; joint ``jointk`` moves ``linkk``,
    and ``to_tip`` is fixed. The base's frame is that of the Jacobian. A revolute joint may turn
    by ±π, a prismatic one move by ± the manipulator's size.
    """
    size, n = manipulator.size, manipulator.joints
    robot = Tree.Element("robot", name=name)
    for label, colour in (("joint", JOINT_COLOUR), ("link", LINK_COLOUR), ("tip", TIP_COLOUR)):
        Tree.SubElement(Tree.SubElement(robot, "material", name=label), "color", rgba=colour)
    places = np.vstack([np.zeros(3), manipulator.points, manipulator.end_effector])
    base = Tree.SubElement(robot, "link", name="base")
    foot = {"radius": 2 * JOINT_RADIUS * size, "length": 0.25 * JOINT_LENGTH * size}
    _body(base, "joint", places[1], manipulator.directions[0], "cylinder", **foot)
    side, height = 2 * JOINT_RADIUS * size, JOINT_LENGTH * size
    box, pin = {"size": [side, side, height]}, {"radius": JOINT_RADIUS * size, "length": height}
    for i in range(n):
        link = Tree.SubElement(robot, "link", name=f"link{i}")
        axis, span = manipulator.directions[i], places[i + 2] - places[i + 1]
        length = float(np.linalg.norm(span))
        shape, sizes = ("box", box) if manipulator.prismatic[i] else ("cylinder", pin)
        _body(link, "joint", _ORIGIN, axis, shape, **sizes)
        if length > 0:
            sizes = {"radius": LINK_RADIUS * size, "length": length}
            _body(link, "link", span / 2, span / length, "cylinder", **sizes)
    tip = Tree.SubElement(robot, "link", name="tip")
    _body(tip, "tip", _ORIGIN, np.array([0.0, 0.0, 1.0]), "sphere", radius=TIP_RADIUS * size)
    names = ["base", *(f"link{i}" for i in range(n)), "tip"]
    for i in range(n):
        kind = manipulator.kinds[i]
        joint = _joint(robot, f"joint{i}", kind, names[i : i + 2], places[i + 1] - places[i])
        Tree.SubElement(joint, "axis", xyz=_numbers(manipulator.directions[i]))
        end = size if manipulator.prismatic[i] else np.pi
        limit = {"lower": -end, "upper": end, "velocity": SPEED, "effort": EFFORT}
        Tree.SubElement(joint, "limit", {key: repr(float(v)) for key, v in limit.items()})
    _joint(robot, "to_tip", "fixed", names[-2:], places[-1] - places[-2])
    Tree.indent(robot)
    return '<?xml version="1.0"?>\n' + Tree.tostring(robot, encoding="unicode") + "\n"


def _joint(
    robot: Tree.Element, name: str, kind: str, ends: Sequence[str], origin: FloatArray
) -> Tree.Element:
    joint = Tree.SubElement(robot, "joint", name=name, type=kind)
    Tree.SubElement(joint, "parent", link=ends[0])
    Tree.SubElement(joint, "child", link=ends[1])
    Tree.SubElement(joint, "origin", xyz=_numbers(origin), rpy="0 0 0")
    return joint


def _body(
    link: Tree.Element,
    material: str,
    centre: FloatArray,
    axis: FloatArray,
    shape: str,
    **sizes: npt.ArrayLike,
) -> None:
    """Add a body that can be seen; the z-axis of its shape lies along `axis`."""
    visual = Tree.SubElement(link, "visual")
    pitch = np.arctan2(np.hypot(axis[0], axis[1]), axis[2])
    yaw = np.arctan2(axis[1], axis[0])
    Tree.SubElement(visual, "origin", xyz=_numbers(centre), rpy=_numbers([0.0, pitch, yaw]))
    geometry = Tree.SubElement(visual, "geometry")
    Tree.SubElement(visual, "material", name=material)
    Tree.SubElement(geometry, shape, {name: _numbers(size) for name, size in sizes.items()})


def _numbers(values: npt.ArrayLike) -> str:
    return " ".join(map(repr, np.ravel(values).astype(float).tolist()))
