"""What a planning group of an SRDF file makes of a robot: the two ends of a chain.

A group that is a chain says both itself. Of one that lists joints or links, the base is the
link before the first joint that moves. The tip is the link after the last one, or a link that
is fixed to it and named: as a chain's tip, as what carries an end effector, or in the list.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from lockedjoint.kinematics.chain import check_named, listed
from lockedjoint.kinematics.srdf import Group, Srdf, members
from lockedjoint.kinematics.tree import MOVING, RobotTree, TreeJoint
from lockedjoint.nlp.errors import InputError


@dataclass(frozen=True)
class PlanningGroup:
    """A group of a robot: the ends of its chain, and the joints that move."""

    name: str
    base: str  #: The link that the motion is relative to, see above.
    tip: str  #: The link whose motion is looked at.
    joints: tuple[
        str, ...
    ]  #: Names, in the order of the file; mimic joints are not among them.


def planning_group(
    srdf: Srdf,
    name: str,
    tree: RobotTree,
    tip: str | None = None,
    fixed: Collection[str] = (),
) -> PlanningGroup:
    """Return a group's base and tip on a robot.

    Parameters
    ----------
    srdf
        The file with the group.
    name
        The group.
    tree
        The robot.
    tip
        Another tip than that of the group.
    fixed
        Joints that have locked: the group need not have them.

    Raises
    ------
    InputError
        If there is no such group, it names what the robot does not have, it is no single
        chain, or a joint on the way to the tip is not of it.
    """
    if not srdf.groups:
        raise InputError("group", name, f"none, as {srdf.name} has no groups")
    check_named("group", name, list(srdf.groups))
    parts = members(srdf.groups, name)
    joints = {joint.name: joint for joint in tree.joints}
    own = _moving(name, parts, tree, joints, srdf.virtual)
    if not own:
        raise InputError(f"group {name}", "without a joint that moves", "a group with some")
    chains = [ends for part in parts for ends in part.chains]
    alone = len(chains) == 1 and not any(part.joints or part.links for part in parts)
    last = _last(name, own, tree, srdf) if tip is None and not alone else None
    if tip is None:
        tip = chains[0][1] if last is None else _tip(srdf, name, parts, tree, last)
    check_named("tip", tip, tree.links)
    way = tree.path(tip)
    mine = [k for k, joint in enumerate(way) if joint.name in own]
    if not mine:
        allowed = f"a link that joints of group {name} move"
        raise InputError("tip", tip, allowed)
    base = chains[0][0] if alone else way[mine[0]].parent
    begin = next((k for k, joint in enumerate(way) if joint.parent == base), 0)
    others = [
        joint.name
        for joint in way[begin:]
        if joint.type in MOVING and joint.mimic is None and joint.name not in own
        if joint.name not in fixed
    ]
    if others:
        allowed = f"a group that has all joints on the way to {tip}, or these locked"
        raise InputError(f"group {name}", f"without {listed(others)}", allowed)
    return PlanningGroup(name, base, tip, tuple(own))


def _moving(
    name: str,
    parts: Collection[Group],
    tree: RobotTree,
    joints: Mapping[str, TreeJoint],
    virtual: Collection[str],
) -> dict[str, TreeJoint]:
    """Return the joints of a group that move by themselves, by name, in the order of the file.

    `parts` are the group and the groups in it, `joints` all joints of the tree by name.
    InputError if a part names what the robot does not have; virtual joints are left aside.
    """
    listed_names: list[str] = []
    for part in parts:
        listed_names += part.joints
        for link in part.links:
            check_named(f"link of group {name}", link, tree.links)
            listed_names += [joint.name for joint in tree.path(link)[-1:]]
        for base, tip in part.chains:
            for link in (base, tip):
                check_named(f"chain of group {name}", link, tree.links)
            way = tree.path(tip)
            above = len(tree.path(base))
            if base != tree.root and (len(way) < above or way[above - 1].child != base):
                allowed = f"a link on the way from {tree.root} to {tip}"
                raise InputError(f"base_link of group {name}", base, allowed)
            listed_names += [joint.name for joint in way[above:]]
    listed_names = [each for each in listed_names if each not in virtual]
    for each in listed_names:
        check_named(f"joint of group {name}", each, list(joints))
    return {
        each: joints[each]
        for each in listed_names
        if joints[each].type in MOVING and joints[each].mimic is None
    }


def _last(name: str, own: Mapping[str, TreeJoint], tree: RobotTree, srdf: Srdf) -> TreeJoint:
    """Return the joint of a group beyond all others; InputError if the group has branches."""
    for joint in own.values():
        way = {each.name for each in tree.path(joint.child)}
        if own.keys() <= way:
            return joint
    chains = [each for each in srdf.groups if _is_chain(each, tree, srdf)]
    allowed = f"a group that is one chain ({listed(chains) or 'there is none'})"
    raise InputError(f"group {name}", "with branches", f"{allowed}, or a tip on one branch")


def _is_chain(name: str, tree: RobotTree, srdf: Srdf) -> bool:
    """Whether all joints of a group are on one way."""
    joints = {joint.name: joint for joint in tree.joints}
    try:
        own = _moving(name, members(srdf.groups, name), tree, joints, srdf.virtual)
    except InputError:
        return False
    ways = ({each.name for each in tree.path(joint.child)} for joint in own.values())
    return any(own.keys() <= way for way in ways)


def _tip(
    srdf: Srdf, name: str, parts: Collection[Group], tree: RobotTree, last: TreeJoint
) -> str:
    """Return the tip of a group whose last joint that moves is known.

    It is the link after this joint, or one that is fixed to it: the tip of a chain, where one
    is stated, or the link that carries an end effector, or the last link or joint of the list.
    """
    joints = {joint.name: joint for joint in tree.joints}
    tips = [tip for part in parts for _, tip in part.chains]
    effectors = [
        effector.parent_link
        for effector in srdf.end_effectors
        if name in (effector.group, effector.parent_group)
    ]
    members_of = [link for part in parts for link in part.links]
    named = [each for part in parts for each in part.joints if each in joints]
    members_of += [joints[each].child for each in named]
    for links in (tips, effectors, members_of):
        fixed = [link for link in links if _is_fixed_to(link, last, tree)]
        if fixed:
            return max(fixed, key=lambda link: len(tree.path(link)))
    return last.child


def _is_fixed_to(link: str, joint: TreeJoint, tree: RobotTree) -> bool:
    """Whether a link is that after a joint, or is fixed to this one."""
    if link not in tree.links:
        return False
    way = tree.path(link)
    places = [k for k, each in enumerate(way) if each.name == joint.name]
    return bool(places) and all(each.type == "fixed" for each in way[places[0] + 1 :])
