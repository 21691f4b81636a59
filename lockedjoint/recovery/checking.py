"""A check of recoveries, with forward kinematics that the search for them does not use.

It walks the robot's tree joint by joint, in homogeneous matrices. What a goal, a trajectory and
the clearance of links are, is defined once, for the search and for this check.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import BPoly, CubicHermiteSpline
from scipy.spatial.transform import Rotation

from lockedjoint.clearance.link_clearance import LinkClearance
from lockedjoint.clearance.motion import ClearMotion
from lockedjoint.kinematics.hanging import HangingJoint
from lockedjoint.kinematics.tree import RobotTree, TreeJoint
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.paths.timing import TimedTrajectory
from lockedjoint.recovery.failures import Damage, Locked, ReducedRange, ReducedSpeed
from lockedjoint.recovery.goal import REACHED, ToolGoal

# Rounding may pass limits of speed by this share, and positions by so many radians or metres.
_ROUNDING = 1e-6
# A goal may be missed by this much: what recovery asks for, and rounding.
_NEAR_M_OR_RAD = 10 * REACHED
#: A joint that swings freely may be so far from where it hangs.
SWING_RAD = 5e-3
# Limits are looked at in so many places from one point to the next.
_PARTS = 4
# The simulation of a joint that swings has steps of this length.
_STEP_S = 2e-3
# The simulation goes on this long after the end of the trajectory.
_AFTER_S = 3.0
# A longer trajectory is not simulated.
_LONGEST_S = 2000.0


def tip_pose(arm: Damage, positions: Mapping[str, float]) -> tuple[FloatArray, FloatArray]:
    """Return position (3,) and rotation (3, 3) of the tip at positions of joints by name."""
    chain = arm.healthy
    known = {**dict(chain.immobile), **dict(chain.locked_at), **positions}
    base, tip = (_pose(arm.robot.tree, link, known) for link in (chain.base, chain.tip))
    pose = np.linalg.inv(base) @ tip
    return pose[:3, :3] @ np.array(arm.robot.point) + pose[:3, 3], pose[:3, :3]


def faults(
    arm: Damage,
    start: FloatArray,
    goal: ToolGoal,
    run: TimedTrajectory,
    clearance: LinkClearance | None = None,
) -> list[str]:
    """Return what is wrong with a trajectory of the whole arm, in sentences; empty if nothing.

    It starts at the configuration (n,) of the healthy arm, ends at the goal at rest, keeps the
    limits of positions and speeds that are left, also between its points, leaves locked joints
    where they are, moves as its velocities say, links keep their distance at its points and on
    straight ways of the joints between them, and a joint that swings freely stays with it.
    """
    wrong: list[str] = []
    q, speeds = run.positions, run.velocities
    if not (np.all(np.isfinite(q)) and np.all(np.diff(run.times) > 0)):
        wrong.append("positions or times are no rising row of finite numbers")
        return wrong
    if np.max(np.abs(q[0] - start)) > _ROUNDING:
        wrong.append("it does not start where the arm is")
    if max(np.max(np.abs(speeds[0])), np.max(np.abs(speeds[-1]))) > 1e-3:
        wrong.append("it does not start and end at rest")
    steps = np.diff(run.times)[:, None]
    mean = (speeds[1:] + speeds[:-1]) / 2 * steps
    bound = np.maximum(1e-4, 0.2 * np.abs(mean)) + np.abs(run.accelerations[1:]) * steps**2
    if np.any(np.abs(np.diff(q, axis=0) - mean) > bound):
        wrong.append("positions do not follow from velocities")
    between = _between(run)
    for k, joint in enumerate(arm.healthy.joints):
        lower, upper, fastest = joint.lower, joint.upper, joint.velocity
        for failure in (each for each in arm.failures if each.joint == joint.name):
            if isinstance(failure, Locked) and failure.at is not None:
                lower = upper = failure.at
            elif isinstance(failure, ReducedRange):
                lower, upper = max(lower, failure.lower), min(upper, failure.upper)
            elif isinstance(failure, ReducedSpeed):
                fastest = fastest * failure.share
        places = between[0][:, k]
        if np.any(places < lower - _ROUNDING) or np.any(places > upper + _ROUNDING):
            wrong.append(f"{joint.name} leaves what the failures leave of its range")
        if np.any(np.abs(between[1][:, k]) > fastest * (1 + _ROUNDING)):
            wrong.append(f"{joint.name} is faster than it can be")
    position, rotation = tip_pose(arm, dict(zip(arm.healthy.names, q[-1], strict=True)))
    far = goal.distances(goal.missing(position[:, None], rotation[:, :, None]))
    if max(float(each[0]) for each in far) > _NEAR_M_OR_RAD:
        wrong.append("it does not end at the goal")
    if clearance is not None:
        moved = q[:, arm.free].T
        kept = ClearMotion(clearance, arm.chain, kept=True).clear(moved[:, :-1], moved[:, 1:])
        if not kept.all():
            when = run.times[np.argmin(kept)]
            wrong.append(f"links are nearer than they may be at {when:.3g} s")
    swung = 0.0 if arm.hanging is None else swing(arm, arm.hanging, run)
    if not swung <= SWING_RAD:
        wrong.append(f"a joint swings by {swung:.2g} rad")
    return wrong


def _between(run: TimedTrajectory) -> tuple[FloatArray, FloatArray]:
    """Return positions and velocities (N', n) at the points of a trajectory and between them.

    As controllers go from point to point: by polynomials of degree five.
    """
    states = np.stack([run.positions, run.velocities, run.accelerations], axis=1)
    curve = BPoly.from_derivatives(run.times, states)
    parts = np.linspace(0.0, 1.0, _PARTS, endpoint=False)[:, None]
    inside = run.times[:-1] + parts * np.diff(run.times)
    times = np.append(inside.T.ravel(), run.times[-1])
    return curve(times), curve(times, 1)


def swing(arm: Damage, hanging: HangingJoint, run: TimedTrajectory) -> float:
    """Return by how much a joint that swings freely leaves a trajectory, radians.

    It begins there at rest, and moves without friction as gravity, and the other joints, make
    it: by its equation of motion, in steps of time, until a while after the end. Infinity if
    the trajectory is too long for that.
    """
    end, own, largest = run.duration + _AFTER_S, hanging.own, 0.0
    if end > _LONGEST_S:
        return np.inf
    q, rates = run.positions[:, arm.free], run.velocities[:, arm.free]
    both = np.vstack([q, q[-1]]), np.vstack([rates, 0 * rates[-1]])
    spline, times = CubicHermiteSpline([*run.times, end], *both), np.arange(0.0, end, _STEP_S)
    states = [spline(times, derivative) for derivative in range(3)]
    angle, speed = float(states[0][0, own]), 0.0
    for here, rate, acceleration in zip(*states, strict=True):
        largest = max(largest, abs(angle - here[own]))
        here[own], rate[own] = angle, speed
        speed += _STEP_S * hanging.falls(here, rate, acceleration)
        angle += _STEP_S * speed
    return largest


def _pose(tree: RobotTree, link: str, positions: Mapping[str, float]) -> FloatArray:
    """Return where a link is relative to the root, 4×4."""
    pose = np.eye(4)
    for joint in tree.path(link):
        pose = pose @ np.asarray(joint.origin)
        if joint.type != "fixed":
            pose = pose @ _moved(joint, _value(tree, joint, positions))
    return pose


def _value(tree: RobotTree, joint: TreeJoint, positions: Mapping[str, float]) -> float:
    """Return where a joint is, also if it follows others; before both links, anywhere."""
    if joint.mimic is None:
        return positions.get(joint.name, 0.0)
    driver = next(other for other in tree.joints if other.name == joint.mimic.joint)
    return joint.mimic.multiplier * _value(tree, driver, positions) + joint.mimic.offset


def _moved(joint: TreeJoint, value: float) -> FloatArray:
    """Return the motion of a joint, 4×4."""
    pose = np.eye(4)
    if joint.type == "prismatic":
        pose[:3, 3] = value * joint.axis
    else:
        pose[:3, :3] = Rotation.from_rotvec(value * joint.axis).as_matrix()
    return pose
