"""Elements of a URDF file: links of solid bodies, and joints.

What comes in: bodies, masses and places in metres. What goes out: elements of XML. Numbers are
written with every digit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple
from xml.etree import ElementTree as Tree

import numpy as np
import numpy.typing as npt

from lockedjoint.nlp.arrays import FloatArray


class Solid(NamedTuple):
    """A solid, round or square about an axis, in the link's frame; lengths are metres."""

    material: str  #: Name of its colour.
    shape: str  #: Its element in URDF: ``cylinder``, ``box`` or ``sphere``.
    centre: FloatArray  #: Shape (3,).
    axis: FloatArray  #: Unit vector, shape (3,).
    radius: float  #: Half of the side of a box, across the axis.
    length: float = 0.0  #: Along the axis; a sphere has none.

    @property
    def volume(self) -> float:
        """Its volume, in m³."""
        if self.shape == "sphere":
            return 4 / 3 * np.pi * self.radius**3
        # A box has the side 2·radius.
        section = np.pi if self.shape == "cylinder" else 4.0
        return section * self.radius**2 * self.length

    def inertia(self, mass: float) -> FloatArray:
        """Return the inertia about the centre, kg·m², along the frame's axes, shape (3, 3).

        The factors are those of homogeneous solids: 2/5 r² of a sphere; r²/2 of a cylinder and
        (2r)²/6 of a box along the axis, and half of it + length²/12 across.
        """
        square = mass * self.radius**2
        if self.shape == "sphere":
            return np.asarray(0.4 * square * np.eye(3))
        along = square / 2 if self.shape == "cylinder" else 2 * square / 3
        across = along / 2 + mass * self.length**2 / 12
        onto = np.outer(self.axis, self.axis)
        return np.asarray(across * np.eye(3) + (along - across) * onto)

    def element(self) -> Tree.Element:
        """Return the shape as an element of URDF, with the z-axis along the axis."""
        sizes: dict[str, npt.ArrayLike] = {"radius": self.radius}
        if self.shape == "box":
            sizes = {"size": [2 * self.radius, 2 * self.radius, self.length]}
        elif self.shape == "cylinder":
            sizes["length"] = self.length
        return Tree.Element(self.shape, {name: numbers(size) for name, size in sizes.items()})


def add_link(
    robot: Tree.Element,
    name: str,
    bodies: Sequence[Solid],
    mass: float,
    collides: Sequence[Solid] = (),
) -> None:
    """Add a link to a robot's element.

    The solid bodies are what is seen, and share its mass, kg, by volume; `collides` are the
    bodies that collide.
    """
    link = Tree.SubElement(robot, "link", name=name)
    shares = np.array([body.volume for body in bodies])
    masses = mass * shares / shares.sum()
    centres = np.array([body.centre for body in bodies])
    centre = masses @ centres / mass
    inertia = np.zeros((3, 3))
    for body, share in zip(bodies, masses, strict=True):
        away = body.centre - centre
        inertia += body.inertia(float(share))
        # Steiner's theorem moves the inertia to the common centre.
        inertia += share * (away @ away * np.eye(3) - np.outer(away, away))
    inertial = Tree.SubElement(link, "inertial")
    Tree.SubElement(inertial, "origin", xyz=numbers(centre), rpy="0 0 0")
    Tree.SubElement(inertial, "mass", value=numbers(mass))
    entries = zip(*np.triu_indices(3), strict=True)
    values = {f"i{'xyz'[i]}{'xyz'[j]}": numbers(inertia[i, j]) for i, j in entries}
    Tree.SubElement(inertial, "inertia", values)
    for body in bodies:
        visual = _shape(link, "visual", body)
        Tree.SubElement(visual, "material", name=body.material)
    for body in collides:
        _shape(link, "collision", body)


def _shape(link: Tree.Element, use: str, body: Solid) -> Tree.Element:
    """Add a body to a link as its ``visual`` or ``collision`` element."""
    element = Tree.SubElement(link, use)
    axis = body.axis
    pitch = np.arctan2(np.hypot(axis[0], axis[1]), axis[2])
    yaw = np.arctan2(axis[1], axis[0])
    rpy = numbers([0.0, pitch, yaw])
    Tree.SubElement(element, "origin", xyz=numbers(body.centre), rpy=rpy)
    Tree.SubElement(element, "geometry").append(body.element())
    return element


def add_joint(
    robot: Tree.Element, name: str, kind: str, ends: Sequence[str], origin: FloatArray
) -> Tree.Element:
    """Add a joint of a kind of URDF between two links, whose frames are parallel.

    `ends` are the names of parent and child, and the origin, (3,), is in metres.
    """
    joint = Tree.SubElement(robot, "joint", name=name, type=kind)
    Tree.SubElement(joint, "parent", link=ends[0])
    Tree.SubElement(joint, "child", link=ends[1])
    Tree.SubElement(joint, "origin", xyz=numbers(origin), rpy="0 0 0")
    return joint


def numbers(values: npt.ArrayLike) -> str:
    """Return numbers as text, with every digit."""
    return " ".join(map(repr, np.ravel(values).astype(float).tolist()))
