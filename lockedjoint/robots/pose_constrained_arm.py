"""A robot whose tool is held at a pose: what is left to choose is the self-motion.

The pose is an equality constraint of the nonlinear program, or with a tolerance an inequality:
distance and angle from it. Starts are drawn from configurations that inverse kinematics finds
at the pose from random ones. What a solver gives is measured again in NumPy: distance and angle
from the pose, limits, and the links' distances.

After a failure the pose may be out of reach, depending on where the joint locks. For every
joint the range in which it may lock is sampled, and inverse kinematics tries to reach the pose
with the other joints.

Letters: n joints, B configurations. A configuration has one position per joint, radians or
(prismatic joints) metres; many of them are columns, shape (n, B).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from lockedjoint.clearance.link_clearance import LinkClearance, PointPair
from lockedjoint.kinematics.forward import tip_kinematics
from lockedjoint.kinematics.geometry import BoolArray
from lockedjoint.kinematics.inverse import solve_ik
from lockedjoint.kinematics.pose import Pose, asks_for_millimetres
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.serial_chain import Ranges
from lockedjoint.kinematics.tree import RobotError
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.problem import FEASIBLE, Constraint

# Number of random starts in each round of inverse kinematics.
_STARTS_AT_ONCE = 1000
# Largest number of rounds: with more, a pose that is hard to reach is missed less often.
_MOST_ROUNDS = 5
# Number of configurations on a curve of self-motion after which no round follows.
_ENOUGH_ON_CURVE = 400
# The same on a self-motion of more dimensions, which needs more to be covered.
_ENOUGH_ON_SURFACE = 2500
# Number of iterations of inverse kinematics from each start.
_MOST_ITERATIONS = 60
# Number of random configurations if no pose is given.
_FREE_CONFIGURATIONS = 3000
# Number of cells that a joint's range after a failure is divided into: its resolution.
_CELLS_PER_RANGE = 40
# Number of starts of each cell that are the nearest known configurations.
_NEAREST_PER_CELL = 6
# Number of starts of each cell that are random configurations.
_RANDOM_PER_CELL = 4
# Seed of the random configurations: any number; a fixed one gives the same answer every time.
_SEED = 1995
# Least number of configurations to draw starts from: if fewer nearly keep links apart, the
# best of the others are among them.
_LEAST_STARTS = 20
# Distance by which links may be too near in a start, in metres; if they are nearer in every
# configuration, the posture is refused.
_MOST_MISSING_M = 0.03
# Distance and angle from the pose, or beyond its tolerances, up to which it is reached.
_REACHED_M_OR_RAD = 2e-5


@dataclass(frozen=True)
class LockedReach:
    """Where a joint may lock so that the pose can still be reached with the others."""

    joint: str  #: Its name.
    percent: float  #: How much of its range that is, in percent, by samples.
    ranges: Ranges  #: Pairs (lower, upper) of its positions, radians or metres.


@dataclass(frozen=True)
class PoseConstrainedArm(RobotArm):
    """A robot at a pose, or with links that keep a distance, or both.

    Parameters
    ----------
    chain, task, length
        As of `RobotArm`.
    pose
        Where the tip's point is; None if that is free.
    clearance
        Which distance links keep; None if they may touch.
    """

    pose: Pose | None = None
    clearance: LinkClearance | None = None
    __hash__ = RobotArm.__hash__

    @property
    def description(self) -> str:
        """Return the robot, its chain, and what is asked for, in words."""
        place = " at the pose" if self.pose else ""
        apart = (
            "" if self.clearance is None else f" with links {self.clearance.least:g} m apart"
        )
        return f"{super().description}{place}{apart}"

    def constraints(self, variables: ca.SX) -> tuple[Constraint, ...]:
        """State the pose, and the conditions of the links' distances, in symbols q, (n, 1)."""
        blocks: tuple[Constraint, ...] = ()
        if self.pose is not None:
            blocks = self.pose.constraints(*tip_kinematics(self.chain, variables)[1:])
        if self.clearance is not None and self.clearance.conditions:
            shares = self.clearance.shares(variables)  # at least 1 where links are apart
            blocks += (Constraint("clearance", shares, 1.0, np.inf),)
        return blocks

    def with_conditions(self, conditions: tuple[PointPair, ...]) -> PoseConstrainedArm:
        """Return this arm with other conditions of the links' distances.

        The configurations that starts are drawn from do not depend on the conditions, and take
        long to find: the new arm has those of this one.
        """
        assert self.clearance is not None
        stricter = replace(self, clearance=replace(self.clearance, conditions=conditions))
        stricter.__dict__["configurations"] = self.configurations
        return stricter

    def sample(self, rng: np.random.Generator) -> FloatArray:
        """Draw a configuration, (n,), at the pose whose links at least nearly keep apart."""
        drawn = self.configurations
        return drawn[:, int(rng.integers(drawn.shape[1]))].copy()

    def admits(self, jacobian: FloatArray, variables: FloatArray) -> bool:
        """Whether the pose is reached and links keep their distance, by numbers.

        J has shape (m, n), and the configuration shape (n,).
        """
        if not super().admits(jacobian, variables):
            return False
        q = variables[:, None]
        if self.pose is not None:
            errors = self.pose.errors(self.chain, q)
            if not self.pose.reached(errors, FEASIBLE)[0]:
                return False
        return self.clearance is None or bool(self.clearance.is_kept(q)[0])

    @cached_property
    def configurations(self) -> FloatArray:
        """Random configurations at the pose that nearly keep the distances, shape (n, B).

        InputError if the pose is out of reach; RobotError if links are far too near each other
        at every configuration at the pose.
        """
        if self.clearance is None:
            return self._at_pose
        slack = self.clearance.slack(
            self._at_pose
        )  # metres, (B,): below 0 if links are too near
        count = max(int(np.sum(slack >= -_MOST_MISSING_M)), _LEAST_STARTS)
        order = np.argsort(-slack)[:count]
        best = int(order[0])
        if slack[best] < -_MOST_MISSING_M:
            pair = self.clearance.closest(self._at_pose[:, best], self.clearance.pairs)
            apart = f"{' and '.join(pair.links)} are {pair.distance:.3g} m apart"
            allowed = f"less, as at the best of {len(slack)} configurations tried, {apart}"
            raise RobotError("clearance", f"{self.clearance.least:g} m", allowed)
        return np.asarray(self._at_pose[:, order])

    def locked_reach(self, configuration: FloatArray) -> tuple[LockedReach, ...]:
        """Return where each joint may lock so that the others can still reach the pose.

        The configuration, shape (n,), is one at the pose. The range of each joint is divided
        into cells. In each cell the joint is locked at the centre, and inverse kinematics
        starts from known and from random configurations.
        """
        n, rng = self.size, np.random.default_rng(_SEED)
        known = np.column_stack([configuration, self._at_pose])  # shape (n, B + 1)
        low, high = (side[:, 0] for side in self.chain.ranges)
        width = high - low
        # The centres of the cells, shape (n, cells).
        centres = (
            low[:, None]
            + width[:, None] * (np.arange(_CELLS_PER_RANGE) + 0.5) / _CELLS_PER_RANGE
        )
        nearest = min(_NEAREST_PER_CELL, known.shape[1])
        # The starts of each joint f that locks, shape (n, f, cells, starts).
        starts = np.empty((n, n, _CELLS_PER_RANGE, nearest + _RANDOM_PER_CELL))
        for f in range(n):
            near = np.argsort(np.abs(known[f] - centres[f][:, None]), axis=1)[:, :nearest]
            starts[:, f, :, :nearest] = known[:, near]
            spread = rng.uniform(size=(n, _CELLS_PER_RANGE, _RANDOM_PER_CELL))
            starts[:, f, :, nearest:] = low[:, None, None] + width[:, None, None] * spread
            starts[f, f] = centres[f][:, None]
        free = np.ones_like(starts, dtype=bool)
        free[range(n), range(n)] = False
        reached = self._reached(starts.reshape(n, -1), free.reshape(n, -1))[1]
        # A cell is reached if one of its starts leads to the pose, shape (n, cells).
        cells = np.any(reached.reshape(n, _CELLS_PER_RANGE, -1), axis=2)
        halves = width / _CELLS_PER_RANGE / 2
        return tuple(
            LockedReach(name, 100 * float(np.mean(own)), _runs(own, points, float(half)))
            for name, own, points, half in zip(
                self.chain.names, cells, centres, halves, strict=True
            )
        )

    @cached_property
    def _at_pose(self) -> FloatArray:
        """Random configurations at the pose, shape (n, B); InputError if it is out of reach."""
        rng = np.random.default_rng(_SEED)
        if self.pose is None:
            return self.samples(rng, _FREE_CONFIGURATIONS).T
        enough = (
            _ENOUGH_ON_CURVE if self.size - len(self.pose.rows) <= 1 else _ENOUGH_ON_SURFACE
        )
        q, reached = np.empty((self.size, 0)), np.empty(0, dtype=bool)
        for _ in range(_MOST_ROUNDS):
            drawn = rng.uniform(*self.chain.ranges, (self.size, _STARTS_AT_ONCE))
            moved, there = self._reached(drawn)
            q, reached = np.hstack([q, moved]), np.hstack([reached, there])
            if np.sum(reached) >= enough:
                break
        if np.any(reached):
            return np.asarray(q[:, reached])
        raise self._out_of_reach(q)

    def _out_of_reach(self, q: FloatArray) -> InputError:
        """Return the error that says how near configurations, (n, B), come to the pose."""
        assert self.pose is not None
        off, angle = self.pose.errors(self.chain, q)
        best = int(np.argmin(off + angle))
        position = ", ".join(f"{x:.6g}" for x in self.pose.position)
        missing = f"{off[best]:.3g} m"
        if self.pose.quaternion is not None:
            missing += f" and {np.degrees(angle[best]):.3g}°"
        allowed = f"one that the arm reaches within its joints' limits (nearest: {missing} off)"
        place = np.array(self.pose.position)
        allowed += asks_for_millimetres(place, "--at takes metres, a JSON file also x_mm")
        return InputError(f"pose at ({position})", "out of reach", allowed)

    def _reached(
        self, q: FloatArray, free: BoolArray | None = None
    ) -> tuple[FloatArray, BoolArray]:
        """Move configurations, (n, B), to the pose; say which reach its tolerances, (B,).

        Only joints that are `free`, (n, B), move; by default all of them.
        """
        assert self.pose is not None
        q, _ = solve_ik(self.chain, q, self.pose.target, free, _MOST_ITERATIONS)
        return q, self.pose.reached(self.pose.errors(self.chain, q), _REACHED_M_OR_RAD)


def _runs(reached: BoolArray, points: FloatArray, half: float) -> Ranges:
    """Return the ranges of neighbouring cells that are reached.

    `reached` and `points` say for each cell, shape (cells,), whether it is, and where its
    centre is; `half` is half the width of a cell. Both in radians or metres.
    """
    # Pairs (first cell of a run, first cell after it).
    ends = np.flatnonzero(np.diff(np.pad(reached, 1).astype(int))).reshape(-1, 2)
    return tuple(
        (float(points[first]) - half, float(points[last - 1]) + half) for first, last in ends
    )
