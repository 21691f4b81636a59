"""The polish of a trajectory: one sparse nonlinear program for all its configurations.

It makes the trajectory smooth, and draws each joint whose failure is critical to the nearest
position from which the path can be finished.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from formulations.kinematics.chain import Chain
from formulations.kinematics.forward import Kinematics, tip_kinematics
from formulations.paths.nodes import Nodes
from formulations.paths.plan import Trajectory
from formulations.paths.survival import JUMP
from formulations.paths.waypoints import Poses
from formulations.robots.robot_arm import RobotArm
from nlp.arrays import FloatArray
from nlp.problem import ACCEPTABLE, LIMIT, SUCCESS, Constraint, Problem
from nlp.solver import solve

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

    ``rows`` are the directions that count, see `Kinematics`; ``most`` is the largest motion of
    each joint between two samples, shape (N - 1, n); ``target`` is where each joint should be,
    and ``weight`` how much that matters, shape (N, n).
    """
    count, size = target.shape
    symbols = ca.SX.sym("q", size)
    pose = ca.Function("pose", [symbols], [*tip_kinematics(chain, symbols)[1:]])
    q = ca.SX.sym("q", size, count)
    off = []
    for k in range(count):
        position, rotation = pose(q[:, k])
        product = rotation @ ca.DM(poses.rotations[k].T)
        angles = ca.inv_skew((product - product.T) / 2)
        off.append(ca.vertcat(position - poses.positions[k], angles)[list(rows)])
    bend = q[:, 2:] - 2 * q[:, 1:-1] + q[:, :-2]
    objective = ca.sumsqr(ca.DM(np.sqrt(weight.T)) * (q - ca.DM(target.T)))
    blocks = [Constraint("pose", ca.vertcat(*off), 0.0, 0.0)]
    limited = np.flatnonzero(np.isfinite(most.ravel()))
    if limited.size:
        bound = most.ravel()[limited] * 0.999
        steps = ca.vec(q[:, 1:] - q[:, :-1])[limited.tolist()]
        blocks.append(Constraint("speed", steps, -bound, bound))
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
    trajectory: Trajectory,
    nodes: Nodes,
    smoothness: float,
) -> tuple[str, FloatArray | None]:
    """Solve the nonlinear program from a trajectory.

    Each joint whose failure is critical is drawn to the nearest node at which it is not.

    Returns
    -------
    str
        Ipopt's return status.
    numpy.ndarray or None
        Configurations, shape (N, n); None if they leave the path or are too fast.
    """
    q, rows = trajectory.configurations, arm.task.rows
    problem = transcription(
        arm.chain, poses, rows, most, *_targets(trajectory, nodes), smoothness
    )
    solution = solve(problem, q.ravel(), _OPTIONS)
    status = solution.status.return_status
    if status not in (SUCCESS, ACCEPTABLE, LIMIT):
        return status, None
    moved = np.clip(solution.variables.reshape(q.shape), *arm.bounds)
    kinematics = Kinematics(arm.chain, rows)
    origin, rotation = kinematics.forward(moved.T, jacobian=False)
    off = kinematics.error(origin, rotation, *poses.at(np.arange(len(poses))))
    slow = np.all(np.abs(np.diff(moved, axis=0)) <= most + 1e-9)
    return status, moved if slow and np.max(np.abs(off)) < 1e-5 else None


def _targets(trajectory: Trajectory, nodes: Nodes) -> tuple[FloatArray, FloatArray]:
    """Return where each joint should be, and how much that matters, both (N, n)."""
    target = trajectory.configurations.copy()
    weight = np.full(target.shape, _KEPT)
    for k, f in zip(*np.nonzero(~trajectory.survives), strict=True):
        near = nodes.at(k)[:, nodes.survives(k)[f]]
        off = nodes.apart(near, target[k][:, None])
        gaps = np.max(np.abs(off), axis=0)
        if np.min(gaps, initial=JUMP) < JUMP:
            target[k, f] += off[f, np.argmin(gaps)]
            weight[k, f] = _DRAWN
    return target, weight
