"""The polish of a trajectory: one sparse nonlinear program for all its configurations.

It makes the trajectory smooth, and draws each joint whose failure is fatal to the nearest
position from which the path can be finished.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from formulations.kinematics.chain import Chain, tip_pose
from formulations.kinematics.forward import Kinematics
from formulations.paths.nodes import Nodes
from formulations.paths.plan import Trajectory
from formulations.paths.survival import JUMP, Poses
from formulations.robots.robot_arm import RobotArm
from nlp.arrays import FloatArray
from nlp.problem import Constraint, Problem
from nlp.solution import ACCEPTABLE, LIMIT, SUCCESS
from nlp.solver import Solver

_OPTIONS = {"max_iter": 60, "tol": 1e-7, "acceptable_tol": 1e-5, "acceptable_iter": 5}
# What a squared radian off the target counts: where a failure can be survived, and elsewhere.
_DRAWN, _KEPT = 1.0, 0.1


def transcription(
    chain: Chain,
    poses: Poses,
    rows: Sequence[int],
    most: FloatArray,
    target: FloatArray,
    weight: FloatArray,
    smoothness: float,
) -> Problem:
    """State the polish of a trajectory: all configurations at once.

    ::

        minimise    Σ weight·(q − target)² + smoothness·Σ |q(k+1) − 2q(k) + q(k−1)|²
        subject to  pose of q(k) = pose k,  |q(k+1) − q(k)| <= most(k),  limits

    Parameters
    ----------
    chain
        The joints.
    poses
        One for each sample.
    rows
        The directions that count; see `Kinematics`.
    most
        Largest motion of each joint between two samples, shape (N - 1, n).
    target, weight
        Where each joint should be, and how much that matters, shape (N, n).
    smoothness
        How much smoothness matters.
    """
    count, size = target.shape
    one = ca.SX.sym("q", size)
    origin, turn = tip_pose(chain, one)
    pose = ca.Function("pose", [one], [origin, turn])
    q = ca.SX.sym("q", size, count)
    off = []
    for k in range(count):
        position, rotated = pose(q[:, k])
        product = rotated @ ca.DM(poses.rotations[k].T)
        turned = ca.inv_skew((product - product.T) / 2)
        off.append(ca.vertcat(position - poses.positions[k], turned)[list(rows)])
    bend = q[:, 2:] - 2 * q[:, 1:-1] + q[:, :-2]
    objective = ca.sumsqr(ca.DM(np.sqrt(weight.T)) * (q - ca.DM(target.T)))
    blocks = [Constraint("pose", ca.vertcat(*off), 0.0, 0.0)]
    finite = np.isfinite(most)
    if np.any(finite):
        steps = ca.vec(q[:, 1:] - q[:, :-1])
        limited = np.flatnonzero(finite.ravel())
        bound = most.ravel()[limited] * 0.999
        blocks.append(Constraint("speed", steps[limited.tolist()], -bound, bound))
    lower, upper = chain.limits
    return Problem(
        name="path",
        variables=ca.vec(q),
        objective=objective + smoothness * ca.sumsqr(bend),
        constraints=tuple(blocks),
        lower=np.tile(lower, count),
        upper=np.tile(upper, count),
    )


def polished(
    arm: RobotArm,
    poses: Poses,
    most: FloatArray,
    found: Trajectory,
    nodes: Nodes,
    smoothness: float,
) -> tuple[str, FloatArray | None]:
    """Solve the nonlinear program from a trajectory.

    Parameters
    ----------
    arm
        The robot and the directions that count.
    poses, most, smoothness
        As of `transcription`.
    found
        The trajectory to begin with.
    nodes
        Where joints are drawn to; see `targets`.

    Returns
    -------
    str
        Ipopt's return status.
    numpy.ndarray or None
        Configurations, shape (N, n); None if they leave the path or are too fast.
    """
    q = found.configurations
    rows = arm.task.rows
    problem = transcription(arm.chain, poses, rows, most, *targets(found, nodes), smoothness)
    solution = Solver(problem, _OPTIONS).solve(q.ravel())
    status = solution.status.return_status
    if status not in (SUCCESS, ACCEPTABLE, LIMIT):
        return status, None
    moved = np.clip(solution.variables.reshape(q.shape), *arm.bounds)
    kinematics = Kinematics(arm.chain, rows)
    origin, turn = kinematics.forward(moved.T, jacobian=False)
    wanted = poses.positions.T, np.moveaxis(poses.rotations, 0, 2)
    off = kinematics.error(origin, turn, *wanted)
    slow = np.all(np.abs(np.diff(moved, axis=0)) <= most + 1e-9)
    return status, moved if slow and np.max(np.abs(off)) < 1e-5 else None


def targets(found: Trajectory, nodes: Nodes) -> tuple[FloatArray, FloatArray]:
    """Return where each joint should be, and how much that matters, both (N, n).

    It should stay where it is, or where its failure is fatal go to the nearest node at which it
    is not.
    """
    target = found.configurations.copy()
    weight = np.full(target.shape, _KEPT)
    for k, f in zip(*np.nonzero(~found.survives), strict=True):
        good = nodes.survives(k)[f]
        if np.any(good):
            near = nodes.at(k)[:, good]
            gaps = np.max(np.abs(near - target[k][:, None]), axis=0)
            at = int(np.argmin(gaps))
            if gaps[at] < JUMP:
                target[k, f], weight[k, f] = near[f, at], _DRAWN
    return target, weight
