"""The chain from one link of a robot to another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from formulations.robots.chain import Chain, ChainJoint, Motion, check_limits, listed
from formulations.robots.tree import MOVING, RobotError, RobotTree, Transform, TreeJoint
from nlp.arrays import FloatArray, finite_vector
from nlp.errors import InputError

# A moving joint, the joint that drives it (itself, mostly), multiplier and offset.
_Driven = tuple[TreeJoint, TreeJoint, float, float]


def chain_between(
    tree: RobotTree,
    tip: str,
    base: str | None = None,
    held: Mapping[str, float] | None = None,
    point: Sequence[float] = (0.0, 0.0, 0.0),
) -> Chain:
    """Return the chain from one link to another.

    Parameters
    ----------
    tree
        The robot.
    tip
        Link that the Jacobian is of.
    base
        Link that it is relative to: one on the way from the root to the tip; by default
        the root.
    held
        Joints that have locked, by name, and where, in radians or metres.
    point
        The point of the tip's link that counts, in its frame, in metres.

    Raises
    ------
    InputError
        If a name is unknown, a value is outside its joint's limits, or nothing is free.
    RobotError
        If a joint on the way is of an unsupported kind.
    """
    held = held or {}
    path = _path(tree, tip, base)
    offset = np.eye(4)
    offset[:3, 3] = finite_vector("point", np.asarray(point), 3)

    driven = [(joint, *_driver(tree, joint)) for joint in path if joint.kind in MOVING]
    _check_held(held, [driver for _, driver, _, _ in driven])
    free = [one for one in driven if one[1].name not in held and one[2] != 0.0]
    if not free:
        allowed = "a link that free joints move"
        raise InputError("tip", f"{tip}, which nothing moves relative to the base", allowed)
    drivers = {driver.name: driver for _, driver, _, _ in free}
    names = list(drivers)

    motions, pose = [], np.eye(4)
    followers = {joint.name: (driver, k, c) for joint, driver, k, c in driven}
    for joint in path:
        pose = pose @ np.array(joint.origin)
        if joint.kind == "fixed":
            continue
        driver, k, c = followers[joint.name]
        if driver.name not in drivers or k == 0.0:
            value = k * held.get(driver.name, 0.0) + c
            check_limits(joint.name, value, joint.lower, joint.upper)
            pose = pose @ _displacement(joint, value)
            continue
        slides, variable = joint.kind == "prismatic", names.index(driver.name)
        motions.append(Motion(_frozen(pose), joint.axis, slides, variable, k, c))
        pose = np.eye(4)
    return Chain(
        robot=tree.name,
        base=tree.root if base is None else base,
        tip=tip,
        joints=tuple(_chain_joint(driver, free) for driver in drivers.values()),
        motions=tuple(motions),
        end=_frozen(pose @ offset),
        held=tuple(sorted(held.items())),
    )


def _path(tree: RobotTree, tip: str, base: str | None) -> tuple[TreeJoint, ...]:
    for name, link in (("tip", tip), ("base", base)):
        if link is not None and link not in tree.links:
            raise InputError(name, link, "one of the links " + listed(tree.links))
    path = tree.path(tip)
    on_the_way = [tree.root, *(joint.child for joint in path)]
    if base is not None:
        if base not in on_the_way[:-1]:
            allowed = f"a link before {tip}: one of " + listed(on_the_way[:-1])
            raise InputError("base", base, allowed)
        path = path[on_the_way.index(base) :]
    for joint in path:
        if joint.kind not in (*MOVING, "fixed"):
            allowed = f"only {', '.join(MOVING)} and fixed joints between base and tip"
            raise RobotError(f"joint {joint.name}", joint.kind, allowed)
    return path


def _driver(tree: RobotTree, joint: TreeJoint) -> tuple[TreeJoint, float, float]:
    """Return the joint that drives a joint, and by which multiplier and offset."""
    multiplier, offset, seen = 1.0, 0.0, {joint.name}
    while joint.mimic is not None:
        follower, mimic = joint.name, joint.mimic
        try:
            joint = tree.joint(mimic.joint)
        except KeyError:
            allowed = "the name of another joint"
            raise RobotError(f"<mimic> of joint {follower}", mimic.joint, allowed) from None
        if joint.name in seen:
            allowed = "mimicry that ends at a joint with a drive of its own"
            raise RobotError(f"<mimic> of joint {follower}", "circular", allowed)
        if joint.kind not in MOVING:
            allowed = "one of " + ", ".join(MOVING)
            raise RobotError(
                f"joint {joint.name}, mimicked by {follower},", joint.kind, allowed
            )
        seen.add(joint.name)
        offset += multiplier * mimic.offset
        multiplier *= mimic.multiplier
    return joint, multiplier, offset


def _chain_joint(driver: TreeJoint, driven: Sequence[_Driven]) -> ChainJoint:
    """Return a driving joint, its limits narrowed by those of the joints that follow it."""
    lower, upper = driver.lower, driver.upper
    for joint, by, multiplier, offset in driven:
        if by == driver:
            ends = sorted((end - offset) / multiplier for end in (joint.lower, joint.upper))
            lower, upper = max(lower, ends[0]), min(upper, ends[1])
    if lower > upper:
        allowed = "limits that leave room together with those of the joints that mimic it"
        raise RobotError(f"limits of joint {driver.name}", "contradictory", allowed)
    return ChainJoint(driver.name, driver.kind == "prismatic", lower, upper)


def _displacement(joint: TreeJoint, value: float) -> FloatArray:
    """Pose after a numeric displacement along or about the joint's axis, 4×4."""
    axis, pose = np.array(joint.axis), np.eye(4)
    if joint.kind == "prismatic":
        pose[:3, 3] = value * axis
        return pose
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    pose[:3, :3] += np.sin(value) * cross + (1 - np.cos(value)) * cross @ cross
    return pose


def _check_held(held: Mapping[str, float], drivers: Sequence[TreeJoint]) -> None:
    known = {driver.name: driver for driver in drivers}
    for name, value in held.items():
        if name not in known:
            raise InputError("held joint", name, "one of " + listed(list(known)))
        check_limits(name, value, known[name].lower, known[name].upper)


def _frozen(matrix: FloatArray) -> Transform:
    return tuple(tuple(row) for row in matrix.tolist())
