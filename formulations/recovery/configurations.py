"""Configurations of the damaged arm at a goal: inverse kinematics from many starts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from formulations.kinematics.chain import Chain
from formulations.kinematics.forward import Kinematics
from formulations.kinematics.inverse import damped_least_squares
from formulations.recovery.goal import REACHED, GoalResidual, ToolGoal
from nlp.arrays import FloatArray

_DAMPING, _STEPS = 1e-10, 60
# Configurations that are this near to each other are one.
_SAME = 1e-3
# A joint that knows no speed is taken to be this fast, per second, where ways are compared.
_SPEED = 1.0


@dataclass(frozen=True, eq=False)
class GoalSearch:
    """Where a damaged arm can be when its tool is at a goal.

    Attributes
    ----------
    chain
        What can move.
    goal
        Where the tool is to be.
    start
        Where the arm is, shape (n,).
    """

    chain: Chain
    goal: ToolGoal
    start: FloatArray

    @property
    def kinematics(self) -> Kinematics:
        """Of the tip, in all six directions."""
        return Kinematics(self.chain)

    def at_goal(self, starts: int, rng: np.random.Generator) -> FloatArray:
        """Return distinct configurations at the goal, shape (K, n), those soon reached first.

        From where the arm is, and from so many random configurations within the limits.
        """
        kinematics = self.kinematics
        least, largest = kinematics.ranges
        drawn = rng.uniform(least, largest, (len(least), starts))
        drawn[:, 0] = self.start
        q, reached = damped_least_squares(
            GoalResidual(self.goal, kinematics),
            drawn,
            kinematics.lower,
            kinematics.upper,
            reached=REACHED,
            damping=_DAMPING,
            steps=_STEPS,
            largest=1.0,
        )
        return self.sorted(q[:, reached].T)

    def sorted(self, q: FloatArray) -> FloatArray:
        """Return configurations (K, n) by the time to go there, each once and turned near."""
        near = _nearest_turns(self.chain, q, self.start)
        near = near[np.argsort(self.seconds(near), kind="stable")]
        kept = near[:0]
        for point in near:
            if not np.any(np.max(np.abs(kept - point), axis=1, initial=0.0) <= _SAME):
                kept = np.vstack([kept, point])
        return np.asarray(kept)

    def seconds(self, q: FloatArray) -> FloatArray:
        """Return a lower bound of the time from the start to configurations (K, n)."""
        speed = np.array([joint.velocity for joint in self.chain.joints])
        speed = np.where(np.isfinite(speed), speed, _SPEED)
        return np.asarray(np.max(np.abs(q - self.start) / speed, axis=1))

    def nearest(self, starts: int, rng: np.random.Generator) -> FloatArray:
        """Return the configuration found nearest to the goal, shape (n,).

        Nearest in metres and radians together, beyond the tolerances.
        """
        kinematics = self.kinematics
        least, largest = kinematics.ranges
        drawn = rng.uniform(least, largest, (len(least), starts))
        drawn[:, 0] = self.start
        residual = GoalResidual(self.goal, kinematics)
        every = np.arange(starts)
        best, distance = drawn, np.sum(residual(every, drawn)[0] ** 2, axis=0)
        for damping in (1e-2, 1e-4):
            q, _ = damped_least_squares(
                *(residual, best, kinematics.lower, kinematics.upper),
                reached=REACHED,
                damping=damping,
                steps=_STEPS,
            )
            now = np.sum(residual(every, q)[0] ** 2, axis=0)
            best = np.where(now < distance, q, best)
            distance = np.minimum(now, distance)
        return np.asarray(self.sorted(best[:, [int(np.argmin(distance))]].T)[0])


def _nearest_turns(chain: Chain, q: FloatArray, start: FloatArray) -> FloatArray:
    """Turn joints of configurations (K, n) by whole turns to the start, within the limits."""
    lower, upper = chain.limits
    turning = np.ones(len(start), dtype=bool)
    for motion in chain.motions:
        if motion.prismatic or motion.multiplier % 1:
            turning[motion.variable] = False
    circle = 2 * np.pi
    turns = np.round((start - q) / circle)
    # Positions at a limit are within it, also after rounding.
    turns = np.clip(
        turns, np.ceil((lower - q) / circle - 1e-12), np.floor((upper - q) / circle + 1e-12)
    )
    return np.asarray(np.clip(q + circle * np.where(turning, turns, 0.0), lower, upper))
