"""The joints between two links of a robot, as one chain of motions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from formulations.robots.tree import MOVING, RobotError, RobotTree, Transform, TreeJoint
from nlp.arrays import FloatArray, finite_vector
from nlp.errors import InputError

# A configuration may be outside its limits by this, in radians or metres: rounded files.
LIMIT_TOLERANCE = 1e-6


@dataclass(frozen=True)
class ChainJoint:
    """A joint that moves the tip by itself: one variable, one column of J.

    Attributes
    ----------
    name
        Its name in the robot.
    prismatic
        Whether its position is a length, in metres, and not an angle, in radians.
    lower, upper
        Its limits, narrowed by those of joints on the chain that mimic it.
    """

    name: str
    prismatic: bool
    lower: float
    upper: float


@dataclass(frozen=True)
class Motion:
    """A displacement along the chain, by ``multiplier``·q[variable] + ``offset``.

    Attributes
    ----------
    placement
        Pose of the moving joint relative to where the motion before it leads, 4×4.
    axis
        Unit vector in the joint's frame.
    translates
        Whether it moves along the axis instead of turning about it.
    variable
        Position in `Chain.joints` of the joint that drives it.
    multiplier, offset
        Other than 1 and 0 if it mimics that joint.
    """

    placement: Transform
    axis: tuple[float, float, float]
    translates: bool
    variable: int
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Chain:
    """What moves a tip relative to a base.

    Attributes
    ----------
    robot, base, tip
        Names of the robot and of the two links.
    joints
        The joints that are free, in the order in which they first act on the tip.
    motions
        Their displacements from base to tip; joints that mimic others add motions.
    end
        Pose of the tip's point relative to where the last motion leads, 4×4.
    held
        Names and positions of joints that are held, as if locked.
    """

    robot: str
    base: str
    tip: str
    joints: tuple[ChainJoint, ...]
    motions: tuple[Motion, ...]
    end: Transform
    held: tuple[tuple[str, float], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free joints."""
        return tuple(joint.name for joint in self.joints)

    @property
    def prismatic(self) -> tuple[bool, ...]:
        """Which of the free joints are prismatic."""
        return tuple(joint.prismatic for joint in self.joints)

    @property
    def limits(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper limits of the free joints."""
        lower = np.array([joint.lower for joint in self.joints])
        return lower, np.array([joint.upper for joint in self.joints])

    @property
    def mid_range(self) -> FloatArray:
        """Every joint midway between its limits; at zero if it has none."""
        lower, upper = self.limits
        both = np.isfinite(lower) & np.isfinite(upper)
        middle = np.where(both, lower, 0.0) / 2 + np.where(both, upper, 0.0) / 2
        return np.asarray(np.clip(middle, lower, upper))

    def within_limits(self, configuration: Sequence[float] | FloatArray) -> FloatArray:
        """Return the configuration; InputError if it is outside the joints' limits."""
        point = finite_vector("configuration", configuration, len(self.joints))
        for joint, value in zip(self.joints, point, strict=True):
            _check_limits(joint.name, float(value), joint.lower, joint.upper)
        return point


def chain(
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

    fixed = np.eye(4)
    drivers: dict[str, list[tuple[TreeJoint, float, float]]] = {}
    plan: list[tuple[FloatArray, TreeJoint, str, float, float]] = []
    known: set[str] = set()
    for joint in path:
        fixed = fixed @ np.array(joint.origin)
        if joint.kind == "fixed":
            continue
        driver, multiplier, shift = _driver(tree, joint)
        known.add(driver.name)
        if driver.name in held or multiplier == 0.0:
            value = multiplier * held.get(driver.name, 0.0) + shift
            _check_limits(joint.name, value, joint.lower, joint.upper)
            fixed = fixed @ _displacement(joint, value)
            continue
        drivers.setdefault(driver.name, []).append((joint, multiplier, shift))
        plan.append((fixed, joint, driver.name, multiplier, shift))
        fixed = np.eye(4)
    _check_held(held, known)
    if not plan:
        allowed = "a link that free joints move"
        raise InputError("tip", f"{tip}, which nothing moves relative to the base", allowed)
    for name, value in held.items():
        driver = tree.joint(name)
        _check_limits(name, value, driver.lower, driver.upper)

    names = list(drivers)
    motions = tuple(
        Motion(_frozen(placement), j.axis, j.kind == "prismatic", names.index(name), k, c)
        for placement, j, name, k, c in plan
    )
    return Chain(
        robot=tree.name,
        base=tree.root if base is None else base,
        tip=tip,
        joints=tuple(_chain_joint(tree.joint(name), drivers[name]) for name in names),
        motions=motions,
        end=_frozen(fixed @ offset),
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


def _chain_joint(
    driver: TreeJoint, driven: Sequence[tuple[TreeJoint, float, float]]
) -> ChainJoint:
    lower, upper = driver.lower, driver.upper
    for joint, multiplier, offset in driven:
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


def _check_held(held: Mapping[str, float], known: set[str]) -> None:
    for name, value in held.items():
        if name not in known:
            allowed = "one of " + listed(sorted(known))
            raise InputError("held joint", name, allowed)
        if not np.isfinite(value):
            raise InputError(f"held joint {name}", value, "a finite number")


def _check_limits(name: str, value: float, lower: float, upper: float) -> None:
    if not lower - LIMIT_TOLERANCE <= value <= upper + LIMIT_TOLERANCE:
        raise InputError(f"joint {name}", f"{value:.7g}", f"within [{lower:.7g}, {upper:.7g}]")


def _frozen(matrix: FloatArray) -> Transform:
    return tuple(tuple(row) for row in matrix.tolist())


def listed(names: Sequence[str], limit: int = 12) -> str:
    """Return names with commas; the first of them if they are many."""
    shown = ", ".join(names[:limit])
    return shown if len(names) <= limit else f"{shown}, … ({len(names)} in all)"
