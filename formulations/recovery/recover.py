"""After a failure: reach the goal with what is left, or say why not.

Configurations at the goal are found by inverse kinematics from many starts, ways to them by
straight lines of the joints and, where links have to stay apart, by OMPL's RRT-Connect; times by
TOPP-RA. What comes out is checked by `checking`, which shares nothing with that. Where no
configuration is found, a proof is tried that there is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from formulations.clearance.link_clearance import LinkClearance
from formulations.kinematics.read_robot import read_robot
from formulations.paths.timing import MotionLimits, TimedTrajectory, timed
from formulations.paths.waypoints import ToolPath
from formulations.recovery.answers import Impossible, NotFound, Recovered, Recovery
from formulations.recovery.checking import faults
from formulations.recovery.configurations import GoalSearch
from formulations.recovery.connecting import Connector
from formulations.recovery.failures import DamagedArm, Failure
from formulations.recovery.goal import Goal
from formulations.recovery.helping import help_at
from formulations.recovery.unreachable import ReachProof, prove_unreachable, tool_points
from formulations.robots.pose_constrained_arm import Pose
from nlp.arrays import FloatArray, finite_vector, real_number, whole_number
from nlp.errors import InputError, of_kind

# Starts of the first round, and boxes of the first proof: what is easy is known soon.
_FIRST_STARTS, _FIRST_BOXES = 60, 20_000
# Seconds in which a joint is at its largest speed, if no accelerations are given.
_TO_SPEED = 0.5
# A joint without a speed in its file takes this, rad/s or m/s.
_SPEED = 1.0
# Ends that RRT-Connect may choose from.
_ENDS = 30


@dataclass(frozen=True)
class RecoverySearch:
    """How much is tried.

    Parameters
    ----------
    starts
        Of the inverse kinematics, if fewer do not reach the goal.
    boxes
        Of a proof that the goal is out of reach, at most.
    seconds
        Of RRT-Connect.
    seed
        Of everything random.

    Raises
    ------
    InputError
        If a number is out of range.
    """

    starts: int = 1000
    boxes: int = 500_000
    seconds: float = 5.0
    seed: int = 0

    def __post_init__(self) -> None:
        whole_number("starts", self.starts, 1, 100_000)
        whole_number("boxes", self.boxes, 1, 10_000_000)
        real_number("seconds", self.seconds, "a number above 0, at most 3600", 1e-3, 3600.0)
        whole_number("seed", self.seed, 0)


@dataclass(frozen=True, eq=False)
class DamagedState:
    """A damaged arm where it is, how it may move, and how much is to be tried.

    Attributes
    ----------
    arm
        What can move.
    whole, start
        Where the arm is: all joints, and those that can move.
    limits
        Speeds and accelerations of what can move.
    connector
        Finds ways, and knows which links stay apart.
    search
        How much is tried.
    """

    arm: DamagedArm
    whole: FloatArray
    start: FloatArray
    limits: MotionLimits
    connector: Connector
    search: RecoverySearch

    @classmethod
    def of(
        cls,
        arm: DamagedArm,
        start: npt.ArrayLike,
        acceleration: Sequence[float] | None = None,
        velocity: Sequence[float] | None = None,
        clearance: LinkClearance | None = None,
        search: RecoverySearch | None = None,
    ) -> DamagedState:
        """Return an arm at a configuration of all its joints; see `recover`."""
        whole = finite_vector("start", start, len(arm.healthy.names))
        begin = arm.start(whole)
        connector = Connector(arm.chain, clearance)
        if not connector.is_free(begin):
            allowed = "a configuration in which links keep their distance"
            raise InputError("start", "in collision", allowed)
        healthy = np.array([joint.velocity for joint in arm.healthy.joints])
        given = healthy if velocity is None else finite_vector("velocity", velocity, len(whole))
        fastest = np.where(np.isfinite(given), given, _SPEED)[arm.free]
        # Failures may have reduced what the file states.
        left = np.array([joint.velocity for joint in arm.chain.joints])
        fastest = np.minimum(fastest, left)
        if acceleration is None:
            strongest = fastest / _TO_SPEED
        else:
            strongest = finite_vector("acceleration", acceleration, len(whole))[arm.free]
        limits = MotionLimits.of(arm.chain, strongest.tolist(), fastest.tolist())
        return cls(arm, whole, begin, limits, connector, search or RecoverySearch())

    def run_along(self, corners: FloatArray, stops: Sequence[int]) -> TimedTrajectory:
        """Return a trajectory of all joints along configurations (N, n) of what can move."""
        chain, arm = self.arm.chain, self.arm
        if np.max(np.abs(corners - corners[0])) < 1e-9:  # it is there already
            corners = corners[[0, 0]]
        run = timed(chain, corners, self.limits, stops)
        still = np.zeros((len(run.times), len(arm.healthy.names)))
        speeds, accelerations = still.copy(), still.copy()
        speeds[:, arm.free], accelerations[:, arm.free] = run.velocities, run.accelerations
        return replace(
            run,
            joints=arm.healthy.names,
            positions=arm.whole(run.positions),
            velocities=speeds,
            accelerations=accelerations,
        )

    def proof(self, goal: Goal, boxes: int) -> ReachProof | None:
        """Return a proof that a goal is out of reach, if there is one with so many boxes."""
        chain = self.arm.chain
        return prove_unreachable(chain, tool_points(chain, goal), boxes)


def recover(
    robot: object,
    start: npt.ArrayLike,
    failures: Sequence[Failure],
    goal: Goal | Pose | ToolPath,
    *,
    tip: str | None = None,
    base: str | None = None,
    point: Sequence[float] = (0.0, 0.0, 0.0),
    acceleration: Sequence[float] | None = None,
    velocity: Sequence[float] | None = None,
    clearance: LinkClearance | None = None,
    search: RecoverySearch | None = None,
) -> Recovery:
    """Reach a goal after failures, or prove that no configuration does.

    Parameters
    ----------
    robot
        A path or a model; see `formulations.kinematics.read_robot`.
    start
        Where the arm is: radians or metres of all its joints, locked ones included, shape (n,).
    failures
        Joints that have locked (`Locked`), or that are left a smaller range (`ReducedRange`) or
        speed (`ReducedSpeed`). Joints that swing freely are not supported.
    goal
        A pose of the tool, with its tolerances; a `Goal`, where not all directions count; or a
        path, see `formulations.recovery.along_path`.
    tip, base, point
        Links, and the tip's point; by default the only last link, the root and the origin.
    acceleration, velocity
        Limits of all joints, per second; by default those of the file (1 where it has none),
        and accelerations that reach them in half a second.
    clearance
        What links, and obstacles, keep from each other, of the arm that is left; by default
        they may touch.
    search
        How much is tried.

    Returns
    -------
    Recovered, Impossible or NotFound
        A trajectory that passed the check of `formulations.recovery.checking`; or a proof that
        the goal is out of reach of what can move, collisions not looked at; or what was tried.

    Raises
    ------
    InputError
        If a joint is unknown, a value is outside its limits, the arm is in collision where it
        is, or nothing is left that moves the tip.
    MissingLibraryError
        If toppra is not installed, or ompl, where a way around links is needed.
    """
    arm = DamagedArm.of(read_robot(robot), failures, tip, base, point)
    state = DamagedState.of(arm, start, acceleration, velocity, clearance, search)
    if isinstance(goal, ToolPath):
        from formulations.recovery.along_path import recover_path

        return recover_path(state, goal)
    if isinstance(goal, Pose):
        goal = Goal(goal)
    return recover_pose(state, of_kind("goal", goal, Goal, "a Goal, a Pose or a ToolPath"))


def recover_pose(state: DamagedState, goal: Goal) -> Recovery:
    """Reach a pose from where a damaged arm is, or say why not; see `recover`."""
    search, tried = state.search, []
    rng = np.random.default_rng(search.seed)
    rounds = [_FIRST_STARTS, search.starts] if search.starts > _FIRST_STARTS else [search.starts]
    for starts, boxes in zip(rounds, (_FIRST_BOXES, search.boxes), strict=False):
        ends = GoalSearch(state.arm.chain, goal, state.start).at_goal(starts, rng)
        tried.append(f"{starts} starts: {len(ends)} configurations at the goal")
        free = [end for end in ends if state.connector.is_free(end)]
        if state.connector.clearance is not None:
            tried.append(f"{len(free)} of them with links apart")
        if free:
            answer = _along_a_way(state, goal, np.array(free[:_ENDS]), tried)
            if answer is not None:
                return answer
        if not len(ends):
            proof = state.proof(goal, min(boxes, search.boxes))
            if proof is not None:
                tried.append(f"a proof of {proof.boxes} boxes")
                return Impossible(
                    proof, help_at(state.arm, goal, state.start, rng), tuple(tried)
                )
            tried.append(f"no proof with {min(boxes, search.boxes)} boxes")
    return NotFound(help_at(state.arm, goal, state.start, rng), tuple(tried))


def _along_a_way(
    state: DamagedState, goal: Goal, ends: FloatArray, tried: list[str]
) -> Recovered | None:
    """Return a checked trajectory to one of some configurations, None if there is none."""
    corners = state.connector.way(
        state.start, ends, state.search.seconds, state.search.seed
    )
    if corners is None:
        tried.append(f"RRT-Connect for {state.search.seconds:g} s: no way")
        return None
    run = state.run_along(corners, range(len(corners)))
    wrong = faults(state.arm, state.whole, goal, run, state.connector.clearance)
    tried.append(f"a way with {len(corners) - 2} corners: {', '.join(wrong) or 'it is right'}")
    return None if wrong else Recovered(run, len(corners) - 2, tuple(tried))
