"""What an SRDF file says beside a URDF: planning groups, named states, pairs that may touch.

MoveIt's setup assistant writes such files. What they name is checked against the robot when it
is known; see `planning_group` for what a group makes of a chain.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element

from lockedjoint.formulations.io.files import real_in
from lockedjoint.formulations.io.objects import Brief
from lockedjoint.kinematics.chain import check_named, listed
from lockedjoint.kinematics.read_urdf import attribute, from_file, xml_root
from lockedjoint.kinematics.tree import RobotTree
from lockedjoint.nlp.errors import InputError, as_path

# A file with more groups, states or pairs together is refused: MoveIt's largest have thousands.
_MOST_ENTRIES = 100_000
# An error of a xacro file allows this.
_XACRO = "plain SRDF, which the command `xacro FILE.srdf.xacro > FILE.srdf` makes"
# Elements of these kinds are read; of others a note says that they are not.
_READ = (
    "group",
    "group_state",
    "end_effector",
    "disable_collisions",
    "disable_default_collisions",
    "enable_collisions",
    "passive_joint",
    "virtual_joint",
)


@dataclass(frozen=True)
class Group:
    """A planning group: what it lists itself."""

    name: str
    joints: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    chains: tuple[tuple[str, str], ...] = ()  #: The base's link and the tip's of each chain.
    groups: tuple[str, ...] = ()  #: Names of the groups that are part of it.


@dataclass(frozen=True)
class GroupState:
    """Positions of a group's joints that have a name, radians or metres."""

    name: str
    group: str
    positions: Mapping[str, float]


@dataclass(frozen=True)
class EndEffector:
    """A gripper or tool, the link that carries it, and the group to which that belongs."""

    name: str
    parent_link: str
    group: str
    parent_group: str | None = None


@dataclass(frozen=True, repr=False)
class Srdf(Brief):
    """An SRDF file as it was read; nothing in it is compared with a robot yet.

    Attributes
    ----------
    name
        The file's name, for notes.
    robot
        The name of the robot that the file is for.
    groups, states, end_effectors
        In the order of the file; groups by name.
    touching
        Pairs of links whose distance is not looked at.
    touching_all
        Links of which no distance is looked at, other than of pairs in `apart`.
    apart
        Pairs of links whose distance is looked at all the same.
    passive
        Joints that no motor moves.
    virtual
        Joints between the robot and its surroundings, which are not of the URDF file.
    notes
        What was left aside, one sentence each.
    """

    name: str
    robot: str
    groups: Mapping[str, Group]
    states: tuple[GroupState, ...]
    end_effectors: tuple[EndEffector, ...]
    touching: frozenset[tuple[str, str]]
    touching_all: frozenset[str]
    apart: frozenset[tuple[str, str]]
    passive: tuple[str, ...]
    virtual: tuple[str, ...]
    notes: tuple[str, ...]

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Srdf:
        """Read an SRDF file.

        Parameters
        ----------
        path
            The file, plain XML without entities and of at most 50 MB, as of a robot.

        Raises
        ------
        FileError
            If the file cannot be read or is none.
        """
        file = as_path("srdf", path)
        return from_file(file, lambda content: srdf_of(xml_root(content), file.name))

    def may_touch(self, first: str, second: str) -> bool:
        """Whether the distance of two links is not looked at."""
        pair = _pair(first, second)
        if pair in self.apart:
            return False
        return pair in self.touching or bool(self.touching_all & {first, second})

    def states_of(self, group: str | None = None) -> dict[str, dict[str, float]]:
        """Return the states by name.

        States of one name that do not contradict each other are one state of several groups.
        Where they do, the name means the one of the chosen group, and the others are called
        ``group/name``.
        """
        named: dict[str, list[GroupState]] = {}
        for state in self.states:
            named.setdefault(state.name, []).append(state)
        states: dict[str, dict[str, float]] = {}
        for name, alike in named.items():
            positions: dict[str, float] = {}
            agree = True
            for state in alike:
                for joint, at in state.positions.items():
                    agree &= positions.setdefault(joint, at) == at
            if agree:
                states[name] = positions
                continue
            for state in alike:
                chosen = state.group == group
                states[name if chosen else f"{state.group}/{name}"] = dict(state.positions)
        return states

    def unknown(self, tree: RobotTree) -> tuple[str, ...]:
        """Return sentences on what the file names and the robot does not have."""
        joints = {joint.name for joint in tree.joints}
        links = set(tree.links)
        pairs = [link for pair in (*self.touching, *self.apart) for link in pair]
        groups = self.groups.values()
        named_links = [link for group in groups for link in group.links]
        named_links += [link for group in groups for ends in group.chains for link in ends]
        named_links += [one.parent_link for one in self.end_effectors]
        named_joints = [joint for group in groups for joint in group.joints]
        named_joints += [joint for state in self.states for joint in state.positions]
        named_joints = [joint for joint in named_joints if joint not in self.virtual]
        notes = []
        if self.robot != tree.name:
            notes.append(f"{self.name} is for robot {self.robot}, and this one is {tree.name}.")
        for kind, named, known in (
            ("links", [*named_links, *pairs, *self.touching_all], links),
            ("joints", [*named_joints, *self.passive], joints),
        ):
            missing = sorted(set(named) - known)
            if missing:
                notes.append(
                    f"{self.name} names {kind} that the robot does not have: {listed(missing)}."
                )
        return tuple(notes)


def srdf_of(root: Element, name: str = "SRDF") -> Srdf:
    """Return what the root element of an SRDF says; InputError if it is wrong."""
    if any("xacro" in element.tag for element in root.iter()):
        raise InputError("content", "xacro", _XACRO)
    if root.tag != "robot":
        raise InputError("root element", f"<{root.tag}>", "<robot>, of an SRDF file")
    if root.find("joint/parent") is not None:
        raise InputError("content", "URDF", "SRDF, which stands beside the URDF file")
    if len(root) > _MOST_ENTRIES:
        raise InputError("content", f"of {len(root)} elements", f"at most {_MOST_ENTRIES}")
    groups: dict[str, Group] = {}
    for element in root.findall("group"):
        group = _group(element)
        if group.name in groups:
            raise InputError(f"group {group.name}", "there twice", "every group once")
        groups[group.name] = group
    _check_subgroups(groups)
    states: list[GroupState] = []
    notes = [
        f"Group {group.name} of {name} has groups that the file does not have: {listed(gone)}."
        for group in groups.values()
        if (gone := [part for part in group.groups if part not in groups])
    ]
    for element in root.findall("group_state"):
        state, left_aside = _state(element, groups)
        states.append(state)
        notes += left_aside
    others = sorted({child.tag for child in root if child.tag not in _READ})
    if others:
        notes.append(f"Elements of {name} that are not read: {listed(others)}.")
    whole = root.findall("disable_default_collisions")
    return Srdf(
        name=name,
        robot=root.get("name", "robot"),
        groups=groups,
        states=tuple(states),
        end_effectors=tuple(map(_end_effector, root.findall("end_effector"))),
        touching=_pairs(root.findall("disable_collisions")),
        touching_all=frozenset(attribute(one, "link", f"<{one.tag}>") for one in whole),
        apart=_pairs(root.findall("enable_collisions")),
        passive=_names(root, "passive_joint"),
        virtual=_names(root, "virtual_joint"),
        notes=tuple(notes),
    )


def _group(element: Element) -> Group:
    """Return a planning group; InputError if a name is missing."""
    name = attribute(element, "name", "a group")
    where = f" of group {name}"
    chains = tuple(
        (
            attribute(one, "base_link", f"<chain>{where}"),
            attribute(one, "tip_link", f"<chain>{where}"),
        )
        for one in element.findall("chain")
    )
    joints, links, groups = (_names(element, tag, where) for tag in ("joint", "link", "group"))
    return Group(name, joints, links, chains, groups)


def _names(element: Element, tag: str, where: str = "") -> tuple[str, ...]:
    """Return the names of the elements of one kind."""
    return tuple(attribute(one, "name", f"<{tag}>{where}") for one in element.findall(tag))


def _check_subgroups(groups: Mapping[str, Group]) -> None:
    """Refuse groups that are part of themselves.

    The search goes to depth first, without recursion: a group that is met while it is open, on
    the way from the first one, is part of itself.
    """
    whole: set[str] = set()  # groups of which all parts are looked at
    for first in groups:
        open_groups, left = [first], [list(groups[first].groups)]
        while open_groups:
            if not left[-1]:
                whole.add(open_groups.pop())
                left.pop()
                continue
            part = left[-1].pop()
            if part in open_groups:
                raise InputError(f"group {part}", "part of itself", "groups without circles")
            if part not in whole and part in groups:
                open_groups.append(part)
                left.append(list(groups[part].groups))


def members(groups: Mapping[str, Group], name: str) -> tuple[Group, ...]:
    """Return a group and all groups that are part of it; InputError if one is not there."""
    found: dict[str, Group] = {}
    waiting = [name]
    while waiting:
        part = waiting.pop()
        check_named(f"group in group {name}", part, list(groups))
        if part not in found:
            found[part] = groups[part]
            waiting += groups[part].groups
    return tuple(found.values())


def _state(element: Element, groups: Collection[str]) -> tuple[GroupState, list[str]]:
    """Return a state, and sentences on joints of it that are left aside."""
    name = attribute(element, "name", "a group_state")
    where = f"group_state {name}"
    group = element.get("group", "")
    positions: dict[str, float] = {}
    several: list[str] = []
    for one in element.findall("joint"):
        joint = attribute(one, "name", f"<joint> of {where}")
        text = attribute(one, "value", f"joint {joint} of {where}")
        if joint in positions:
            raise InputError(f"joint {joint} of {where}", "there twice", "every joint once")
        if len(text.split()) > 1:
            several.append(joint)
            continue
        try:
            positions[joint] = real_in(text)
        except ValueError:
            positions[joint] = float("nan")
        if not abs(positions[joint]) < float("inf"):
            allowed = "a finite number, radians or metres"
            raise InputError(f"joint {joint} of {where}", text, allowed)
    notes = []
    if group not in groups:
        what = f"is of group {group}, which is not there" if group else "is of no group"
        notes.append(f"State {name} {what}.")
    if several:
        notes.append(
            f"Joints of {where} with several numbers are left aside: {listed(several)}."
        )
    return GroupState(name, group, positions), notes


def _end_effector(element: Element) -> EndEffector:
    """Return an end effector; InputError if a name is missing, but for the parent group."""
    name = attribute(element, "name", "an end_effector")
    where = f"end_effector {name}"
    return EndEffector(
        name,
        attribute(element, "parent_link", where),
        attribute(element, "group", where),
        element.get("parent_group"),
    )


def _pairs(elements: Sequence[Element]) -> frozenset[tuple[str, str]]:
    """Return the pairs of links that elements name, each in alphabetical order."""
    return frozenset(
        _pair(
            attribute(one, "link1", f"<{one.tag}>"),
            attribute(one, "link2", f"<{one.tag}>"),
        )
        for one in elements
    )


def _pair(first: str, second: str) -> tuple[str, str]:
    """Return two names in alphabetical order."""
    return (first, second) if first <= second else (second, first)
