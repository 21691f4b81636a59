"""What moves of a robot: the chain from one link to another, or all links at once.

What comes in is a `RobotTree`, links and joints as a file has them. `chain_between` makes the
`Chain` of some of them in five steps: the joints on the way (`_path`); for each the joint that
drives it, which another one may (`_driven_joints`); limits that all of them allow (`_ranges`);
which joints are free, locked or immobile; and where the links are (`_bodies`). Angles are
radians, lengths metres, poses homogeneous 4×4 matrices.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import takewhile
from typing import NamedTuple, TypeAlias

import numpy as np

from lockedjoint.formulations.joints.joint import MOST_JOINTS
from lockedjoint.kinematics.chain import (
    LARGEST,
    LIMIT_TOLERANCE,
    Chain,
    ChainJoint,
    check_limits,
    check_named,
    check_size,
    listed,
    nearest,
)
from lockedjoint.kinematics.geometry import homogeneous, screw
from lockedjoint.kinematics.motion import Bodies, Motion, frozen
from lockedjoint.kinematics.tree import MOVING, RobotError, RobotTree, TreeJoint, unused
from lockedjoint.nlp.arrays import FloatArray, finite_vector
from lockedjoint.nlp.errors import InputError

# More joints that mimic one another in a row are refused: the time grows with the square of
# their number. Robots that exist have one or two.
_MOST_MIMICS = 100
#: Of each link, by name: the number of the body that it is part of, and its pose in that body's
#: frame, 4×4.
Places: TypeAlias = dict[str, tuple[int, FloatArray]]


class _Driven(NamedTuple):
    """A moving joint, which is at multiplier · position of its driver + offset."""

    joint: TreeJoint
    driver: TreeJoint  #: The joint that drives it: mostly itself.
    multiplier: float
    offset: float  #: Radians or metres.


def chain_between(
    tree: RobotTree,
    tip: str,
    base: str | None = None,
    locked_at: Mapping[str, float] | None = None,
    point: Sequence[float] = (0.0, 0.0, 0.0),
    argument: str = "joint of locked_at",
) -> Chain:
    """Return the chain from one link to another.

    Parameters
    ----------
    tree
        The robot.
    tip
        Link that the Jacobian is of.
    base
        Link that it is relative to, by default the root. If it is not on the way from the
        root to the tip, such as the other hand of a robot with two arms, the chain leads up
        from it to where the ways to both part, and from there to the tip.
    locked_at
        Joints that have locked, by name, and where, in radians or metres.
    point
        The point of the tip's link whose velocity is taken, in its frame, in metres.
    argument
        How errors name a joint that has locked.

    Raises
    ------
    InputError
        If a name is unknown, a value is outside its joint's limits, nothing is free, or there
        are more than `MOST_JOINTS` joints on the way.
    RobotError
        If a joint on the way is of an unsupported kind.
    """
    locked_at = locked_at or {}
    path = _path(tree, tip, base)
    shift = finite_vector("point", point, 3)
    check_size("point", *shift)

    driven = _driven_joints(tree, path)
    known = {driver.name: driver for _, driver, _, _ in driven.values()}
    for name, value in locked_at.items():
        check_named(argument, name, list(known))
        limit, slides = known[name].limit, known[name].type == "prismatic"
        check_limits(name, value, limit.lower, limit.upper, slides)
    moving = [
        one
        for one in driven.values()
        if one.driver.name not in locked_at and one.multiplier != 0.0
    ]
    if len(moving) > MOST_JOINTS:
        count = f"number of joints that move {tip}"
        raise InputError(count, len(moving), f"at most {MOST_JOINTS}")
    ranged = _ranges(moving)
    immobile = {
        joint.name: joint.lower / 2 + joint.upper / 2
        for joint in ranged
        if joint.upper - joint.lower <= LIMIT_TOLERANCE
    }
    fixed = {**immobile, **locked_at}
    drivers = tuple(joint for joint in ranged if joint.name not in immobile)
    if not drivers:
        shown = f" ({listed(list(fixed))} cannot move)" if fixed else ""
        allowed = f"a link that free joints move{shown}"
        raise InputError("tip", f"{tip}, which nothing moves relative to the base", allowed)
    variables = {driver.name: k for k, driver in enumerate(drivers)}

    for joint, driver, multiplier, offset in driven.values():
        if driver.name in fixed or multiplier == 0.0:
            value = multiplier * fixed.get(driver.name, 0.0) + offset
            ends = joint.limit.lower, joint.limit.upper
            check_limits(joint.name, value, *ends, joint.type == "prismatic")
    base = tree.root if base is None else base
    bodies, places = _bodies(path, base, driven, variables, fixed)
    return Chain(
        robot=tree.name,
        base=base,
        tip=tip,
        joints=drivers,
        motions=tuple(motion for _, motion in bodies),
        end=frozen(places[tip][1] @ homogeneous(np.eye(3), shift)),
        locked_at=tuple(sorted(locked_at.items())),
        immobile=tuple(immobile.items()),
        remarks=tree.remarks,
    )


def bodies_of(tree: RobotTree, chain: Chain) -> tuple[Bodies, Places]:
    """Return what moves as one when the chain's joints move, in the whole tree.

    Joints that do not move the tip stay: at zero, or at the limit nearest to it. Body 0 holds
    the root; of each link, the number of its body, and its pose in the body's frame, 4×4.
    """
    joints = tree.parents_first
    driven = _driven_joints(tree, joints)
    variables = {name: k for k, name in enumerate(chain.names)}
    fixed = dict((*chain.immobile, *chain.locked_at))
    return _bodies(joints, tree.root, driven, variables, fixed)


def _bodies(
    joints: Sequence[TreeJoint],
    root: str,
    driven: Mapping[str, _Driven],
    variables: Mapping[str, int],
    fixed: Mapping[str, float],
) -> tuple[Bodies, Places]:
    """Return the bodies that joints, parents first, make, and where links are in them.

    Parameters
    ----------
    joints, root
        Joints, each after that of its parent, and the link before the first one: body 0.
    driven
        What drives each moving joint, by the joint's name.
    variables
        Places of the chain's free joints, by name: whatever one of them drives makes a body.
    fixed
        Positions of joints that stand, by name: locked or immobile. Others that are not free
        stand at 0, or at the limit nearest to it.
    """
    moving: list[tuple[int, Motion]] = []
    places: Places = {root: (0, np.eye(4))}
    for joint in joints:
        body, pose = places[joint.parent]
        pose = pose @ np.asarray(joint.origin)
        if joint.type in MOVING:
            _, driver, multiplier, offset = driven[joint.name]
            slides = joint.type == "prismatic"
            if driver.name in variables and multiplier != 0:
                x, y, z = joint.axis.tolist()
                variable = variables[driver.name]
                motion = Motion(frozen(pose), (x, y, z), slides, variable, multiplier, offset)
                moving.append((body, motion))
                body, pose = len(moving), np.eye(4)
            else:
                still = float(np.clip(0.0, driver.limit.lower, driver.limit.upper))
                value = multiplier * fixed.get(driver.name, still) + offset
                turn, travel = (0.0, value) if slides else (value, 0.0)
                pose = pose @ screw(joint.axis, turn, travel)
        places[joint.child] = (body, pose)
    return tuple(moving), places


def _path(tree: RobotTree, tip: str, base: str | None) -> tuple[TreeJoint, ...]:
    """Return the joints from base to tip, in order; joints on the way up are turned round."""
    for name, link in (("tip", tip), ("base", base)):
        if link is not None and link not in tree.links:
            allowed = f"one of the links {listed(tree.links)}{nearest(link, tree.links)}"
            raise InputError(name, link, allowed)
    path, up = tree.path(tip), tree.path(base or tree.root)
    shared = len(list(takewhile(lambda pair: pair[0] is pair[1], zip(path, up, strict=False))))
    back = (part for joint in reversed(up[shared:]) for part in _back(joint, tree.links))
    path = (*back, *path[shared:])
    for joint in path:
        if joint.type not in (*MOVING, "fixed"):
            allowed = f"only {', '.join(MOVING)} and fixed joints between base and tip"
            raise RobotError(f"joint {joint.name}", joint.type, allowed)
    return path


def _back(joint: TreeJoint, links: Sequence[str]) -> tuple[TreeJoint, TreeJoint]:
    """Return a joint from its child to its parent: the motion, then what is fixed.

    A joint's pose is origin · motion(q). The inverse is motion(-q) · origin⁻¹, and motion(-q)
    about an axis is motion(q) about the opposite axis.
    """
    between = unused(f"{joint.child} before {joint.name}", links)
    axis = -joint.axis if joint.type in MOVING else joint.axis
    moving = replace(joint, parent=joint.child, child=between, origin=np.eye(4), axis=axis)
    back = np.asarray(np.linalg.inv(joint.origin), dtype=float)
    return moving, TreeJoint(between, joint.parent, f"back of {joint.name}", "fixed", back)


def _driven_joints(tree: RobotTree, moving: Sequence[TreeJoint]) -> dict[str, _Driven]:
    """Return what drives those of some joints that move, by their names, in the same order."""
    joints = {joint.name: joint for joint in tree.joints}
    return {one.name: _driven_joint(joints, one) for one in moving if one.type in MOVING}


def _driven_joint(joints: Mapping[str, TreeJoint], joint: TreeJoint) -> _Driven:
    """Return a joint, the joint that drives it in the end, and by which multiplier and offset.

    A row of mimics q = m₁p + c₁, p = m₂r + c₂ makes q = m₁m₂r + (m₁c₂ + c₁).
    """
    driver, multiplier, offset, seen = joint, 1.0, 0.0, {joint.name}
    while driver.mimic is not None:
        follower, mimic = driver.name, driver.mimic
        if mimic.joint not in joints:
            allowed = f"the name of another joint{nearest(mimic.joint, list(joints))}"
            raise RobotError(f"<mimic> of joint {follower}", mimic.joint, allowed)
        driver = joints[mimic.joint]
        if driver.name in seen:
            allowed = "mimicry that ends at a joint with a drive of its own"
            raise RobotError(f"<mimic> of joint {follower}", "circular", allowed)
        if driver.type not in MOVING:
            where = f"joint {driver.name}, mimicked by {follower},"
            raise RobotError(where, driver.type, "one of " + ", ".join(MOVING))
        seen.add(driver.name)
        if len(seen) > _MOST_MIMICS:
            allowed = f"at most {_MOST_MIMICS} joints that mimic one another in a row"
            raise RobotError(f"<mimic> of joint {joint.name}", "too long a row", allowed)
        offset += multiplier * mimic.offset
        multiplier *= mimic.multiplier
        size = abs(multiplier)
        if (size and size < 1 / LARGEST) or max(size, abs(offset)) > LARGEST:
            shown = f"multiplier {multiplier:g} and offset {offset:g}"
            allowed = (
                f"of size at most {LARGEST:g}; the multiplier 0 or at least {1 / LARGEST:g}"
            )
            raise RobotError(f"<mimic> of joint {joint.name}", shown, allowed)
    return _Driven(joint, driver, multiplier, offset)


def _ranges(moving: Sequence[_Driven]) -> list[ChainJoint]:
    """Return each driving joint, its limits narrowed by those of the joints that follow it.

    Multipliers are not 0. From lower ≤ multiplier · p + offset ≤ upper follow limits of the
    driver's position p; from |multiplier| · |ṗ| ≤ velocity follows that of its speed.
    """
    ranges: dict[str, ChainJoint] = {}
    for joint, driver, multiplier, offset in moving:
        name, own, limit = driver.name, driver.limit, joint.limit
        slides, limits = driver.type == "prismatic", (own.lower, own.upper, own.velocity)
        before = ranges.get(name, ChainJoint(name, slides, *limits, driver.speed))
        low, high = sorted((end - offset) / multiplier for end in (limit.lower, limit.upper))
        ranges[name] = replace(
            before,
            lower=max(before.lower, low),
            upper=min(before.upper, high),
            velocity=min(before.velocity, limit.velocity / abs(multiplier)),
        )
    for name, found in ranges.items():
        if found.lower > found.upper + LIMIT_TOLERANCE:
            allowed = "limits that leave room together with those of the joints that mimic it"
            raise RobotError(f"limits of joint {name}", "contradictory", allowed)
    return list(ranges.values())
