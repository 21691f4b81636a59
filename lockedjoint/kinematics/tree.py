"""A robot as links and joints, checked to form one tree, whatever it was read from.

Readers of files and models (`read_urdf`, `read_mujoco` …) make a `RobotTree`; `chain_between`
makes a `Chain` of some of its joints. Lengths are metres, angles radians.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field
from functools import cached_property
from graphlib import CycleError, TopologicalSorter

import numpy as np

from lockedjoint.formulations.io.objects import Brief
from lockedjoint.kinematics.chain import LARGEST, listed
from lockedjoint.nlp.arrays import FloatArray, as_floats
from lockedjoint.nlp.errors import InputError, of_kind

# Joints of these types move.
MOVING = ("revolute", "continuous", "prismatic")
# An axis that is shorter, before it is made a unit vector, counts as zero and is refused.
_SHORTEST_AXIS = 1e-9


def unused(name: str, names: Collection[str]) -> str:
    """Return a name for what has none in a file, changed until it is none of some names."""
    while name in names:
        name += "'"
    return name


class RobotError(InputError):
    """A robot that is malformed, or that needs more than this library supports."""


@dataclass(frozen=True)
class Limit:
    """Where a joint can be, in radians or metres, and how fast it can move, per second."""

    lower: float = -np.inf
    upper: float = np.inf
    velocity: float = np.inf


@dataclass(frozen=True)
class Mimic:
    """What a joint follows: it is at ``multiplier`` · position of ``joint`` + ``offset``."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class TreeJoint(Brief):
    """A joint between two links, which are named.

    Raises
    ------
    InputError
        If a number is NaN, infinite or too large, the axis is zero, or the limits contradict.
    """

    parent: str
    child: str
    name: str
    type: str  #: One of `MOVING`, ``"fixed"``, or anything else, which no chain can have.
    #: The origin is the joint's frame, and the child's, at position 0. It is a 4×4 matrix in
    #: the parent's frame, in metres.
    origin: FloatArray
    #: The joint rotates about its axis or moves along it. The axis is in the joint's frame, and
    #: becomes a unit vector.
    axis: FloatArray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    limit: Limit = Limit()  #: Those beyond `LARGEST` are made none.
    mimic: Mimic | None = None  #: The joint that it follows, if any.
    #: The speed multiplies the joint's column of J, as in `Manipulator.speeds`. It is not 1 if
    #: a prismatic joint was designed in another unit than the metre; positions stay in metres.
    speed: float = 1.0

    def __post_init__(self) -> None:
        pose = as_floats(f"origin of joint {self.name}", self.origin)
        if pose.shape != (4, 4) or not np.all(np.abs(pose) <= LARGEST):
            allowed = f"a homogeneous 4×4 matrix, with entries of size at most {LARGEST:g}"
            raise InputError(f"origin of joint {self.name}", "no such matrix", allowed)
        if self.type in MOVING:
            where = f"axis of joint {self.name}"
            axis = as_floats(where, self.axis).ravel()
            length = float(np.linalg.norm(axis)) if axis.shape == (3,) else 0.0
            if not _SHORTEST_AXIS < length < math.inf:
                shown = " ".join(f"{entry:g}" for entry in axis[:4])
                raise InputError(where, shown, "three numbers, not all zero")
            object.__setattr__(self, "axis", axis / length)
            mimic = self.mimic
            if mimic and not abs(mimic.multiplier) + abs(mimic.offset) < math.inf:
                shown = f"multiplier {mimic.multiplier:g} and offset {mimic.offset:g}"
                raise InputError(f"<mimic> of joint {self.name}", shown, "finite numbers")
        if not 1 / LARGEST <= self.speed <= LARGEST:
            allowed = f"{1 / LARGEST:g} to {LARGEST:g}"
            raise InputError(f"speed of joint {self.name}", self.speed, allowed)
        lower, upper, speed = self.limit.lower, self.limit.upper, abs(self.limit.velocity)
        if not lower <= upper or lower > LARGEST or upper < -LARGEST:
            allowed = f"lower <= upper, with a position of size at most {LARGEST:g} between"
            raise InputError(f"limits of joint {self.name}", f"[{lower:g}, {upper:g}]", allowed)
        # Files that know no speed write 0; nothing could move.
        limit = Limit(
            lower if lower >= -LARGEST else -np.inf,
            upper if upper <= LARGEST else np.inf,
            speed if speed > 0 else np.inf,
        )
        object.__setattr__(self, "limit", limit)


@dataclass(frozen=True, eq=False, repr=False)
class RobotTree(Brief):
    """A robot: the names of its links, and joints, which form one tree.

    Raises
    ------
    RobotError
        If names repeat, a joint names a link that does not exist, or the links do not form
        one tree.
    """

    name: str
    links: tuple[str, ...]
    joints: tuple[TreeJoint, ...]
    remarks: tuple[str, ...] = ()  #: Sentences on what the user should check in the file.

    def __post_init__(self) -> None:
        named = [("link", link) for link in self.links]
        named += [("joint", joint.name) for joint in self.joints]
        for (kind, name), count in Counter(named).items():
            if count > 1:
                raise RobotError(f"{kind} {name}", f"there {count} times", "every name once")
        if not self.links:
            raise RobotError("robot", "without a <link>", "at least one link")
        links = set(self.links)
        for joint in self.joints:
            for side, link in (("parent", joint.parent), ("child", joint.child)):
                if link not in links:
                    allowed = "the name of a <link> of the robot"
                    raise RobotError(f"{side} of joint {joint.name}", link, allowed)
        children = Counter(joint.child for joint in self.joints)
        for link, count in children.items():
            if count > 1:
                allowed = "one parent at most: closed loops are not supported"
                raise RobotError(f"link {link}", f"the child of {count} joints", allowed)
        roots = [link for link in self.links if link not in children]
        if len(roots) > 1:
            shown = ", ".join(roots[:4])
            raise RobotError("robot", f"in pieces that start at {shown}", "one connected tree")
        try:
            _ = self.parents_first
        except CycleError as error:
            cycle = set(error.args[1])
            shown = ", ".join([link for link in self.links if link in cycle][:4])
            allowed = "a tree of links and joints"
            raise RobotError("robot", f"cyclic (through {shown})", allowed) from None

    @property
    def parents_first(self) -> tuple[TreeJoint, ...]:
        """The joints, each after the one before it."""
        above = self._above
        order = TopologicalSorter({k: [v.parent] for k, v in above.items()}).static_order()
        return tuple(above[link] for link in order if link in above)

    @cached_property
    def _above(self) -> dict[str, TreeJoint]:
        """The joint that each link but the root is the child of."""
        return {joint.child: joint for joint in self.joints}

    @property
    def root(self) -> str:
        """The link that is no joint's child."""
        return next(link for link in self.links if link not in self._above)

    @property
    def leaves(self) -> tuple[str, ...]:
        """Links that are no joint's parent."""
        parents = {joint.parent for joint in self.joints}
        return tuple(link for link in self.links if link not in parents)

    def last_link(self, argument: str = "tip") -> str:
        """Return the only leaf; InputError, which names the argument, if there are several."""
        leaves = self.leaves
        if len(leaves) > 1:
            allowed = f"a link of {self.name}; its last ones are {listed(leaves)}"
            raise InputError(argument, "missing", allowed)
        return leaves[0]

    def path(self, tip: str) -> tuple[TreeJoint, ...]:
        """Joints from the root to a link, in order."""
        of_kind("tip", tip, str, "the name of a link")
        path: list[TreeJoint] = []
        while tip in self._above:
            path.append(self._above[tip])
            tip = path[-1].parent
        return tuple(reversed(path))
