"""What can fail of an arm, and the arm that is left.

What comes in: a robot and its failures, of the four kinds below, each of a joint by its name.
What goes out: a `Damage`, whose chain has only the joints that can still move, with the ranges
and speeds that are left. Of the healthy arm n joints can move, of what is left m, and N is the
number of configurations. To add a kind of failure, write its dataclass, add it to `Failure` and
`_KINDS`, and say in `_reduced` what it does to the chain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias, get_args

import numpy as np

from lockedjoint.kinematics.chain import Chain, check_limits, check_named, narrowed
from lockedjoint.kinematics.hanging import HangingJoint
from lockedjoint.nlp.arrays import FloatArray, real_number
from lockedjoint.nlp.errors import InputError, entries_of, of_kind
from lockedjoint.robot import Robot

# The start may have a locked joint this far from where it has locked: texts round positions.
_LOCK_TOLERANCE_M_OR_RAD = 1e-6
# A joint with a smaller share of its speed counts as locked, and is refused.
_LEAST_SPEED_SHARE = 1e-6
# Errors say that a position or a limit must be this.
_FINITE = "finite numbers, radians or metres"
# Errors say that a failure must be one of these.
_KINDS = "Locked, ReducedRange, ReducedSpeed or FreeSwinging"


@dataclass(frozen=True)
class Locked:
    """A joint that cannot move any more.

    `lj.recover` refuses an unknown joint, and a position outside the limits.

    Parameters
    ----------
    joint
        Its name.
    at
        The position at which it has locked, in radians or metres; by default where it stands
        when it fails.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.Locked("elbow"), lj.Locked("elbow", at=1.2)
    (Locked(joint='elbow', at=None), Locked(joint='elbow', at=1.2))
    """

    joint: str
    at: float | None = None


@dataclass(frozen=True)
class ReducedRange:
    """A joint that can move in a part of its range only.

    `lj.recover` refuses an unknown joint, and limits that are no range.

    Parameters
    ----------
    joint
        Its name.
    lower, upper
        The limits that are left, in radians or metres.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.ReducedRange("elbow", 0.5, 1.5)
    ReducedRange(joint='elbow', lower=0.5, upper=1.5)
    """

    joint: str
    lower: float
    upper: float


@dataclass(frozen=True)
class ReducedSpeed:
    """A joint that reaches a share of its largest speed only.

    `lj.recover` refuses an unknown joint, and one whose largest speed the robot does not state.

    Parameters
    ----------
    joint
        Its name.
    share
        The share of the largest speed, above 0 and at most 1, without a unit.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.ReducedSpeed("elbow", share=0.2)
    ReducedSpeed(joint='elbow', share=0.2)
    """

    joint: str
    share: float


@dataclass(frozen=True)
class FreeSwinging:
    """A joint without torque and brake: it hangs where gravity holds it, within its limits.

    `lj.recover` refuses an unknown joint, and a robot without masses.

    Parameters
    ----------
    joint
        Its name.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> lj.FreeSwinging("elbow")
    FreeSwinging(joint='elbow')
    """

    joint: str


Failure: TypeAlias = Locked | ReducedRange | ReducedSpeed | FreeSwinging


@dataclass(frozen=True, eq=False)
class Damage:
    """What failures leave of a robot's arm."""

    robot: Robot  #: The robot before it fails.
    failures: tuple[Failure, ...]
    #: The chain is what remains: locked joints are part of links, ranges and speeds shrink.
    chain: Chain
    hanging: HangingJoint | None = None  #: The chain's joint that swings freely, if any.

    @classmethod
    def of(cls, robot: object, failures: object, start: FloatArray | None = None) -> Damage:
        """Return what failures leave of a robot, or of what makes one.

        Parameters
        ----------
        robot
            The robot; see `Robot`.
        failures
            One failure, or a list.
        start
            Where the joints are, shape (n,); there a joint has locked of which nobody says
            where.

        Raises
        ------
        InputError
            If a joint is unknown or fails twice in one way, a value is outside its limits,
            nothing is left that moves the tip, or it is not known how a joint swings.
        """
        robot = Robot.of(robot)
        healthy = robot.chain
        stated = list_of(failures)
        check_failures(healthy, stated)
        placed = tuple(_placed(failure, healthy, start) for failure in stated)
        if start is not None:
            placed = turned_to(start, healthy, placed)
        locked: dict[str, Any] = {
            failure.joint: failure.at for failure in placed if isinstance(failure, Locked)
        }
        chain = robot.with_locked(locked)
        for failure in placed:
            chain = _reduced(chain, failure)
        swinging = [failure.joint for failure in placed if isinstance(failure, FreeSwinging)]
        hanging = None
        if swinging:
            hanging = HangingJoint.of(robot.description, chain, swinging[0])
        return cls(robot, placed, chain, hanging)

    @property
    def healthy(self) -> Chain:
        """The chain before the failures."""
        return self.robot.chain

    @property
    def locked(self) -> dict[str, float]:
        """The positions at which joints of the healthy arm have locked, by their names."""
        return {name: at for name, at in self.chain.locked_at if name in self.healthy.names}

    @property
    def free(self) -> list[int]:
        """The numbers, among the joints of the healthy arm, of those that can move."""
        return [self.healthy.names.index(name) for name in self.chain.names]

    def whole(self, q: FloatArray) -> FloatArray:
        """Return configurations of the healthy arm, (N, n), from those of what is left, (N, m).

        Locked joints are where they have locked.
        """
        locked_positions = [self.locked.get(name, 0.0) for name in self.healthy.names]
        all_joints = np.tile(np.array(locked_positions), (len(q), 1))
        all_joints[:, self.free] = q
        return all_joints

    def start(self, configuration: FloatArray) -> FloatArray:
        """Return the part, (m,), of the healthy arm's configuration, (n,), that can move.

        Raises
        ------
        InputError
            If a joint is outside its range, or a locked joint is not where it has locked.
        """
        whole = self.healthy.within_limits(configuration)
        for name, at in self.locked.items():
            here = float(whole[self.healthy.names.index(name)])
            if abs(here - at) > _LOCK_TOLERANCE_M_OR_RAD:
                unit = self.healthy.joints[self.healthy.names.index(name)].unit
                allowed = f"{at:.7g} {unit}, where it has locked"
                raise InputError(f"joint {name} at the start", f"{here:.7g} {unit}", allowed)
        return self.chain.within_limits(whole[self.free])


def list_of(failures: object) -> list[Failure]:
    """Return failures as a list; a single one need not be in one."""
    if isinstance(failures, Failure):
        return [failures]
    return entries_of("failures", failures, f"one of {_KINDS}, or a list of them")


def _placed(failure: Failure, healthy: Chain, start: FloatArray | None) -> Failure:
    """Return the failure with the position at which its joint has locked, if it locks."""
    if not isinstance(failure, Locked) or failure.at is not None:
        return failure
    if start is None:
        allowed = "a position, or a configuration that says where it stands"
        raise InputError(f"joint {failure.joint}", "locked at an unknown position", allowed)
    return replace(failure, at=float(start[healthy.names.index(failure.joint)]))


def turned_to(
    configuration: FloatArray, healthy: Chain, failures: Sequence[Failure]
) -> tuple[Failure, ...]:
    """Return failures whose positions of endless joints are in the configuration's turn.

    A joint without limits stands at the same place after a whole turn. The position at which it
    has locked, or the middle of its reduced range, is moved by whole turns next to the
    configuration, shape (n,).
    """
    moved: list[Failure] = []
    for failure in failures:
        number = healthy.names.index(failure.joint)
        joint, here = healthy.joints[number], float(configuration[number])
        unlimited = np.isneginf(joint.lower) and np.isposinf(joint.upper)
        endless = healthy.turning[number] and unlimited
        if endless and isinstance(failure, Locked) and failure.at is not None:
            failure = replace(failure, at=failure.at + _turns(here - failure.at))
        elif endless and isinstance(failure, ReducedRange):
            middle = failure.lower / 2 + failure.upper / 2
            shift = _turns(here - middle)
            failure = replace(failure, lower=failure.lower + shift, upper=failure.upper + shift)
        moved.append(failure)
    return tuple(moved)


def _turns(angle: float) -> float:
    """Return the whole turns that are nearest to an angle, radians."""
    return float(2 * np.pi * np.round(angle / (2 * np.pi)))


def check_failures(healthy: Chain, failures: Sequence[Failure]) -> None:
    """Refuse unknown joints, failures that contradict each other, and two joints that swing.

    InputError also if a joint has locked outside its limits.
    """
    kinds_of: dict[str, set[type]] = {}
    for failure in failures:
        of_kind("failure", failure, get_args(Failure), _KINDS)
        of_kind("joint that fails", failure.joint, str, "the name of a joint")
        name, kind = failure.joint, type(failure)
        still = ", which cannot move" if name in dict(healthy.immobile) else ""
        check_named("joint that fails", name, healthy.names, still)
        kinds = kinds_of.setdefault(name, set())
        # A range and a speed may be reduced together; a locked joint has no other failure.
        alone = {Locked, FreeSwinging} & {*kinds, kind}
        if kind in kinds or (kinds and alone):
            raise InputError("failures", f"two of {name}", "one of each joint and kind")
        if kind is FreeSwinging and any(kind in others for others in kinds_of.values()):
            raise InputError("joints that swing freely", "more than one", "one at most")
        kinds.add(kind)
        if isinstance(failure, Locked) and failure.at is not None:
            joint = healthy.joints[healthy.names.index(name)]
            real_number(f"position at which {name} locks", failure.at, _FINITE)
            check_limits(name, failure.at, joint.lower, joint.upper, joint.prismatic)


def _reduced(chain: Chain, failure: Failure) -> Chain:
    """Return the chain after a range or a speed is reduced.

    The same chain after other failures, or if the joint is not part of it.
    """
    if isinstance(failure, Locked | FreeSwinging) or failure.joint not in chain.names:
        return chain
    if isinstance(failure, ReducedRange):
        where = f"range of {failure.joint}"
        for end in (failure.lower, failure.upper):
            real_number(where, end, _FINITE)
        return narrowed(chain, {failure.joint: (failure.lower, failure.upper)}, "range")
    allowed = "a share of the largest speed, above 0 and at most 1"
    share = real_number(
        f"speed of {failure.joint}", failure.share, allowed, _LEAST_SPEED_SHARE, 1.0
    )
    joints = {joint.name: joint for joint in chain.joints}
    joint = joints[failure.joint]
    if np.isinf(joint.velocity):
        allowed = "one in the robot's file, of which a share is left, or --velocity-limits"
        raise InputError(f"largest speed of {failure.joint}", "missing", allowed)
    joints[joint.name] = replace(joint, velocity=share * joint.velocity)
    return replace(chain, joints=tuple(joints.values()))
