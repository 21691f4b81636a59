"""What can fail of an arm, and the arm that is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from formulations.kinematics.chain import Chain, ChainJoint, check_limits, listed, nearest
from formulations.kinematics.chain_between import chain_between
from formulations.kinematics.tree import RobotTree
from nlp.arrays import FloatArray, real_number
from nlp.errors import InputError, entries_of, of_kind

_NARROWEST = 1e-6
_FINITE = "finite numbers, radians or metres"
_KINDS = "Locked, ReducedRange or ReducedSpeed"


@dataclass(frozen=True)
class Locked:
    """A joint that cannot move any more, and where, in radians or metres."""

    joint: str
    at: float


@dataclass(frozen=True)
class ReducedRange:
    """A joint that can only move from `lower` to `upper`, radians or metres."""

    joint: str
    lower: float
    upper: float


@dataclass(frozen=True)
class ReducedSpeed:
    """A joint that is only as fast as a share, above 0 and at most 1, of its largest speed."""

    joint: str
    share: float


Failure: TypeAlias = Locked | ReducedRange | ReducedSpeed


@dataclass(frozen=True, eq=False)
class DamagedArm:
    """An arm before and after failures.

    Attributes
    ----------
    tree
        The whole robot.
    healthy, chain
        The arm before, and what can still move after the failures: locked joints are part of
        the links, ranges and speeds are reduced.
    point
        The tip's point, in its link's frame, metres.
    failures
        What has failed.
    """

    tree: RobotTree
    healthy: Chain
    chain: Chain
    point: tuple[float, float, float]
    failures: tuple[Failure, ...]

    @classmethod
    def of(
        cls,
        tree: RobotTree,
        failures: Sequence[Failure],
        tip: str | None = None,
        base: str | None = None,
        point: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> DamagedArm:
        """Return a robot's arm after failures.

        Raises
        ------
        InputError
            If a joint is unknown or fails twice in one way, a value is outside its limits, or
            nothing is left that moves the tip.
        """
        of_kind("tip", tip, (str, type(None)), "the name of a link")
        of_kind("base", base, (str, type(None)), "the name of a link")
        failures = tuple(entries_of("failures", failures, f"a list of {_KINDS}"))
        tip = tree.last_link() if tip is None else tip
        healthy = chain_between(tree, tip, base, None, point)
        _check(healthy, failures)
        locked = {each.joint: each.at for each in failures if isinstance(each, Locked)}
        chain = chain_between(tree, tip, base, locked, point)
        joints = {joint.name: joint for joint in chain.joints}
        for failure in failures:
            if failure.joint in joints:
                joints[failure.joint] = _reduced(joints[failure.joint], failure)
        chain = replace(chain, joints=tuple(joints.values()))
        x, y, z = (float(entry) for entry in point)
        return cls(tree, healthy, chain, (x, y, z), failures)

    @property
    def locked(self) -> dict[str, float]:
        """Where joints have locked."""
        return dict(self.chain.locked_at)

    @property
    def free(self) -> list[int]:
        """Places of the joints that can move among those of the healthy arm."""
        return [self.healthy.names.index(name) for name in self.chain.names]

    def whole(self, q: FloatArray) -> FloatArray:
        """Return positions (N, n) of what can move with those of the locked joints added."""
        all_joints = np.empty((len(q), len(self.healthy.names)))
        for k, name in enumerate(self.healthy.names):
            all_joints[:, k] = self.locked.get(name, 0.0)
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
            if abs(here - at) > _NARROWEST:
                allowed = f"{at:.7g}, where it has locked"
                raise InputError(f"joint {name} at the start", f"{here:.7g}", allowed)
        return self.chain.within_limits(whole[self.free])


def _check(healthy: Chain, failures: Sequence[Failure]) -> None:
    """Refuse unknown joints, and the same failure of a joint twice."""
    seen: set[tuple[str, type]] = set()
    for failure in failures:
        of_kind("failure", failure, (Locked, ReducedRange, ReducedSpeed), _KINDS)
        of_kind("joint that fails", failure.joint, str, "the name of a joint")
        name, kind = failure.joint, type(failure)
        if name not in healthy.names:
            still = ", which cannot move" if name in dict(healthy.immobile) else ""
            allowed = f"one of {listed(healthy.names)}{nearest(name, healthy.names)}"
            raise InputError("joint that fails", f"{name}{still}", allowed)
        if (name, kind) in seen or (kind is not Locked and (name, Locked) in seen):
            raise InputError("failures", f"two of {name}", "one of each joint and kind")
        seen.add((name, kind))
        if isinstance(failure, Locked):
            joint = healthy.joints[healthy.names.index(name)]
            real_number(f"position at which {name} locks", failure.at, _FINITE)
            check_limits(name, failure.at, joint.lower, joint.upper)


def _reduced(joint: ChainJoint, failure: Failure) -> ChainJoint:
    """Return a joint whose range or speed is reduced."""
    if isinstance(failure, ReducedSpeed):
        allowed = "a share of the largest speed, above 0 and at most 1"
        share = real_number(f"speed of {joint.name}", failure.share, allowed, 1e-6, 1.0)
        if np.isinf(joint.velocity):
            allowed = "one in the robot's file, of which a share is left, or --velocity-limits"
            raise InputError(f"largest speed of {joint.name}", "missing", allowed)
        return replace(joint, velocity=share * joint.velocity)
    if isinstance(failure, Locked):
        return joint
    where = f"range of {joint.name}"
    lower = max(joint.lower, real_number(where, failure.lower, _FINITE))
    upper = min(joint.upper, real_number(where, failure.upper, _FINITE))
    if not upper - lower > _NARROWEST:
        allowed = (
            f"lower < upper, with room in the robot's [{joint.lower:g}, {joint.upper:g}]; "
            "a joint that cannot move has locked"
        )
        raise InputError(where, f"[{failure.lower:g}, {failure.upper:g}]", allowed)
    return replace(joint, lower=lower, upper=upper)
