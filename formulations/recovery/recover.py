"""After a failure: reach the goal with what is left, or say why not.

Configurations at the goal are found by inverse kinematics from many starts, ways to them by
straight lines of the joints and, where links have to stay apart, by OMPL's RRT-Connect; times
by TOPP-RA. What comes out is checked by `checking`, which shares nothing with that. Where no
configuration is found, a proof is tried that there is none.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy.typing as npt

from formulations.clearance.link_clearance import LinkClearance
from formulations.kinematics.read_robot import read_robot
from formulations.paths.waypoints import ToolPath
from formulations.recovery.along_path import recover_path
from formulations.recovery.answers import Recovery
from formulations.recovery.damaged_state import DamagedState, RecoverySearch
from formulations.recovery.failures import DamagedArm, Failure
from formulations.recovery.goal import ToolGoal
from formulations.recovery.to_pose import recover_pose
from formulations.robots.pose_constrained_arm import Pose
from nlp.errors import of_kind


def recover(
    robot: object,
    start: npt.ArrayLike,
    failures: Sequence[Failure],
    goal: ToolGoal | Pose | ToolPath,
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
        Where the arm is: radians or metres of all joints, locked ones included, shape (n,).
    failures
        Joints that have locked (`Locked`), or are left a smaller range (`ReducedRange`) or
        speed (`ReducedSpeed`). Joints that swing freely are not supported.
    goal
        A pose of the tool, with its tolerances; a `ToolGoal`, where not all directions count;
        or a path, see `formulations.recovery.along_path`.
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
        return recover_path(state, goal)
    if isinstance(goal, Pose):
        goal = ToolGoal(goal)
    return recover_pose(
        state, of_kind("goal", goal, ToolGoal, "a ToolGoal, a Pose or a ToolPath")
    )
