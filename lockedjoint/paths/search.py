"""A robot and a path go in, a plan comes out: what comes before and after the search.

`path` takes whatever makes a `Robot`; `plan_path` takes its parts: an arm, a path, and what
links keep from each other. The search itself is in `planner`. A configuration has the shape
(n,), n joints in radians, those of sliders in metres.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from lockedjoint.clearance.link_clearance import LinkClearance
from lockedjoint.kinematics.chain import narrowed
from lockedjoint.kinematics.in_degrees import InDegrees
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError, of_kind
from lockedjoint.paths.approach import approach, whole_turns
from lockedjoint.paths.connecting import Connector
from lockedjoint.paths.path_search import PathSearch
from lockedjoint.paths.plan import PathPlan
from lockedjoint.paths.planner import Planner
from lockedjoint.paths.waypoints import ToolPath, read_waypoints
from lockedjoint.robot import Robot, with_settings


def path(
    robot: object,
    waypoints: ToolPath | str | os.PathLike[str],
    search: PathSearch | None = None,
    *,
    limits: Mapping[str, tuple[float, float]] | InDegrees | None = None,
    q: Any = None,
    **settings: Any,
) -> PathPlan:
    """Find the trajectory of the joints on which the tool can finish its path most often.

    A failure is one joint that locks at one sample of the path. The search looks for the
    trajectory that survives as many of these failures as possible.

    Parameters
    ----------
    robot
        A `Robot`, or what makes one. The directions of its task are kept along the path; by
        default all that the waypoints state. Its links keep its `clearance` from each other and
        from its obstacles.
    waypoints
        The path of the tool, or a file of it; see `read_waypoints`.
    search
        How to look.
    limits
        Artificial limits of joints, radians or metres (or `InDegrees`), which hold until a
        joint locks.
    q
        Where the arm stands, see `Robot.configuration`: how it gets from there to the first
        waypoint is in `PathPlan.approach`. By default it stands at the first waypoint.
    **settings
        Fields of `PathSearch`, in place of those of the search, such as ``samples=20``.

    Returns
    -------
    PathPlan
        The trajectory, and which failures it survives; see `plan_path` and `approach`.

    Raises
    ------
    InputError
        If a waypoint, or the path between two, is out of reach, if the limits or the distances
        to be kept leave no trajectory, or if another argument is not allowed.
    KeyboardInterrupt
        If interrupted before a first trajectory was found.

    Examples
    --------
    >>> import numpy as np
    >>> import lockedjoint as lj
    >>> way = lj.ToolPath(np.array([[0.45, -0.15, 0.3], [0.5, 0.2, 0.35]]))
    >>> plan = lj.path("example", way, samples=6, tracks=6, rounds=1)
    >>> len(plan.times)
    6
    """
    given, way = Robot.of(robot), waypoints
    if isinstance(way, str | os.PathLike):
        way = read_waypoints(Path(way))
    chosen = with_settings(PathSearch, search, settings)
    check_times(way, settings)
    own = None if limits is None else given.in_radians(limits)
    standing = None if q is None else standing_at(given, q, own)
    plan = plan_path(arm_along(given, way), way, chosen, given.apart, own)
    if standing is None:
        return plan
    return with_approach(plan, given, *standing, chosen.seed, own)


def check_times(waypoints: object, settings: Mapping[str, Any]) -> None:
    """Refuse a duration beside waypoints that have times, by which it would mean nothing."""
    if (
        "duration" in settings
        and isinstance(waypoints, ToolPath)
        and waypoints.times is not None
    ):
        allowed = "none where the waypoints have times"
        raise InputError("duration", settings["duration"], allowed)


def standing_at(
    robot: Robot, q: Any, limits: Mapping[str, tuple[float, float]] | None = None
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return where a robot stands, (n,), and notes; InputError if it cannot stand there.

    The artificial limits, radians or metres, hold there, too.
    """
    point, notes = robot.configuration(q)
    chain = narrowed(robot.chain, limits or {}, "limits")
    chain.within_limits(point)
    Connector(chain, robot.apart).check_free("q", point)
    return point, notes


def with_approach(
    plan: PathPlan,
    robot: Robot,
    start: FloatArray,
    notes: tuple[str, ...],
    seed: int,
    limits: Mapping[str, tuple[float, float]] | None = None,
) -> PathPlan:
    """Return a plan with the way from where a robot stands, within limits; see `approach`.

    The whole planned trajectory is moved by whole turns of joints without limits, so that these
    go the short way to it.
    """
    planned = plan.planned
    chain = narrowed(robot.chain, limits or {}, "limits")
    turns = whole_turns(chain, start, planned.configurations[0])
    planned = replace(planned, configurations=planned.configurations + turns)
    way = approach(chain, start, planned.configurations[0], robot.apart, seed, notes)
    return replace(plan, planned=planned, approach=way)


def arm_along(robot: Robot, waypoints: ToolPath) -> RobotArm:
    """Return a robot's arm with its task, by default the directions that waypoints state."""
    of_kind("waypoints", waypoints, ToolPath, "a ToolPath, or the file of one")
    if robot.task is not None:
        return robot.arm
    directions = "all" if waypoints.has_orientation else "position"
    return robot.changed(task=directions).arm


def plan_path(
    arm: RobotArm,
    path: ToolPath,
    search: PathSearch | None = None,
    clearance: LinkClearance | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
) -> PathPlan:
    """Search for the trajectory from which the path can most often be finished.

    Parameters
    ----------
    arm
        The robot, with the directions in which the path has to be kept, along the base's axes.
    path
        The path.
    search
        How to look.
    clearance
        What links keep from each other and from obstacles at the samples; none touch between
        samples, nor after a failure that counts as survived. By default they may.
    limits
        Artificial limits of joints, which hold until a joint locks.

    Raises
    ------
    KeyboardInterrupt
        If interrupted before a first trajectory was found.
    InputError
        If the task has orientations and the waypoints have none, a waypoint or the path
        between two is out of reach, or the limits of speed, or links that have to stay apart,
        leave no trajectory.
    """
    search = PathSearch() if search is None else search
    of_kind("search", search, PathSearch, "a PathSearch")
    of_kind("arm", arm, RobotArm, "a RobotArm")
    of_kind("path", path, ToolPath, "a ToolPath, as `read_waypoints` returns it")
    allowed = "a LinkClearance, as `read_clearance` returns it"
    of_kind("clearance", clearance, (LinkClearance, type(None)), allowed)
    task = arm.task
    directions = ",".join(task.directions)
    if task.frame != "base":
        raise InputError(
            "task", f"{task.frame}:{directions}", "directions along the base's axes"
        )
    if not path.has_orientation and max(task.rows) > 2:
        allowed = "vx,vy,vz or some of them, because the waypoints have no orientation"
        raise InputError("task", directions, allowed)
    return Planner(arm, path, search, clearance, limits).plan()


def check_reach(arm: RobotArm, path: ToolPath) -> None:
    """Raise InputError if a waypoint is out of the arm's reach; see `plan_path`."""
    Planner(arm, path, PathSearch()).check_reach()
