"""After a failure: reach the goal with what is left, or say why not.

Configurations at the goal are found by inverse kinematics from many starts, ways to them by
straight lines of the joints and, where links have to stay apart, by OMPL's RRT-Connect; times
by TOPP-RA. What comes out is checked by `checking`, which shares nothing with that. Where no
configuration is found, a proof is tried that there is none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lockedjoint.kinematics.pose import Pose
from lockedjoint.kinematics.state import stated_positions
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError, of_kind
from lockedjoint.nlp.progress import Step
from lockedjoint.paths.connecting import SearchLimit
from lockedjoint.paths.plan_in_time import RestOfPlan
from lockedjoint.paths.waypoints import ToolPath
from lockedjoint.recovery.along_path import recover_path
from lockedjoint.recovery.answers import Recovery
from lockedjoint.recovery.checking import faults
from lockedjoint.recovery.configurations import GoalSearch
from lockedjoint.recovery.damaged_state import DamagedState
from lockedjoint.recovery.failures import Damage, Failure, Locked, check_failures, list_of
from lockedjoint.recovery.goal import ToolGoal
from lockedjoint.recovery.recovery_search import RecoverySearch
from lockedjoint.recovery.swinging import swinging_run
from lockedjoint.recovery.unreachable import prove_unreachable
from lockedjoint.robot import Robot, with_settings

# RRT-Connect may choose from so many ends.
_MOST_ENDS = 30


def recover(
    robot: object,
    q: Any,
    failures: Failure | Sequence[Failure],
    goal: ToolGoal | Pose | ToolPath | RestOfPlan,
    search: RecoverySearch | None = None,
    *,
    acceleration: Sequence[float] | float | None = None,
    velocity: Sequence[float] | float | None = None,
    jerk: Sequence[float] | float | None = None,
    **settings: Any,
) -> Recovery:
    """Reach a goal after failures, or prove that no configuration does.

    Parameters
    ----------
    robot
        A `Robot`, or what makes one. Its links keep its `clearance` from each other and from
        its obstacles, after the failure too.
    q
        The configuration of the arm: radians or metres of all joints, those that fail included;
        see `Robot.configuration`. None if the goal is the rest of a plan, which has it.
    failures
        One failure, or a list: joints that have locked (`Locked`), or are left a smaller range
        (`ReducedRange`) or speed (`ReducedSpeed`); and one that swings freely (`FreeSwinging`),
        see `lockedjoint.recovery.swinging`. It needs a robot with masses: a URDF file or a
        pinocchio model.
    goal
        A pose of the tool, with its tolerances; a `ToolGoal`, where not all directions count;
        a path, see `lockedjoint.recovery.along_path`; or the rest of a plan, such as
        ``lj.path(robot, way).after(4.0)``: joints that had locked before still are.
    search
        How much is tried, and for how long.
    acceleration, velocity
        Limits of all joints, or one for all, per second; by default those of the file (1 where
        it has none), and accelerations that reach them in half a second.
    jerk
        Limits of all joints, or one for all, per second cubed; by default none.
    **settings
        Fields of `RecoverySearch`, in place of those of the search.

    Returns
    -------
    Recovery
        One of four answers, and what was tried: a trajectory that has passed the check of
        `lockedjoint.recovery.checking`; impossible, proved, or impossible, numerical, which
        say that the joints that can still move do not reach the goal, even if they may collide;
        or not found.

    Raises
    ------
    InputError
        If a joint is unknown or missing in `q`, a value is outside its limits, the arm is in
        collision where it is, nothing is left that moves the tip, it is not known how a
        joint swings, or the plan is of another robot.
    MissingLibraryError
        If toppra is not installed, where a way was found; or ompl, where a way around links is
        needed; or pinocchio, where a joint swings freely. A proof needs none of them.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> q, stuck = [0, 0.6, 0, 1.4, 0, 0.6, 0], lj.Locked("elbow")
    >>> lj.recover("example", q, stuck, lj.Pose((0.45, 0.2, 0.4))).verdict
    'trajectory'
    >>> lj.recover("example", q, stuck, lj.Pose((3.0, 0.0, 0.5))).verdict
    'impossible, proved'
    """
    healthy, given = Robot.of(robot), list_of(failures)
    if isinstance(goal, RestOfPlan):
        if q is not None:
            raise InputError("q", q, "None with the rest of a plan, which has a configuration")
        goal.plan.check_robot(healthy.chain)
        given += _locked_before(goal, healthy, given)
        q, goal = goal.q, goal.path
    check_failures(healthy.chain, given)
    start, notes = healthy.configuration(_with_locked(healthy, q, given))
    damage = Damage.of(healthy, given, start)
    clearance = healthy.apart_along(damage.chain)
    chosen = with_settings(RecoverySearch, search, settings)
    limits = (acceleration, velocity, jerk)
    state = DamagedState.of(damage, start, *limits, clearance, chosen)
    notes = (*damage.chain.notes, *notes, *(() if clearance is None else clearance.notes))
    answer = recovered(state, goal)  # which checks the kind of goal
    notes += goal.pose.notes if isinstance(goal, ToolGoal) else goal.notes
    answer = replace(answer, notes=notes)
    run, motion = answer.trajectory, state.connector.motion
    if run is None or motion is None:
        return answer
    return replace(answer, closest=motion.closest_along(run.positions[:, damage.free]))


def recovered(state: DamagedState, goal: ToolGoal | Pose | ToolPath) -> Recovery:
    """Reach a goal from where a damaged arm is; see `recover`."""
    swings = state.arm.hanging is not None
    if swings and (isinstance(goal, ToolPath) or state.connector.clearance is not None):
        allowed = "a pose or position without a clearance, where a joint swings freely"
        raise InputError("goal", "a path, or with a clearance", allowed)
    if isinstance(goal, ToolPath):
        return recover_path(state, goal)
    goal = ToolGoal(goal) if isinstance(goal, Pose) else goal
    of_kind("goal", goal, ToolGoal, "a ToolGoal, a Pose, a ToolPath or the rest of a plan")
    return _recover_pose(state, goal)


def _locked_before(
    rest: RestOfPlan, robot: Robot, failures: Sequence[Failure]
) -> list[Failure]:
    """Return failures of joints that had locked before a plan was made, unless stated."""
    stated = [failure.joint for failure in failures if isinstance(failure, Locked)]
    others = [name for name in rest.plan.locked if name in robot.chain.names]
    return [Locked(name, rest.plan.locked[name]) for name in others if name not in stated]


def _with_locked(robot: Robot, q: Any, failures: Sequence[Failure]) -> Any:
    """Return a configuration with joints where they have locked, if it leaves that open.

    It leaves it open where it has positions by name, but not theirs, or is left out.
    """
    locked = {
        each.joint: each.at
        for each in failures
        if isinstance(each, Locked) and each.at is not None
    }
    if q is None:
        middle = dict(zip(robot.chain.names, robot.chain.mid_range.tolist(), strict=True))
        return {**middle, **locked}
    stated = stated_positions(q, robot.chain, robot.states, robot.slides)
    return {**locked, **stated} if isinstance(stated, Mapping) else stated


def _recover_pose(state: DamagedState, goal: ToolGoal) -> Recovery:
    """Reach a pose from where a damaged arm is, or say why not."""
    rng, tried = np.random.default_rng(state.search.seed), list[str]()
    places = GoalSearch(state.arm, goal, state.start)
    rounds, tell = state.search.rounds, state.search.progress
    for number, (starts, boxes) in enumerate(rounds):
        tell(Step("configurations at the goal", number / len(rounds)))
        ends = places.at_goal(starts, rng)
        tried.append(f"{starts} starts: {len(ends)} configurations at the goal")
        tell(Step("ways to it" if len(ends) else "a proof", (number + 0.5) / len(rounds)))
        proof = None if len(ends) else prove_unreachable(state.arm.chain, goal, boxes)
        if proof is not None:
            tried.append(f"a proof of {_counted(proof.boxes)}, {proof.grade}")
            verdict, advice = f"impossible, {proof.grade}", places.help(rng)
            return Recovery(verdict, tuple(tried), proof=proof, help=advice)
        if not len(ends):
            tried.append(f"no proof with {_counted(boxes)}")
            continue
        answer = _along_a_way(state, goal, ends, tried)
        if answer is not None:
            return answer
    return Recovery("not found", tuple(tried), help=places.help(rng))


def _counted(boxes: int) -> str:
    """Return a number of boxes in words."""
    return "1 box" if boxes == 1 else f"{boxes} boxes"


def _along_a_way(
    state: DamagedState, goal: ToolGoal, ends: FloatArray, tried: list[str]
) -> Recovery | None:
    """Return a checked trajectory to one of some configurations, None if there is none."""
    if state.arm.hanging is not None:
        run = swinging_run(state, state.arm.hanging, goal, ends[:_MOST_ENDS], tried)
        return None if run is None else Recovery("trajectory", tuple(tried), run)
    free = [end for end in ends if state.connector.is_free(end)]
    if state.connector.clearance is not None:
        tried.append(f"{len(free)} of them with links apart")
    if not free:
        return None
    limit, seed = SearchLimit(seconds=state.search.time_limit), state.search.seed
    corners = state.connector.way(state.start, np.array(free[:_MOST_ENDS]), limit, seed)
    if corners is None:
        tried.append(f"RRT-Connect for {limit}: no way")
        return None
    run = state.run_along(corners, range(len(corners)))
    wrong = faults(state.arm, state.whole, goal, run, state.connector.clearance)
    tried.append(f"a way with {len(corners) - 2} corners: {', '.join(wrong) or 'it is right'}")
    return None if wrong else Recovery("trajectory", tuple(tried), run)
