"""What a controller has at hand before a failure: for each joint and sample, how to go on."""

from __future__ import annotations

import io

import numpy as np

from formulations.clearance.link_clearance import LinkClearance
from formulations.clearance.motion import ClearMotion
from formulations.kinematics.forward import Kinematics
from formulations.paths.plan import PathPlan
from formulations.paths.survival import survivors
from formulations.robots.robot_arm import RobotArm


def continuations(
    arm: RobotArm, plan: PathPlan, seed: int = 0, clearance: LinkClearance | None = None
) -> bytes:
    """Return how a planned path is finished after each failure that it survives, as NPZ.

    With the seed and the clearance of the plan's search. Arrays are `joints`, names of the n
    joints; `times`, seconds of the N samples; and `configurations`, radians or metres, shape
    (n, N, N, n): if joint f locks at sample k, the arm is at ``configurations[f, k, i]`` at
    sample i ≥ k; NaN before, and where f is not survived. At i = k it is where the arm was, or
    another point of the self-motion of that pose, to which it has to move first.
    """
    q = plan.planned.configurations
    count, n = q.shape
    tracks = np.full((n, count, count, n), np.nan)
    kinematics = Kinematics(arm.chain, arm.task.rows)
    allowed = None if clearance is None else ClearMotion(clearance, arm.chain).clear
    given = kinematics, q.T, np.arange(count), plan.poses, seed, allowed
    survivors(*given, tracks=tracks)
    file = io.BytesIO()
    names = np.array(plan.joints)
    np.savez_compressed(file, joints=names, times=plan.times, configurations=tracks)
    return file.getvalue()
