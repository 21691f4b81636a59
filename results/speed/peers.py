"""Other tools beside ours: on the same arm, in the same run, and what each of them computes.

No two of these tasks are the same: `Peer.task` of each says what is computed, and how it is
another task than that of the row before. A tool that is not installed has a row without times.
"""

from __future__ import annotations

import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from lockedjoint.kinematics.inverse import solve_ik
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.kinematics.tool_poses import ToolPoses
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.paths.connecting import Connector, SearchLimit
from lockedjoint.paths.motion_limits import MotionLimits
from lockedjoint.paths.timing import timed
from lockedjoint.robot import Robot

# A tick of mink is asked for so often in one measurement: it takes microseconds.
_TICKS = 2000
# Ways around the post are searched for with so many seeds in one measurement.
_WAYS = 5
# The way around the post: one configuration, in radians, and the first joint at its end.
_BESIDE_THE_POST_RAD = (0.2, 0.2, 0.0, -2.0, 0.0, 2.2, 0.8)
_FIRST_JOINT_AT_THE_END_RAD = 1.7
# RRT-Connect gives up after so many random samples.
_MOST_SAMPLES = 100_000
# A path is timed so often in one measurement, with these accelerations, rad/s².
_TIMINGS = 5
_ACCELERATION_RAD_S2 = 8.0
# Samples of the path that is timed.
_TIMED_SAMPLES = 40
# So many poses are reached for in one measurement, of random configurations; ours begins from
# so many random configurations at once.
_GOALS = 50
_STARTS_OF_A_GOAL = 20
# Most steps of our inverse kinematics.
_STEPS = 60
# TRAC-IK gives up after so many seconds, and has reached a pose to this, metres and radians.
_TRAC_IK_S = 0.05
_TRAC_IK_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Peer:
    """A task of one tool: what it is called, the package it needs, and what is computed.

    `make` returns a function of a seed that does the task, and says what came out, and how
    often it does so in one call.
    """

    what: str
    package: str
    task: str
    make: Callable[[], tuple[Callable[[int], str], int]]

    def measured(self) -> Callable[[int], tuple[float, str]]:
        """Return a function of the seed: seconds of the processor for one task, and words.

        ImportError if the package, or one that the task needs, is not installed.
        """
        function, count = self.make()

        def call(seed: int) -> tuple[float, str]:
            began = time.process_time()
            found = function(seed)
            spent = (time.process_time() - began) / count
            return spent, found

        return call


def peers(robot: Robot, apart: Robot, urdf: Path, points: FloatArray) -> Iterator[Peer]:
    """Yield other tools, each after what is ours.

    `apart` keeps its links from a cell; the points are configurations, (N, n).
    """
    arm = robot.arm
    for compiled in (False, True):
        yield Peer(
            "mink task: error and Jacobian" + (", compiled" if compiled else ""),
            "mink",
            "smooth worst case and its gradient",
            lambda compiled=compiled: _mink(robot, urdf, points, compiled),  # type: ignore[misc]
        )
    task = "another task: where one body is, without failures"
    yield Peer("mink's own task of a frame", "mink", task, lambda: _mink(None, urdf, points))
    task = "links keep their distance everywhere on the way; shortened"
    yield Peer("a way around the post", "ompl", task, lambda: (_ways(apart), _WAYS))
    task = "another task: links are looked at 1 % of the space apart; not shortened"
    own = "RRT-Connect of OMPL alone, around the post"
    yield Peer(own, "ompl", task, lambda: (_alone(apart), _WAYS))
    way = _straight(points)
    task = "joint positions, smooth accelerations, limits kept between points"
    yield Peer("timing of a path", "toppra", task, lambda: (_timed(arm, way), _TIMINGS))
    task = "another task: accelerations jump, and nothing is sampled"
    yield Peer("toppra alone", "toppra", task, lambda: (_toppra(arm, way), _TIMINGS))
    goals = arm.samples(np.random.default_rng(1), _GOALS)
    task = f"a pose from {_STARTS_OF_A_GOAL} random starts at once, {_STEPS} steps at most"
    yield Peer("inverse kinematics", "numpy", task, lambda: (_ours(arm, goals), _GOALS))
    task = f"another task: a pose from one start, random restarts for {_TRAC_IK_S} s at most"
    yield Peer("TRAC-IK", "pytracik", task, lambda: (_trac_ik(arm, urdf, goals), _GOALS))


def _mink(
    robot: Robot | None, urdf: Path, points: FloatArray, compiled: bool = False
) -> tuple[Callable[[int], str], int]:
    """Return what asks a task for error and Jacobian in turns; mink's own without a robot."""
    import mink
    import mujoco

    root = ET.parse(urdf).getroot()
    for link in root.iter("link"):  # what is seen and touched is not needed, and is in files
        for kind in ("visual", "collision"):
            for element in link.findall(kind):
                link.remove(element)
    model = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    configurations = []
    for q in points:
        full = model.qpos0.copy()
        full[: len(q)] = q
        configurations.append(mink.Configuration(model, full))
    if robot is None:
        task: Any = mink.FrameTask("panda_link7", "body", 1.0, 1.0)
        task.set_target_from_configuration(configurations[0])
    else:
        from lockedjoint.adapters.mink import MinkWorstCaseTask

        task = MinkWorstCaseTask(robot, model, 1.0, compiled=compiled)

    def ticks(_: int) -> str:
        for k in range(_TICKS):
            at = configurations[k % len(configurations)]
            task.compute_error(at)
            task.compute_jacobian(at)
        return ""

    return ticks, _TICKS


def _beside_the_post() -> tuple[FloatArray, FloatArray]:
    start = np.array(_BESIDE_THE_POST_RAD)
    end = start.copy()
    end[0] = _FIRST_JOINT_AT_THE_END_RAD
    return start, end


def _ways(apart: Robot) -> Callable[[int], str]:
    """Return our search for ways around the post."""
    import ompl.base  # noqa: F401

    connector = Connector(apart.arm.chain, apart.apart)
    start, end = _beside_the_post()

    def search(seed: int) -> str:
        limit, seeds = SearchLimit(samples=_MOST_SAMPLES), range(_WAYS * seed, _WAYS * seed + 5)
        ways = [connector.way(start, end[None], limit, each) for each in seeds]
        return _lengths([way for way in ways if way is not None])

    return search


def _alone(apart: Robot) -> Callable[[int], str]:
    """Return the search of OMPL, which looks at points on the way."""
    from ompl import base, geometric, util

    connector = Connector(apart.arm.chain, apart.apart)
    start, end = _beside_the_post()
    size = len(start)

    def point(state: Any) -> FloatArray:
        return np.array([state[k] for k in range(size)])

    def one(seed: int) -> FloatArray | None:
        util.setLogLevel(util.LOG_NONE)
        util.RNG.setSeed(seed + 1)
        space, bounds = base.RealVectorStateSpace(size), base.RealVectorBounds(size)
        for k, (low, high) in enumerate(zip(*connector.chain.limits, strict=True)):
            bounds.setLow(k, float(low))
            bounds.setHigh(k, float(high))
        space.setBounds(bounds)
        task = geometric.SimpleSetup(space)
        information = task.getSpaceInformation()
        information.setStateValidityChecker(lambda state: connector.is_free(point(state)))
        ends = []
        for q in (start, end):
            ends.append(space.allocState())
            for k in range(size):
                ends[-1][k] = float(q[k])
        task.setStartAndGoalStates(*ends)
        task.setPlanner(geometric.RRTConnect(information))
        task.solve(base.PlannerTerminationCondition(SearchLimit(_MOST_SAMPLES).condition()))
        if not task.haveExactSolutionPath():
            return None
        return np.array([point(state) for state in task.getSolutionPath().getStates()])

    def search(seed: int) -> str:
        ways = [one(each) for each in range(_WAYS * seed, _WAYS * seed + _WAYS)]
        return _lengths([way for way in ways if way is not None])

    return search


def _lengths(ways: list[FloatArray]) -> str:
    """Say how many ways were found, and how far all joints turn on them."""
    turns = [float(np.abs(np.diff(way, axis=0)).sum()) for way in ways]
    return f"{len(ways)} of {_WAYS} found, {np.mean(turns or [np.nan]):.3g} rad on average"


def _straight(points: FloatArray) -> FloatArray:
    """Return samples of a smooth path between some configurations, shape (samples, n)."""
    corners = points[:4]
    at = np.linspace(0.0, np.pi, _TIMED_SAMPLES)
    shares = np.stack([np.cos(k * at) for k in range(4)], axis=1) / 8
    return np.asarray(corners.mean(axis=0) + shares @ (corners - corners.mean(axis=0)))


def _limits(arm: RobotArm) -> MotionLimits:
    return MotionLimits.of(arm.chain, [_ACCELERATION_RAD_S2] * arm.size)


def _timed(arm: RobotArm, way: FloatArray) -> Callable[[int], str]:
    """Return our timing of a path."""
    import toppra  # noqa: F401

    def run(_: int) -> str:
        for _ in range(_TIMINGS):
            found = timed(arm.chain, way, _limits(arm))
        return f"lasts {found.duration:.4g} s"

    return run


def _toppra(arm: RobotArm, way: FloatArray) -> Callable[[int], str]:
    """Return toppra's own timing of the same path."""
    import toppra
    from toppra import algorithm, constraint

    limits, places = _limits(arm), np.linspace(0, 1, len(way))
    bounds = [
        constraint.JointVelocityConstraint(np.outer(limits.velocity, [-1.0, 1.0])),
        constraint.JointAccelerationConstraint(np.outer(limits.acceleration, [-1.0, 1.0])),
    ]

    def run(_: int) -> str:
        for _ in range(_TIMINGS):
            path = toppra.SplineInterpolator(places, way)
            found = algorithm.TOPPRA(bounds, path).compute_trajectory()
        return f"lasts {found.duration:.4g} s"

    return run


def _ours(arm: RobotArm, goals: FloatArray) -> Callable[[int], str]:
    """Return our inverse kinematics of poses, one after the other."""
    positions, rotations = arm.chain.tip_at(goals.T)

    def reach(seed: int) -> str:
        rng, reached = np.random.default_rng(seed), 0
        for k in range(len(goals)):
            pose = ToolPoses(positions[:, k : k + 1], rotations[..., k : k + 1], range(6))
            starts = arm.samples(rng, _STARTS_OF_A_GOAL).T
            reached += bool(solve_ik(arm.chain, starts, pose, iterations=_STEPS)[1].any())
        return f"{reached} of {len(goals)} reached"

    return reach


def _trac_ik(arm: RobotArm, urdf: Path, goals: FloatArray) -> Callable[[int], str]:
    """Return the same by TRAC-IK."""
    chain, trac_ik = arm.chain, import_module("trac_ik")
    solver = trac_ik.TracIK(chain.base, chain.tip, str(urdf), _TRAC_IK_S, _TRAC_IK_TOLERANCE)
    # It read limits of 0 from a file that has soft ones, too.
    solver.joint_limits = tuple(limits.tolist() for limits in chain.limits)
    positions, rotations = chain.tip_at(goals.T)

    def reach(seed: int) -> str:
        rng, reached = np.random.default_rng(seed), 0
        for k, start in enumerate(arm.samples(rng, len(goals))):
            found = solver.ik(positions[:, k], rotations[..., k], seed_jnt_values=start)
            reached += found is not None
        return f"{reached} of {len(goals)} reached"

    return reach
