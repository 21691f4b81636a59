"""A robot as yourdfpy reads it: links and joints, checked to form one tree."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from typing import TYPE_CHECKING

from nlp.errors import InputError

if TYPE_CHECKING:
    from yourdfpy import Joint

MOVING = ("revolute", "continuous", "prismatic")
KINDS = (*MOVING, "fixed", "floating", "planar")


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
        _check_unique("link", self.links)
        _check_unique("joint", [joint.name for joint in self.joints])
        for joint in self.joints:
            for side, link in (("parent", joint.parent), ("child", joint.child)):
                if link not in self.links:
                    allowed = "the name of a <link> of the robot"
                    raise RobotError(f"{side} of joint {joint.name}", link, allowed)
        _check_tree(self)

    @property
    def root(self) -> str:
        """The link that is no joint's child."""
        return self._links_without(joint.child for joint in self.joints)[0]

    @property
    def leaves(self) -> tuple[str, ...]:
        """Links that are no joint's parent."""
        return self._links_without(joint.parent for joint in self.joints)

    def joint(self, name: str) -> Joint:
        """Return a joint by name; KeyError if there is none."""
        return {joint.name: joint for joint in self.joints}[name]

    def path(self, tip: str) -> tuple[Joint, ...]:
        """Joints from the root to a link, in order."""
        above = {joint.child: joint for joint in self.joints}
        reversed_path = []
        while tip in above:
            reversed_path.append(above[tip])
            tip = above[tip].parent
        return tuple(reversed(reversed_path))

    def _links_without(self, excluded: Iterable[str]) -> tuple[str, ...]:
        names = set(excluded)
        return tuple(link for link in self.links if link not in names)


def _check_unique(kind: str, names: Sequence[str]) -> None:
    for name, count in Counter(names).items():
        if count > 1:
            raise RobotError(f"{kind} {name}", f"there {count} times", "every name once")


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
