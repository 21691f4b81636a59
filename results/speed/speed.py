"""Processor time of what robots are asked for, beside pinocchio's Jacobian in the same run.

Machines differ, and so does one machine from hour to hour. So everything has two numbers: its
processor time, and how often pinocchio computes the Jacobian of the Panda, J, meanwhile.

Short calls (`_calls`, microseconds to milliseconds) are made many times in each of several
rounds, all in turns with J. Long ones (`_long`, seconds) are made a few times, with J before
and after each. A target is a processor time in milliseconds on a machine on which J takes
`QUIET_J_US`; a time is compared with it after it has been divided by what J took meanwhile.
Targets are decisions, not measurements: a change of one changes only its verdict. Other tools
on like tasks come last, see `peers`.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import pinocchio as pin

import lockedjoint as lj
from lockedjoint.adapters import compiled
from lockedjoint.formulations.io.table import column
from lockedjoint.formulations.solving.effort import Effort
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.paths.waypoints import ToolPath
from lockedjoint.robot import Robot
from lockedjoint.robots.posture import best_posture
from lockedjoint.robots.robot_assessment import measure_robot
from lockedjoint.robots.search import Search
from results.robots.survey import ARMS, SurveyArm
from results.script import main, study_of
from results.speed.peers import peers

#: J takes so long on the quiet machine on which the targets were set, in microseconds.
QUIET_J_US = 0.77
# Short calls are measured in so many rounds, each beside J. More rounds make the least and the
# median steadier.
_ROUNDS = 25
# J is called so often in a round. The clock's resolution is lost in so many calls.
_CALLS_OF_J = 2000
# A quick call, below a millisecond, is made so often in a round; the measure of a
# configuration, which takes milliseconds, less often.
_QUICK_CALLS = 200
_MEASURE_CALLS = 5
# J before and after a long call is the least of so many rounds.
_UNIT_ROUNDS = 10
# Long calls are made so often, each with a seed of its own.
_REPEATS = 3
# So many configurations of the Panda are drawn at random for short calls.
_CONFIGURATIONS = 500
# Calls are numbered from 0 to this less 1, again and again: a call takes the configuration of
# its number, so it has to be at most `_CONFIGURATIONS`.
_NUMBERS = 400
# So many configurations are set up for the tasks of pink.
_TASK_CONFIGURATIONS = 50
# The smooth worst case has this width where configurations are chosen. The choice depends on
# whether there is a value, hardly on the width.
_WIDTH = 0.01
# A path has so many samples, and a voxel this edge in metres. Times grow with the samples, and
# with the inverse cube of the edge.
_SAMPLES = 40
_VOXEL_M = 0.02
# The arm keeps so far from obstacles, in metres.
_CLEARANCE_M = 0.01
# Targets of short calls, in J, and of the measure in milliseconds.
_SMOOTH_TARGET_J = 58
_COMPILED_TARGET_J = 20
_TASK_TARGET_J = 100
_MEASURE_TARGET_MS = 2.0
# Targets of long calls, in milliseconds.
_POSTURE_TARGETS_MS = {
    "Baxter, left arm": 3500,
    "TIAGo, torso and arm": 3000,
    "Talos, torso and left arm": 6000,
}
_PATH_TARGET_MS = 3000
_OBSTACLES_TARGET_MS = 6000
_WORKSPACE_TARGET_MS = 20_000
_PROCESS_TARGET_MS = 650
# The path begins from the tool's place at this configuration of the Panda, in radians.
_HOME_RAD = (0.0, -0.4, 0.0, -2.0, 0.0, 1.6, 0.8)
# Its three waypoints are so far from there, along the axes of the base, in metres.
_AWAY_M = ((0.0, -0.2, 0.0), (0.1, 0.1, 0.1), (0.0, 0.25, -0.05))
# What stands beside the Panda, as URDF: a table and a post, lengths in metres.
_CELL = """<robot name="cell"><link name="world"><collision><origin xyz="0.5 0 -0.1"/>
<geometry><box size="0.6 1.2 0.05"/></geometry></collision></link><link name="post"><collision>
<geometry><box size="0.08 0.08 0.7"/></geometry></collision></link><joint name="j" type="fixed">
<parent link="world"/><child link="post"/><origin xyz="0.35 0.5 0.3"/></joint></robot>"""


@dataclass(frozen=True)
class SpeedRow:
    """What was measured: the columns of ``speed.csv``, processor time of one thread.

    The least and the median of all rounds, in milliseconds; the median in J; the least in
    milliseconds if J took 0.77 µs, and the target for that. `found` says what came out.
    """

    what: str
    least_ms: float = field(metadata=column("least, ms", ".4g"))
    median_ms: float = field(metadata=column("median, ms", ".4g"))
    in_jacobians: float = field(metadata=column("in J", ".3g"))
    quiet_ms: float = field(metadata=column("least, ms if J is 0.77 µs", ".3g"))
    target_ms: float = field(metadata=column("target, ms", ".3g"))
    verdict: str = field(metadata=column(empty="–"))
    found: str = field(metadata=column(empty="–"))


@dataclass(frozen=True)
class _Call:
    """A function of the number of a call, how often a round calls it, and its target.

    A target of NaN means that there is none.
    """

    what: str
    function: Callable[[int], Any]
    calls: int
    target_ms: float = float("nan")


def compute(effort: Effort, folder: Path) -> Iterator[SpeedRow]:  # noqa: ARG001
    """Yield a row for everything that is measured."""
    effort.progress("short calls")
    robot, jacobian = Robot(_panda(), tip="panda_hand"), _jacobian(_panda())
    yield from _short(list(_calls(robot, effort.seed)), jacobian)
    for what, function, target in _long(robot, effort.seed):
        effort.progress(what)
        yield _measured(what, function, target, jacobian)
    yield from _peers(robot, jacobian, effort)


def _panda() -> Path:
    return _survey("Franka Panda").path


def _survey(name: str) -> SurveyArm:
    return next(arm for arm in ARMS if arm.name == name)


def _jacobian(path: Path) -> Callable[[int], Any]:
    """Return J as a call: pinocchio's Jacobians of all joints at its neutral configuration."""
    model = pin.buildModelFromUrdf(str(path))
    data, q = model.createData(), pin.neutral(model)
    return lambda _: pin.computeJointJacobians(model, data, q)


def _calls(robot: Robot, seed: int) -> Iterator[_Call]:
    """Yield the short calls, and those of other tools beside them."""
    arm = robot.arm
    points = arm.samples(np.random.default_rng(seed), _CONFIGURATIONS)
    smooth = compiled.smooth_worst_case(robot)
    quick = _QUICK_CALLS
    yield _Call(
        "measure of one configuration",
        lambda k: measure_robot(arm, points[k]),
        _MEASURE_CALLS,
        _MEASURE_TARGET_MS,
    )
    yield _Call("worst case and gradient", lambda k: arm.worst_case(points[k]), quick)
    target = _quiet_ms(_SMOOTH_TARGET_J)
    apart = _far_from_singular(arm, points)

    def at(k: int) -> FloatArray:
        return np.asarray(apart[k % len(apart)])

    what = "smooth worst case and gradient"
    yield _Call(what, lambda k: arm.smooth_worst_case(at(k)), quick, target)
    own = "the same, at all configurations"
    yield _Call(own, lambda k: arm.smooth_worst_case(points[k]), quick)
    target = _quiet_ms(_COMPILED_TARGET_J)
    yield _Call("the same, compiled", lambda k: smooth(at(k)), quick, target)
    yield from _hosts(robot, apart)


def _far_from_singular(arm: RobotArm, points: FloatArray) -> FloatArray:
    """Return the configurations at which JJᵀ has all digits of what is left."""
    from lockedjoint.kinematics.smooth_of_one import smooth_of_one

    smooth = smooth_of_one(arm)
    return np.stack([q for q in points if smooth(q, _WIDTH) is not None])


def _hosts(robot: Robot, points: FloatArray) -> Iterator[_Call]:
    """Yield error and Jacobian of tasks in pink and mink, and of pink's own task of a frame."""
    import pink
    from pink.tasks import FrameTask

    from lockedjoint.adapters.pink import WorstCaseTask

    model = pin.buildModelFromUrdf(str(_panda()))
    configurations = []
    for q in points[:_TASK_CONFIGURATIONS]:
        full = pin.neutral(model)
        for name, value in zip(robot.arm.chain.names, q, strict=True):
            full[model.joints[model.getJointId(name)].idx_q] = value
        configurations.append(pink.Configuration(model, model.createData(), full))
    frame = FrameTask("panda_hand", 1.0, 1.0)
    frame.set_target_from_configuration(configurations[0])

    def both(task: Any) -> Callable[[int], Any]:
        def call(k: int) -> None:
            at = configurations[k % len(configurations)]
            task.compute_error(at)
            task.compute_jacobian(at)

        return call

    what, target = "pink task: error and Jacobian", _quiet_ms(_TASK_TARGET_J)
    yield _Call(what, both(WorstCaseTask(robot, model, 1.0)), _QUICK_CALLS, target)
    quick = WorstCaseTask(robot, model, 1.0, compiled=True)
    yield _Call("the same, compiled", both(quick), _QUICK_CALLS)
    yield _Call("pink's own task of a frame", both(frame), _QUICK_CALLS)


def _short(calls: list[_Call], jacobian: Callable[[int], Any]) -> Iterator[SpeedRow]:
    """Measure short calls in turns, each beside J."""
    every = [_Call("J by pinocchio", jacobian, _CALLS_OF_J), *calls]
    times: list[list[float]] = [[] for _ in every]
    for call in every:
        call.function(0)
    for turn in range(_ROUNDS):
        for call, own in zip(every, times, strict=True):
            began = time.process_time()
            for k in range(call.calls):
                call.function((turn * call.calls + k) % _NUMBERS)
            own.append(1e3 * (time.process_time() - began) / call.calls)
    unit = min(times[0])
    for call, own in zip(every, times, strict=True):
        ratios = [one / other for one, other in zip(own, times[0], strict=True)]
        yield SpeedRow(
            what=call.what,
            least_ms=min(own),
            median_ms=median(own),
            in_jacobians=median(ratios),
            quiet_ms=_quiet_ms(min(own) / unit),
            target_ms=call.target_ms,
            verdict=_verdict(_quiet_ms(min(own) / unit), call.target_ms),
            found="",
        )


def _long(
    robot: Robot, seed: int
) -> Iterator[tuple[str, Callable[[int], tuple[float, str]], float]]:
    """Yield what takes seconds: functions of the repeat to time and what was found."""
    for name, target in _POSTURE_TARGETS_MS.items():
        arm = _survey(name).arm()
        what = f"posture of {name}, {arm.size} joints, to its stopping rule"
        yield what, _timed(partial(_posture, arm, seed)), target
    way = _way(robot.arm)
    free = _timed(lambda k: _path(robot, way, seed + k))
    yield f"path of {_SAMPLES} samples", free, _PATH_TARGET_MS
    apart = _in_cell(robot)
    kept = _timed(lambda k: _path(apart, way, seed + k))
    yield f"path of {_SAMPLES} samples with obstacles", kept, _OBSTACLES_TARGET_MS
    tool = Robot(_panda(), tip="panda_hand_tcp")
    yield "workspace at 2 cm", _timed(lambda _: _workspace(tool)), _WORKSPACE_TARGET_MS
    yield "measure, as a process", lambda _: _process(), _PROCESS_TARGET_MS


def _in_cell(robot: Robot) -> Robot:
    """Return a robot that keeps clear of the table and the post."""
    with tempfile.TemporaryDirectory() as folder:
        cell = Path(folder, "cell.urdf")
        cell.write_text(_CELL, encoding="utf-8")
        return robot.changed(clearance=_CLEARANCE_M, obstacles=cell)


def _peers(robot: Robot, jacobian: Callable[[int], Any], effort: Effort) -> Iterator[SpeedRow]:
    """Measure other tools beside ours; a row without numbers says which is not installed."""
    points = robot.arm.samples(np.random.default_rng(effort.seed), _TASK_CONFIGURATIONS)
    points = _far_from_singular(robot.arm, points)
    for peer in peers(robot, _in_cell(robot), _panda(), points):
        effort.progress(peer.what)
        try:
            function = peer.measured()
        except ImportError:
            nan, found = float("nan"), f"{peer.package} is not installed"
            yield SpeedRow(peer.what, nan, nan, nan, nan, nan, "", found)
            continue
        row = _measured(peer.what, function, float("nan"), jacobian)
        yield replace(row, found="; ".join(filter(None, (peer.task, row.found))))


def _timed(function: Callable[[int], str]) -> Callable[[int], tuple[float, str]]:
    """Return a function that also says how long it took: processor seconds, what was found."""

    def timed(k: int) -> tuple[float, str]:
        began = time.process_time()
        found = function(k)
        return time.process_time() - began, found

    return timed


def _posture(arm: RobotArm, seed: int, k: int) -> str:
    found = best_posture(arm, Search(seed=seed + k))
    sigma = found.assessment.worst_case_sigma
    return f"σ {sigma:.9f} from {found.starts} starts"


def _way(arm: RobotArm) -> ToolPath:
    """Return a path of three poses in front of the Panda."""
    home = np.array(_HOME_RAD)
    origin, _ = arm.chain.tip_at(home[:, None])
    away = np.array(_AWAY_M)
    quaternion = [[1.0, 0.0, 0.0, 0.0]] * len(away)  # (x, y, z, w): half a turn about x
    return ToolPath(origin[:, 0] + away, np.array(quaternion))


def _path(robot: Robot, way: ToolPath, seed: int) -> str:
    plan = lj.path(robot, way, samples=_SAMPLES, seed=seed)
    alone = f"{plan.best_of_samples:.2f} % if each sample is chosen alone"
    return f"{plan.planned.share:.2f} % of failures survived, {alone}"


def _workspace(robot: Robot) -> str:
    found = lj.workspace(robot, voxel=_VOXEL_M)
    return repr(found).strip("<>")


def _process() -> tuple[float, str]:
    """Return the processor seconds of a command line with start of Python, and no words."""
    before = os.times()
    command = [sys.executable, "-m", "lockedjoint", "measure", str(_panda())]
    subprocess.run([*command, "--tip", "panda_hand"], check=True, capture_output=True)
    after = os.times()
    spent = after.children_user - before.children_user
    return spent + after.children_system - before.children_system, ""


def _quiet_ms(jacobians: float) -> float:
    """Return milliseconds on the quiet machine of what takes so many J."""
    return jacobians * QUIET_J_US / 1e3


def _measured(
    what: str,
    function: Callable[[int], tuple[float, str]],
    target: float,
    jacobian: Callable[[int], Any],
) -> SpeedRow:
    """Measure what takes long, with J before and after each time."""
    times, units, said = [], [], []
    for k in range(_REPEATS):
        units.append(_unit(jacobian))
        spent, found = function(k)
        times.append(1e3 * spent)
        said.append(found)
        units[-1] = (units[-1] + _unit(jacobian)) / 2
    ratios = [spent / unit for spent, unit in zip(times, units, strict=True)]
    return SpeedRow(
        what=what,
        least_ms=min(times),
        median_ms=median(times),
        in_jacobians=median(ratios),
        quiet_ms=_quiet_ms(min(ratios)),
        target_ms=target,
        verdict=_verdict(_quiet_ms(min(ratios)), target),
        found="; ".join(dict.fromkeys(filter(None, said))),
    )


def _verdict(milliseconds: float, target: float) -> str:
    """Return whether a target is met; no word if there is none, NaN."""
    if not target > 0:
        return ""
    return "met" if milliseconds <= target else "missed"


def _unit(jacobian: Callable[[int], Any]) -> float:
    """Return what J takes now, in milliseconds: the least of some rounds."""
    times = []
    for _ in range(_UNIT_ROUNDS):
        began = time.process_time()
        for k in range(_CALLS_OF_J):
            jacobian(k)
        times.append(1e3 * (time.process_time() - began) / _CALLS_OF_J)
    return min(times)


STUDY = study_of(
    __file__,
    compute,
    SpeedRow,
    title="processor time of what robots are asked for, in pinocchio's Jacobians",
    takes="five minutes, packages of robots, and a machine that does nothing else",
    long=True,
)

if __name__ == "__main__":
    main(STUDY, __file__)
