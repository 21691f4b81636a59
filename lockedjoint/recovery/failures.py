"""What can fail of an arm, and the arm that is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from lockedjoint.kinematics.chain import Chain, check_limits, check_named, narrowed
from lockedjoint.kinematics.hanging import HangingJoint
from lockedjoint.nlp.arrays import FloatArray, real_number
from lockedjoint.nlp.errors import InputError, entries_of, of_kind
from lockedjoint.robot import Robot

# A locked joint may be stated this far from where it has locked.
_NARROWEST_M_OR_RAD = 1e-6
# An error of a position or a limit allows this.
_FINITE = "finite numbers, radians or metres"
# An error of a failure allows this.
_KINDS = "Locked, ReducedRange, ReducedSpeed or FreeSwinging"


@dataclass(frozen=True)
class Locked:
    """A joint that cannot move any more, and where, in radians or metres.

    By default where it stands when it fails.

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
    """A joint that can only move from `lower` to `upper`, radians or metres.

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
    """A joint that is only as fast as a share, above 0 and at most 1, of its largest speed.

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
    """A joint without torque and brake: it hangs as gravity has it, within its limits.

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
        given = list_of(failures)
        _check(healthy, given)
        placed = tuple(_placed(each, healthy, start) for each in given)
        if start is not None:
            placed = turned_to(start, healthy, placed)
        locked: dict[str, Any] = {
            each.joint: each.at for each in placed if isinstance(each, Locked)
        }
        chain = robot.with_locked(locked)
        for failure in placed:
            chain = _reduced(chain, failure)
        swinging = [each.joint for each in placed if isinstance(each, FreeSwinging)]
        hanging = None
        if swinging:
            hanging = HangingJoint.of(robot.description, chain, swinging[0])
        return cls(robot, placed, chain, hanging)

    @property
    def healthy(self) -> Chain:
        """The joints before."""
        return self.robot.chain

    @property
    def locked(self) -> dict[str, float]:
        """Where joints of the healthy arm have locked."""
        return {name: at for name, at in self.chain.locked_at if name in self.healthy.names}

    @property
    def free(self) -> list[int]:
        """Places of the joints that can move among those of the healthy arm."""
        return [self.healthy.names.index(name) for name in self.chain.names]

    def whole(self, q: FloatArray) -> FloatArray:
        """Return positions (N, n) of what can move with those of the locked joints added."""
        places = [self.locked.get(name, 0.0) for name in self.healthy.names]
        all_joints = np.tile(np.array(places), (len(q), 1))
        all_joints[:, self.free] = q
        return all_joints

    def start(self, configuration: FloatArray) -> FloatArray:
        """Return the part of the healthy arm's configuration that can move.

        Raises
        ------
        InputError
            If a joint is outside its range, or a locked joint is not where it has locked.
        """
        whole = self.healthy.within_limits(configuration)
        for name, at in self.locked.items():
            here = float(whole[self.healthy.names.index(name)])
            if abs(here - at) > _NARROWEST_M_OR_RAD:
                allowed = f"{at:.7g}, where it has locked"
                raise InputError(f"joint {name} at the start", f"{here:.7g}", allowed)
        return self.chain.within_limits(whole[self.free])


def list_of(failures: object) -> list[Failure]:
    """Return failures as a list; a single one need not be in one."""
    if isinstance(failures, Locked | ReducedRange | ReducedSpeed | FreeSwinging):
        return [failures]
    return entries_of("failures", failures, f"one of {_KINDS}, or a list of them")


def _placed(failure: Failure, healthy: Chain, start: FloatArray | None) -> Failure:
    """Return a failure that says where the joint has locked."""
    if not isinstance(failure, Locked) or failure.at is not None:
        return failure
    if start is None:
        allowed = "a position, or a configuration that says where it stands"
        raise InputError(f"joint {failure.joint}", "locked nobody says where", allowed)
    return replace(failure, at=float(start[healthy.names.index(failure.joint)]))


def turned_to(
    configuration: FloatArray, healthy: Chain, failures: Sequence[Failure]
) -> tuple[Failure, ...]:
    """Return the failures with positions of continuous joints whole turns away, where they are.

    A joint without limits is where it is but for whole turns: positions at which it has locked,
    and the middle of the range that it is left, are moved next to the configuration, (n,).
    """
    moved: list[Failure] = []
    for failure in failures:
        k = healthy.names.index(failure.joint)
        joint, here = healthy.joints[k], float(configuration[k])
        endless = healthy.turning[k] and np.isneginf(joint.lower) and np.isposinf(joint.upper)
        if endless and isinstance(failure, Locked) and failure.at is not None:
            failure = replace(failure, at=failure.at + _turns(here - failure.at))
        elif endless and isinstance(failure, ReducedRange):
            shift = _turns(here - failure.lower / 2 - failure.upper / 2)
            failure = replace(failure, lower=failure.lower + shift, upper=failure.upper + shift)
        moved.append(failure)
    return tuple(moved)


def _turns(angle: float) -> float:
    """Return the whole turns that are nearest to an angle, radians."""
    return float(2 * np.pi * np.round(angle / (2 * np.pi)))


def _check(healthy: Chain, failures: Sequence[Failure]) -> None:
    """Refuse unknown joints, and the same failure of a joint twice."""
    seen: dict[str, set[type]] = {}
    for failure in failures:
        of_kind("failure", failure, (Locked, ReducedRange, ReducedSpeed, FreeSwinging), _KINDS)
        of_kind("joint that fails", failure.joint, str, "the name of a joint")
        name, kind = failure.joint, type(failure)
        still = ", which cannot move" if name in dict(healthy.immobile) else ""
        check_named("joint that fails", name, healthy.names, still)
        before = seen.setdefault(name, set())
        if kind in before or (before and {Locked, FreeSwinging} & {*before, kind}):
            raise InputError("failures", f"two of {name}", "one of each joint and kind")
        if kind is FreeSwinging and any(kind in others for others in seen.values()):
            raise InputError("joints that swing freely", "more than one", "one at most")
        before.add(kind)
        if isinstance(failure, Locked) and failure.at is not None:
            joint = healthy.joints[healthy.names.index(name)]
            real_number(f"position at which {name} locks", failure.at, _FINITE)
            check_limits(name, failure.at, joint.lower, joint.upper)


def _reduced(chain: Chain, failure: Failure) -> Chain:
    """Return an arm of which a joint's range or speed is reduced, if the joint can move."""
    if isinstance(failure, Locked | FreeSwinging) or failure.joint not in chain.names:
        return chain
    if isinstance(failure, ReducedRange):
        where = f"range of {failure.joint}"
        ends = [real_number(where, end, _FINITE) for end in (failure.lower, failure.upper)]
        return narrowed(chain, {failure.joint: (ends[0], ends[1])}, "range")
    allowed = "a share of the largest speed, above 0 and at most 1"
    share = real_number(f"speed of {failure.joint}", failure.share, allowed, 1e-6, 1.0)
    joints = {joint.name: joint for joint in chain.joints}
    joint = joints[failure.joint]
    if np.isinf(joint.velocity):
        allowed = "one in the robot's file, of which a share is left, or --velocity-limits"
        raise InputError(f"largest speed of {failure.joint}", "missing", allowed)
    joints[joint.name] = replace(joint, velocity=share * joint.velocity)
    return replace(chain, joints=tuple(joints.values()))
