"""A failure while a simulated arm follows a path: noticed, and recovered from, or not."""

import time
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from formulations.paths.waypoints import ToolPath
from formulations.recovery.failures import Locked
from formulations.recovery.recover import recover
from nlp.arrays import FloatArray
from results.demonstration.simulated_arm import STEP, SimulatedArm
from results.paths.paths import StudyPath

# Seconds in which the arm brakes, and for which it stands then.
_BRAKES, _STANDS = 0.15, 0.2
# The tool is back on the path this nearly: metres, and a part of a quaternion.
_BACK = 1e-4


@dataclass(frozen=True, eq=False)
class Episode:
    """A failure as it was simulated: `joints` are positions at every step, shape (N, n).

    At the steps `ends` the joint locks, this is noticed, the arm stands, is back on the path,
    and ends. The verdict is that of `recover`, which took so many seconds of the processor,
    or ``"unnoticed"``.
    """

    verdict: str
    recover_seconds: float
    ends: tuple[int, ...]
    joints: FloatArray


def play(
    declared: StudyPath, seconds: float, samples: FloatArray, joint: int, moment: float
) -> Episode:
    """Run along a path in some seconds, through samples (N, n), while a joint locks."""
    (healthy, path), robot = declared.stated(), declared.robot
    times, poses, _ = path.sampled(len(samples), seconds)
    share = np.arange(0.0, seconds, STEP) / seconds
    clock = seconds * share**3 * (10 - 15 * share + 6 * share**2)  # from rest to rest
    planned = CubicSpline(times, samples)(clock)
    arm, fails = SimulatedArm(robot), round(moment / STEP)
    arm.data.qpos[:] = planned[0]
    found = arm.follow(planned, (joint, fails))
    noticed = len(arm.joints)
    if found is None:
        return Episode("unnoticed", np.nan, (fails, *[noticed] * 4), np.array(arm.joints))
    speed = (planned[noticed] - planned[noticed - 1]) / STEP
    brakes = np.minimum(np.arange(0.0, _BRAKES + _STANDS, STEP), _BRAKES)[:, None]
    standing = planned[noticed] + speed * (brakes - brakes**2 / (2 * _BRAKES))
    standing[:, found] = arm.data.qpos[found]
    arm.follow(standing)
    stands = back = len(arm.joints)
    standing[-1, found] = arm.data.qpos[found]
    start = np.clip(standing[-1], *healthy.chain.limits)
    # From the last sample that was passed: nothing is left out.
    passed = int(np.searchsorted(times, clock[noticed])) - 1
    turns = Rotation.from_matrix(poses.rotations[passed:]).as_quat()
    rest, began = ToolPath(poses.positions[passed:], turns), time.process_time()
    failure = Locked(healthy.chain.names[found], float(start[found]))
    answer = recover(robot.path, start, [failure], rest, tip=robot.tip)
    took, run = time.process_time() - began, answer.trajectory
    if run is not None:
        off = np.linalg.norm(run.tool[:, :3] - rest.positions[0], axis=1)
        off += 1 - np.abs(run.tool[:, 3:] @ turns[0])
        back += round(float(run.times[np.argmax(off < _BACK)]) / STEP)
        grid = np.arange(0.0, run.duration + _STANDS, STEP)
        arm.follow(CubicSpline(run.times, run.positions)(np.minimum(grid, run.duration)))
    ends = (fails, noticed, stands, back, len(arm.joints))
    return Episode(answer.verdict, took, ends, np.array(arm.joints))
