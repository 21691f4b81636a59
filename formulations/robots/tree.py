"""A robot as its description gives it: links in a tree, joints between them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from nlp.errors import InputError

MOVING = ("revolute", "continuous", "prismatic")
KINDS = (*MOVING, "fixed", "floating", "planar")
Transform = tuple[tuple[float, ...], ...]


class RobotError(InputError):
    """A robot that is malformed, or that needs more than this library supports."""


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: its position is ``multiplier``·q + ``offset``."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class TreeJoint:
    """One joint of the tree.

    Attributes
    ----------
    name, kind
        Its name, and one of `KINDS`.
    parent, child
        The links it joins.
    origin
        Pose of the joint in the parent's frame, a homogeneous 4×4 matrix; metres.
    axis
        Unit vector in the joint's frame.
    lower, upper
        Limits, radians or metres; infinite where there are none.
    mimic
        What it follows, if it does.
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: Transform
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    lower: float = float("-inf")
    upper: float = float("inf")
    mimic: Mimic | None = None


@dataclass(frozen=True)
class RobotTree:
    """Links and joints that form one tree.

    Raises
    ------
    RobotError
        If names repeat, a joint names a link that is not there, or the links do not form
        one tree.
    """

    name: str
    links: tuple[str, ...]
    joints: tuple[TreeJoint, ...]

    def __post_init__(self) -> None:
        _check_unique("link", self.links)
        _check_unique("joint", [joint.name for joint in self.joints])
        known = set(self.links)
        for joint in self.joints:
            for side, link in (("parent", joint.parent), ("child", joint.child)):
                if link not in known:
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

    def joint(self, name: str) -> TreeJoint:
        """Return a joint by name; KeyError if there is none."""
        return {joint.name: joint for joint in self.joints}[name]

    def path(self, tip: str) -> tuple[TreeJoint, ...]:
        """Joints from the root to a link, in order."""
        above = {joint.child: joint for joint in self.joints}
        reversed_path = []
        while tip in above:
            reversed_path.append(above[tip])
            tip = above[tip].parent
        return tuple(reversed(reversed_path))


def _check_unique(kind: str, names: Sequence[str]) -> None:
    for name, count in Counter(names).items():
        if count > 1:
            raise RobotError(f"{kind} {name}", f"there {count} times", "every name once")


def _check_tree(tree: RobotTree) -> None:
    if not tree.links:
        raise RobotError("robot", "without a <link>", "at least one link")
    for link, count in Counter(joint.child for joint in tree.joints).items():
        if count > 1:
            allowed = "one parent at most: closed loops are not supported"
            raise RobotError(f"link {link}", f"the child of {count} joints", allowed)
    children = {joint.child for joint in tree.joints}
    roots = [link for link in tree.links if link not in children]
    if len(roots) > 1:
        shown = ", ".join(roots[:4])
        raise RobotError("robot", f"in pieces that start at {shown}", "one connected tree")
    reached = set(roots)
    while True:
        grown = reached | {joint.child for joint in tree.joints if joint.parent in reached}
        if grown == reached:
            break
        reached = grown
    looped = [link for link in tree.links if link not in reached]
    if looped:
        shown = ", ".join(looped[:4])
        raise RobotError("robot", f"cyclic (through {shown})", "a tree of links and joints")
