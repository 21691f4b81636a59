"""Configurations of the damaged arm at a goal or near it, by least squares from many starts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.recovery.answers import Help, NearestPose
from lockedjoint.recovery.failures import Damage
from lockedjoint.recovery.goal import GoalResidual, ToolGoal

# Configurations that are this near to each other are one.
_SAME_M_OR_RAD = 1e-3
# A joint without a speed counts as this fast where ways are compared: radians or metres.
_SPEED_PER_S = 1.0
# The nearest pose is looked for from so many starts.
_NEAREST_STARTS = 40
# A locked joint is tried at so many positions over its range.
_BRAKE_POSITIONS = 19
# Inverse kinematics has so many starts at each position of a locked joint.
_BRAKE_STARTS = 10


@dataclass(frozen=True, eq=False)
class GoalSearch:
    """Where a damaged arm can be when its tool is at a goal."""

    arm: Damage
    goal: ToolGoal
    start: FloatArray  #: Positions of the joints that can move, shape (n,).

    @cached_property
    def _residual(self) -> GoalResidual:
        return GoalResidual(self.goal, self.arm.chain, self.arm.hanging)

    def _starts(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Return where the arm is and random configurations within the limits, (n, count)."""
        least, largest = self.arm.chain.ranges
        drawn = rng.uniform(least, largest, (len(least), count))
        drawn[:, 0] = self.start
        return drawn

    def at_goal(self, starts: int, rng: np.random.Generator) -> FloatArray:
        """Return distinct configurations at the goal, shape (K, n), those soon reached first.

        From where the arm is, and from so many random configurations within the limits.
        """
        limits = self.arm.chain.lower, self.arm.chain.upper
        q, reached = self._residual.solved(self._starts(starts, rng), *limits)
        return self._sorted(q[:, reached].T)

    def _sorted(self, q: FloatArray) -> FloatArray:
        """Return configurations (K, n) by the time to go there, each once and turned near."""
        speed = np.array([joint.velocity for joint in self.arm.chain.joints])
        speed = np.where(np.isfinite(speed), speed, _SPEED_PER_S)
        near = self._turned_near(q)
        seconds = np.max(np.abs(near - self.start) / speed, axis=1)
        near = near[np.argsort(seconds, kind="stable")]
        kept = near[:0]
        for point in near:
            if not np.any(np.max(np.abs(kept - point), axis=1, initial=0.0) <= _SAME_M_OR_RAD):
                kept = np.vstack([kept, point])
        return np.asarray(kept)

    def _turned_near(self, q: FloatArray) -> FloatArray:
        """Turn joints of configurations (K, n) by whole turns to the start, within limits."""
        lower, upper = self.arm.chain.limits
        circle = 2 * np.pi
        # Positions at a limit are within it, also after rounding.
        fewest, most = np.ceil((lower - q) / circle - 1e-12), (upper - q) / circle + 1e-12
        turns = np.clip(np.round((self.start - q) / circle), fewest, np.floor(most))
        return np.asarray(np.clip(q + circle * self.arm.chain.turning * turns, lower, upper))

    def help(self, rng: np.random.Generator, share: float = 0.0) -> Help:
        """Return what can be done instead: the nearest pose, and better brakes."""
        arm, goal = self.arm, self.goal
        limits = arm.chain.lower, arm.chain.upper
        best = self._starts(_NEAREST_STARTS, rng)
        distance = np.full(_NEAREST_STARTS, np.inf)
        q = best
        for damping in (1e-2, 1e-4):
            q, _ = self._residual.solved(best, *limits, damping=damping, largest=np.inf)
            both = np.stack([best, q])
            sizes = [np.sum(self._residual(np.arange(0), x)[0] ** 2, axis=0) for x in both]
            best, distance = np.where(sizes[1] < sizes[0], q, best), np.minimum(*sizes)
        nearest = self._turned_near(best[:, [int(np.argmin(distance))]].T)
        position, rotation = arm.chain.tip_at(nearest.T)
        far = goal.distances(goal.missing(position, rotation))
        pose = NearestPose(
            dict(zip(arm.healthy.names, arm.whole(nearest)[0].tolist(), strict=True)),
            tuple(position[:, 0].tolist()),
            *(float(each[0]) for each in far),
        )
        # Better brakes are not known for an arm with a joint that hangs.
        locked = arm.locked if arm.hanging is None else ()
        return Help(pose, {name: self._brakes(name, rng) for name in locked}, share)

    def _brakes(self, name: str, rng: np.random.Generator) -> tuple[float, ...]:
        """Return where a locked joint could have locked so that the goal is within reach."""
        arm, healthy = self.arm, self.arm.healthy
        own = healthy.names.index(name)
        lower, upper = (
            np.repeat(side, _BRAKE_POSITIONS * _BRAKE_STARTS, axis=1) for side in healthy.ranges
        )
        places = np.linspace(lower[own, 0], upper[own, 0], _BRAKE_POSITIONS)
        lower[arm.free], upper[arm.free] = self.arm.chain.ranges
        for joint, at in arm.locked.items():
            k = healthy.names.index(joint)
            lower[k] = upper[k] = at
        lower[own] = upper[own] = np.repeat(places, _BRAKE_STARTS)
        residual = GoalResidual(self.goal, healthy)
        _, reached = residual.solved(rng.uniform(lower, upper), lower, upper, steps=30)
        return tuple(
            places[reached.reshape(_BRAKE_POSITIONS, _BRAKE_STARTS).any(axis=1)].tolist()
        )
