"""What is found for a path: a joint trajectory, its polish, and which joints may lock along it.

The polish is one sparse nonlinear program for all configurations of a trajectory. It makes it
smooth, and draws each joint whose failure is critical to the nearest position from which the
path can be finished.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import casadi as ca
import numpy as np

from formulations.clearance.link_clearance import Closest
from formulations.kinematics.chain import Chain
from formulations.kinematics.forward import tip_kinematics
from formulations.kinematics.link_chain import BoolArray, IntArray
from formulations.paths.following import JUMP
from formulations.paths.nodes import Nodes
from formulations.paths.waypoints import Poses
from formulations.robots.robot_arm import RobotArm
from nlp.arrays import FloatArray
from nlp.problem import ACCEPTABLE, LIMIT, SUCCESS, Constraint, Problem
from nlp.solver import solve

_OPTIONS = {"max_iter": 60, "tol": 1e-7, "acceptable_tol": 1e-5, "acceptable_iter": 5}
# What a squared radian off the target counts: where a failure can be survived, and elsewhere.
_DRAWN, _KEPT = 1.0, 0.1


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A joint trajectory, and what is left of the path after each joint's failure.

    Attributes
    ----------
    configurations
        Radians or metres, shape (N, n).
    ends
        The last sample that is reached if joint f locks at sample k, shape (N, n).
    sigma
        Worst-case singular value at each sample, in units of the characteristic length.
    """

    configurations: FloatArray
    ends: IntArray
    sigma: FloatArray

    @property
    def survives(self) -> BoolArray:
        """Whether the path can be finished after joint f locks at sample k, shape (N, n)."""
        return np.asarray(self.ends == len(self.ends) - 1)

    @property
    def share(self) -> float:
        """Percentage of all pairs of joint and sample that survive."""
        return 100 * float(np.mean(self.survives))

    @property
    def roughness(self) -> float:
        """Root of the sum of squared second differences, radians or metres."""
        return float(np.linalg.norm(np.diff(self.configurations, 2, axis=0)))

    def to_dict(self, times: FloatArray) -> dict[str, object]:
        """Return plain values, with the samples' times in seconds, shape (N,)."""
        return {
            "configurations": self.configurations.tolist(),
            "sigma": self.sigma.tolist(),
            "survivors": self.survives.sum(axis=1).tolist(),
            "ends_at": times[self.ends].tolist(),
        }


@dataclass(frozen=True, eq=False)
class PathPlan:
    """What was found for a path.

    Attributes
    ----------
    joints
        Names.
    times, places
        Of the samples: seconds, and where they are, counted in waypoints from 1.
    poses
        Of the samples.
    planned
        The trajectory found.
    minimum_norm
        The trajectory of least joint motion at every sample that completes the path, of those
        from random starts the one that begins nearest the middle of the joints' ranges; None
        if all of them end at a limit.
    best_of_samples
        Percentage that survives if at every sample the best of all sampled configurations is
        taken, no matter whether a trajectory passes through all of them. It is no bound: other
        samples may have better ones.
    joint_best_of_samples
        The same for each joint alone, with the configurations that suit it best.
    unrecoverable_until
        For each joint the last sample at which no position of it is in its range at all later
        samples: a failure up to then is critical whatever one does. -1 if there is none.
    nodes
        How many configurations were tested.
    polished
        Whether the polish was kept.
    statuses
        Ipopt's return statuses of the polish.
    deviation
        Largest distance of the tool from the path midway between samples, in metres.
    speed
        Largest joint speed, as a share of its limit; None if no joint has a limit of speed.
    closest
        Where links have to stay apart: the nearest two at a sample. Between samples none touch.
    complete
        Whether the search ended; if not, the user interrupted it.
    """

    joints: tuple[str, ...]
    times: FloatArray
    places: FloatArray
    poses: Poses
    planned: Trajectory
    minimum_norm: Trajectory | None
    best_of_samples: float
    joint_best_of_samples: FloatArray
    unrecoverable_until: IntArray
    nodes: int
    polished: bool
    statuses: tuple[str, ...]
    deviation: float
    speed: float | None
    closest: Closest | None = None
    complete: bool = True

    def __repr__(self) -> str:
        """Say in one line how many failures are survived."""
        base = self.minimum_norm
        beside = f", {base.share:.1f} % at minimum norm" if base else ""
        survived = f"{self.planned.share:.1f} % of failures survived"
        return f"<PathPlan: {survived}{beside}, {len(self.times)} samples>"

    def joint_rows(self) -> list[dict[str, object]]:
        """Return a line for each joint: shares that survive, and where the others end."""
        rows: list[dict[str, object]] = []
        base = self.minimum_norm
        for f, name in enumerate(self.joints):
            survives, ends = self.planned.survives[:, f], self.planned.ends[:, f]
            lost, until = self.times[ends[~survives]], int(self.unrecoverable_until[f])
            rows.append(
                {
                    "joint": name,
                    "percent": 100 * float(np.mean(survives)),
                    "minimum_norm_percent": base and 100 * float(np.mean(base.survives[:, f])),
                    "best_of_samples_percent": float(self.joint_best_of_samples[f]),
                    "unrecoverable_until": float(self.times[until]) if until >= 0 else None,
                    "others_end": [float(lost.min()), float(lost.max())] if lost.size else None,
                }
            )
        return rows

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        base = self.minimum_norm
        return {
            "percent": self.planned.share,
            "minimum_norm_percent": base and base.share,
            "best_of_samples_percent": self.best_of_samples,
            "least_sigma": float(np.min(self.planned.sigma)),
            "minimum_norm_least_sigma": base and float(np.min(base.sigma)),
            "largest_speed": self.speed,
            "deviation": self.deviation,
            "collisions": "not checked" if self.closest is None else "none",
            "closest": self.closest and asdict(self.closest),
            "polished": self.polished,
            "status_counts": dict(Counter(self.statuses)),
            "configurations_tested": self.nodes,
            "complete": self.complete,
            "joints": self.joint_rows(),
            "times": self.times.tolist(),
            "places": self.places.tolist(),
            "trajectory": self.planned.to_dict(self.times),
            "minimum_norm": base and base.to_dict(self.times),
        }

    def csv_lines(self) -> list[list[object]]:
        """Return the trajectory as lines of a table, the first with headings."""
        ends = [f"{name} locked ends at" for name in self.joints]
        way = self.planned
        columns = (self.times, *way.configurations.T, way.sigma, way.survives.sum(axis=1))
        lines = zip(*(x.tolist() for x in (*columns, *self.times[way.ends].T)), strict=True)
        return [["t", *self.joints, "sigma", "survivors", *ends], *map(list, lines)]


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

    Returns Ipopt's return status, and configurations, shape (N, n); None if they leave the path
    or are too fast.
    """
    q = trajectory.configurations
    target, weight = _targets(trajectory, nodes)
    problem = transcription(arm.chain, poses, arm.task.rows, most, target, weight, smoothness)
    solution = solve(problem, q.ravel(), _OPTIONS)
    status = solution.status.return_status
    if status not in (SUCCESS, ACCEPTABLE, LIMIT):
        return status, None
    moved = np.clip(solution.variables.reshape(q.shape), *arm.bounds)
    origin, rotation = nodes.kinematics.forward(moved.T, jacobian=False)
    off = nodes.kinematics.error(origin, rotation, *poses.at(np.arange(len(poses))))
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
