"""URDF of a manipulator, with links that can be seen, weighed and stepped by simulators.

What comes in: a `Manipulator`. What goes out: the text of a file. `urdf_elements` makes its
parts.

At zero displacement every link's frame is parallel to the frame of the base, so that joint
origins are differences of points and axes are the directions themselves: no angle is
rounded.

Masses are nominal: every link weighs `MASS_KG`, shared out over its bodies by volume, and its
inertia is that of these solid bodies. What collides is the cylinder of each link, cut short at
both ends (`links.free_parts`), and the tip: links that meet at a joint, or where several axes
meet, do not collide there.
"""

from __future__ import annotations

from xml.etree import ElementTree as Tree

import numpy as np

from lockedjoint.kinematics.read_urdf import DESIGN
from lockedjoint.nlp.errors import InputError, of_kind
from lockedjoint.synthesis.links import LINK_RADIUS, free_parts
from lockedjoint.synthesis.manipulator import Manipulator
from lockedjoint.synthesis.urdf_elements import Solid, add_joint, add_link, numbers

# Colours of joints, links and the tip: red, green, blue and opacity.
_COLOURS = {"joint": "0.00 0.45 0.70 1", "link": "0.90 0.62 0.00 1", "tip": "0.84 0.37 0.00 1"}
# Radius of a joint's body, in shares of the manipulator's size.
JOINT_RADIUS = 0.022
# Length of a joint's body, in shares of the manipulator's size.
JOINT_LENGTH = 0.09
# Radius of the ball at the tip, in shares of the manipulator's size.
TIP_RADIUS = 0.02
# Mass of every link, in kilograms.
MASS_KG = 1.0
# Mass of the tip, in kilograms.
TIP_MASS_KG = 0.1
# Largest speed of every joint, in radians or metres per second.
SPEED = 3.14
# Largest effort of every joint, in newton metres or newtons.
EFFORT = 100.0
# Smallest manipulator that simulators can step, in metres: MuJoCo's least inertia is 1e-15.
SMALLEST_M = 1e-4
# Largest manipulator that simulators can step, in metres.
LARGEST_M = 1e4
_ORIGIN = np.zeros(3)
_Z = np.array([0.0, 0.0, 1.0])


def urdf(manipulator: Manipulator, name: str = "lockedjoint") -> str:
    """Return the manipulator as URDF.

    Links are ``base``, ``link0``, ``link1``, … and ``tip``; joint ``jointk`` moves ``linkk``,
    and ``to_tip`` is fixed. The base's frame is that of the Jacobian. A revolute joint may turn
    by ±π, a prismatic one move by ± the manipulator's size. `Manipulator.speeds` other than 1
    are in elements ``<lockedjoint speed="…"/>``, which `read_robot` reads and others skip.

    Raises
    ------
    InputError
        If the manipulator is so small or so large that simulators cannot step it.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> text = lj.urdf(lj.realise(lj.optimal_jacobian(8)), name="arm")
    >>> text.splitlines()[1]
    '<robot name="arm">'
    """
    of_kind("manipulator", manipulator, Manipulator, "a Manipulator, as `realise` returns it")
    if not of_kind("name", name, str, "a name, as text").isprintable():
        raise InputError("name", name, "a name without control characters")
    size, n = manipulator.size, manipulator.joints
    if not SMALLEST_M <= size <= LARGEST_M:
        allowed = f"{SMALLEST_M:g} to {LARGEST_M:g} metres in a URDF; choose another length"
        raise InputError("size of the manipulator", f"{size:.6g} m", allowed)
    robot = Tree.Element("robot", name=name)
    robot.append(Tree.Comment(f" Masses are nominal: {MASS_KG:g} kg per link. "))
    for label, colour in _COLOURS.items():
        Tree.SubElement(Tree.SubElement(robot, "material", name=label), "color", rgba=colour)
    # Origins of the links' frames: the base, a link for each joint, and the tip, (n + 2, 3).
    places = np.vstack([np.zeros(3), manipulator.points, manipulator.end_effector])
    starts, stops = free_parts(manipulator)
    # Radius and length of a joint's body; the base is a flat cylinder of twice the radius.
    pin, height = JOINT_RADIUS * size, JOINT_LENGTH * size
    axis = manipulator.directions[0]
    foot = Solid("joint", "cylinder", places[1], axis, 2 * pin, height / 4)
    add_link(robot, "base", [foot], MASS_KG)
    for i in range(n):
        axis, span = manipulator.directions[i], places[i + 2] - places[i + 1]
        shape = "box" if manipulator.prismatic[i] else "cylinder"
        bodies = [Solid("joint", shape, _ORIGIN, axis, pin, height)]
        collides = []
        length = float(np.linalg.norm(span))
        if length > 0:
            radius, along = LINK_RADIUS * size, span / length
            bodies.append(Solid("link", "cylinder", span / 2, along, radius, length))
            middle = (starts[i] + stops[i]) / 2 - places[i + 1]
            short = float(np.linalg.norm(stops[i] - starts[i]))
            collides.append(Solid("link", "cylinder", middle, along, radius, short))
        add_link(robot, f"link{i}", bodies, MASS_KG, collides)
    ball = [Solid("tip", "sphere", _ORIGIN, _Z, TIP_RADIUS * size)]
    # No wider than its link: what has room, as `links.link_gap` counts it, does not collide.
    end_body = [Solid("tip", "sphere", _ORIGIN, _Z, LINK_RADIUS * size)]
    add_link(robot, "tip", ball, TIP_MASS_KG, end_body)
    names = ["base", *(f"link{i}" for i in range(n)), "tip"]
    for i in range(n):
        kind = manipulator.kinds[i]
        joint = add_joint(robot, f"joint{i}", kind, names[i : i + 2], places[i + 1] - places[i])
        Tree.SubElement(joint, "axis", xyz=numbers(manipulator.directions[i]))
        end = size if manipulator.prismatic[i] else np.pi
        limit = {"lower": -end, "upper": end, "velocity": SPEED, "effort": EFFORT}
        Tree.SubElement(joint, "limit", {key: repr(float(v)) for key, v in limit.items()})
        if manipulator.speeds[i] != 1:
            Tree.SubElement(joint, DESIGN, speed=repr(float(manipulator.speeds[i])))
    add_joint(robot, "to_tip", "fixed", names[-2:], places[-1] - places[-2])
    Tree.indent(robot)
    return '<?xml version="1.0"?>\n' + Tree.tostring(robot, encoding="unicode") + "\n"
