"""The joint trajectory from which a path can most often be finished after a joint locks.

1. Candidate tracks: configurations at several samples of the path, found by inverse kinematics
   from random starts, follow the path both ways. Some stay near minimum norm, some drift
   towards the middle of the joints' ranges.
2. Every configuration of every track is a node. Its score is the number of joints that may lock
   there, by the test in `survival`.
3. Dynamic programming over the nodes: the sequence of the largest total score, with joint
   speeds within their limits, and little motion. Then again with tracks beside it.
4. A polish: one sparse nonlinear program for the whole trajectory. It makes the trajectory
   smooth, and draws each joint whose failure is fatal to the nearest position from which the
   path can be finished. What it gives is tested again, and kept only if the share that
   survives rises, or if it stays and the trajectory is smoother.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from formulations import measures
from formulations.robots.chain import Chain, listed, nearest, tip_pose
from formulations.robots.robot_arm import RobotArm
from formulations.robots.survival import (
    JUMP,
    BoolArray,
    Kinematics,
    Poses,
    follow,
    on_path,
    survivors,
)
from formulations.robots.waypoints import ToolPath, place_name
from nlp.arrays import FloatArray
from nlp.errors import InputError
from nlp.interrupts import deferred_interrupt, interrupt_answered
from nlp.problem import Constraint, Problem
from nlp.solution import ACCEPTABLE, LIMIT, SUCCESS
from nlp.solver import Solver

IntArray = npt.NDArray[np.intp]
# Random starts of the inverse kinematics where the path may be out of reach.
_REACH = 2000
# Samples at which tracks begin.
_ANCHORS = 5
# What one squared radian of motion between two samples costs, in joints that survive.
_MOTION = 10.0
# Speeds stay below this share of their limits until the polish.
_SPEED = 0.98
# Shares that differ by less, in points, are the same.
_SAME = 1e-9
# The polish: weights of smoothness, against 1 for each squared radian off the target.
_SMOOTHNESS = (0.3, 3.0, 30.0)
_POLISH = {"max_iter": 60, "tol": 1e-7, "acceptable_tol": 1e-5, "acceptable_iter": 5}


@dataclass(frozen=True)
class PathSearch:
    """How to look for a trajectory.

    Attributes
    ----------
    samples
        Samples of the path, every waypoint among them.
    duration
        Seconds for the whole path, where the waypoints have no times.
    tracks
        Candidate tracks.
    rounds
        How often tracks beside the best sequence are added.
    seed
        Of the random starts.
    polish
        Whether the nonlinear program is solved.
    progress
        Is called with what is being done.
    """

    samples: int = 60
    duration: float = 10.0
    tracks: int = 80
    rounds: int = 2
    seed: int = 0
    polish: bool = True
    progress: Callable[[str], None] = lambda _: None


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
    ceiling
        Percentage that survives if at every sample the best of all sampled configurations is
        taken, no matter whether a trajectory passes through all of them.
    joint_ceiling
        The same for each joint alone, with the configurations that suit it best.
    hopeless_until
        For each joint the last sample at which no position of it is in its range at all later
        samples: a failure up to then is fatal whatever one does. -1 if there is none.
    nodes
        How many configurations were tested.
    polished
        Whether the polish was kept.
    statuses
        Ipopt's return statuses of the polish.
    deviation
        Largest distance of the tool from the path midway between samples, in metres.
    speed
        Largest joint speed, as a share of its limit; 0 if there are no limits.
    complete
        Whether the search ended; if not, the user interrupted it.
    """

    joints: tuple[str, ...]
    times: FloatArray
    places: FloatArray
    poses: Poses
    planned: Trajectory
    minimum_norm: Trajectory | None
    ceiling: float
    joint_ceiling: FloatArray
    hopeless_until: IntArray
    nodes: int
    polished: bool
    statuses: tuple[str, ...]
    deviation: float
    speed: float
    complete: bool = True

    def joint_rows(self) -> list[dict[str, object]]:
        """Return a line for each joint: shares that survive, and where the others end."""
        rows: list[dict[str, object]] = []
        for f, name in enumerate(self.joints):
            kept, ends = self.planned.survives[:, f], self.planned.ends[:, f]
            lost = self.times[ends[~kept]]
            hopeless = int(self.hopeless_until[f])
            base = self.minimum_norm
            rows.append(
                {
                    "joint": name,
                    "percent": 100 * float(np.mean(kept)),
                    "minimum_norm_percent": base and 100 * float(np.mean(base.survives[:, f])),
                    "ceiling_percent": float(self.joint_ceiling[f]),
                    "hopeless_until": float(self.times[hopeless]) if hopeless >= 0 else None,
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
            "ceiling_percent": self.ceiling,
            "least_sigma": float(np.min(self.planned.sigma)),
            "minimum_norm_least_sigma": base and float(np.min(base.sigma)),
            "largest_speed": self.speed,
            "deviation": self.deviation,
            "polished": self.polished,
            "status_counts": {one: self.statuses.count(one) for one in set(self.statuses)},
            "configurations_tested": self.nodes,
            "complete": self.complete,
            "joints": self.joint_rows(),
            "times": self.times.tolist(),
            "places": self.places.tolist(),
            "trajectory": _plain(self.planned, self.times),
            "minimum_norm": base and _plain(base, self.times),
        }

    def csv_lines(self) -> list[list[object]]:
        """Return the trajectory as lines of a table, the first with headings."""
        head: list[object] = ["t", *self.joints, "sigma", "survivors"]
        head += [f"{name} locked ends at" for name in self.joints]
        found = self.planned
        return [head] + [
            [
                *(time, *point.tolist(), sigma, int(np.sum(kept))),
                *self.times[ends].tolist(),
            ]
            for time, point, sigma, kept, ends in zip(
                self.times.tolist(),
                found.configurations,
                found.sigma.tolist(),
                found.survives,
                found.ends,
                strict=True,
            )
        ]


def _plain(one: Trajectory, times: FloatArray) -> dict[str, object]:
    return {
        "configurations": one.configurations.tolist(),
        "sigma": one.sigma.tolist(),
        "survivors": one.survives.sum(axis=1).tolist(),
        "ends_at": times[one.ends].tolist(),
    }


def narrowed(chain: Chain, limits: Mapping[str, tuple[float, float]]) -> Chain:
    """Return the chain with narrower limits of some joints.

    Raises
    ------
    InputError
        If a joint is unknown, or its limits contradict each other or those of the robot.
    """
    for name, (lower, upper) in limits.items():
        if name not in chain.names:
            allowed = f"one of {listed(chain.names)}{nearest(name, chain.names)}"
            raise InputError("joint of --limits", name, allowed)
        joint = chain.joints[chain.names.index(name)]
        if not max(lower, joint.lower) < min(upper, joint.upper):
            allowed = (
                f"lower < upper, with room in the robot's [{joint.lower:g}, {joint.upper:g}]"
            )
            raise InputError(f"--limits of {name}", f"[{lower:g}, {upper:g}]", allowed)
    joints = tuple(
        replace(
            joint,
            lower=max(joint.lower, limits.get(joint.name, (-np.inf, 0))[0]),
            upper=min(joint.upper, limits.get(joint.name, (0, np.inf))[1]),
        )
        for joint in chain.joints
    )
    return replace(chain, joints=joints)


def plan_path(arm: RobotArm, path: ToolPath, search: PathSearch | None = None) -> PathPlan:
    """Search for the trajectory from which the path can most often be finished.

    Parameters
    ----------
    arm
        The robot, with the directions in which the path has to be kept, along the base's axes.
    path
        The path.
    search
        How to look.

    Raises
    ------
    KeyboardInterrupt
        If interrupted before a first trajectory was found.
    InputError
        If the task has orientations and the waypoints have none, a waypoint or the path
        between two is out of reach, or the limits of speed leave too little time.
    """
    search = search or PathSearch()
    task = arm.task
    if task.frame != "base" or not (path.has_orientation or max(task.rows) < 3):
        allowed = "linear directions along the base's axes; poses allow rotations too"
        raise InputError("task", f"{','.join(task.directions)} ({task.frame})", allowed)
    return _Planner(arm, path, search).plan()


def check_reach(arm: RobotArm, path: ToolPath) -> None:
    """Raise InputError if a waypoint is out of the arm's reach; see `plan_path`."""
    _Planner(arm, path, PathSearch()).check_reach()


class _Planner:
    """One search: the arm, the samples, and all nodes so far."""

    def __init__(self, arm: RobotArm, path: ToolPath, search: PathSearch) -> None:
        self.arm, self.search = arm, search
        self.times, self.poses, self.places = path.sampled(search.samples, search.duration)
        self.kinematics = Kinematics(arm.chain, arm.task.rows)
        self.rng = np.random.default_rng(search.seed)
        velocity = np.array([joint.velocity for joint in arm.chain.joints])
        #: Most motion between two samples, shape (N - 1, n).
        self.most = velocity * np.diff(self.times)[:, None]
        # Of each sample: nodes (n, B), and the last sample reached after each failure (n, B).
        self.nodes: list[list[FloatArray]] = [[] for _ in self.times]
        self.ends: list[list[IntArray]] = [[] for _ in self.times]

    def plan(self) -> PathPlan:
        search = self.search
        self.check_reach()
        search.progress("candidate tracks")
        base = self._candidates()
        search.progress("dynamic programming")
        best = self._sequence()
        found, statuses, polished, complete = None, [], False, True
        try:
            for _ in range(search.rounds):
                self._add_tracks(self._beside(best))
                best = self._sequence()
            self._add_scattered()
            found = self._measured(best)
            for weight in _SMOOTHNESS if search.polish else ():
                search.progress(f"polish, smoothness {weight:g}")
                status, moved = self._polished(found, weight)
                statuses.append(status)
                tried = found if moved is None else self._measured(moved)
                gain = tried.share - found.share
                if gain > _SAME or (gain > -_SAME and tried.roughness < found.roughness):
                    found, polished = tried, True
        except KeyboardInterrupt:  # the best sequence so far is an answer, too
            interrupt_answered()
            complete = False
        found = found or self._measured(best)
        return replace(self._report(found, base, statuses, polished), complete=complete)

    def check_reach(self) -> None:
        """Raise InputError if a waypoint is out of reach."""
        whole = np.flatnonzero(np.abs(self.places - np.round(self.places)) < 1e-9)
        for sample in whole:
            if not on_path(self.kinematics, self.poses, int(sample), 200, self.rng).shape[1]:
                again = on_path(self.kinematics, self.poses, int(sample), _REACH, self.rng)
                if not again.shape[1]:
                    self._refuse(int(sample))

    def _refuse(self, sample: int) -> None:
        where = place_name(float(self.places[sample]))
        shown = ", ".join(f"{one:.4g}" for one in self.poses.positions[sample])
        pose = "a pose" if self.kinematics.orientation else "a position"
        limits = "that the arm reaches within its joints' limits"
        raise InputError(where, f"out of reach at ({shown})", f"{pose} {limits}")

    def _candidates(self) -> FloatArray | None:
        """Add the first tracks; return the track of minimum norm, shape (N, n)."""
        last = len(self.times) - 1
        anchors = np.unique(np.linspace(0, last, _ANCHORS).astype(int))
        per_anchor = -(-self.search.tracks // len(anchors))
        base = None
        for anchor in anchors:
            found = on_path(self.kinematics, self.poses, int(anchor), 6 * per_anchor, self.rng)
            for part, centre in (
                (found[:, : (per_anchor + 1) // 2], 0.0),
                (found[:, (per_anchor + 1) // 2 : per_anchor], 0.05),
            ):
                ahead, _ = follow(self.kinematics, part, self.poses, int(anchor), centre=centre)
                back, _ = follow(
                    self.kinematics, part, self.poses, int(anchor), step=-1, centre=centre
                )
                ahead[:anchor] = back[:anchor]
                self._add_tracks(ahead)
            if anchor == 0 and found.shape[1]:
                base = self._minimum_norm(found)
        for sample in range(len(self.times)):
            if not self.nodes[sample]:
                extra = on_path(self.kinematics, self.poses, sample, _REACH, self.rng)
                if not extra.shape[1]:
                    self._refuse(sample)
                self._add({sample: extra[:, : self.search.tracks]})
        return base

    def _minimum_norm(self, starts: FloatArray) -> FloatArray | None:
        lower, upper = self.arm.bounds
        widths = np.where(np.isfinite(upper - lower), upper - lower, 2 * np.pi)
        off = (starts - self.arm.chain.mid_range[:, None]) / widths[:, None]
        order = np.argsort(np.sum(off**2, axis=0))
        track, last = follow(self.kinematics, starts[:, order], self.poses, 0)
        whole = np.flatnonzero(last == len(self.times) - 1)
        return track[:, :, whole[0]] if whole.size else None

    def _add_tracks(self, tracks: FloatArray) -> None:
        """Add tracks, shape (N, n, B), NaN where they have no configuration, and test them."""
        valid = np.isfinite(tracks[:, 0])
        samples, which = np.nonzero(valid)
        if not len(samples):
            return
        nodes = tracks[samples, :, which].T
        ends = survivors(self.kinematics, nodes, samples, self.poses, seed=self.search.seed)
        with deferred_interrupt():  # both or neither
            for sample in np.unique(samples):
                here = samples == sample
                self.nodes[sample].append(nodes[:, here])
                self.ends[sample].append(ends[:, here])

    def _add(self, found: Mapping[int, FloatArray]) -> None:
        """Add configurations at some samples, shape (n, B) at each."""
        most = max((one.shape[1] for one in found.values()), default=0)
        tracks = np.full((len(self.times), self.arm.size, most), np.nan)
        for sample, nodes in found.items():
            tracks[sample, :, : nodes.shape[1]] = nodes
        self._add_tracks(tracks)

    def _add_scattered(self) -> None:
        """Add configurations that no track led to: for the ceiling."""
        some = range(0, len(self.times), 2)
        self._add({k: on_path(self.kinematics, self.poses, k, 60, self.rng) for k in some})

    def _beside(self, best: FloatArray) -> FloatArray:
        """Return tracks beside a sequence: each is pushed the same way at all samples."""
        count = max(8, self.search.tracks // 4)
        push = self.rng.normal(size=(best.shape[1], count))
        push *= self.rng.uniform(0.02, 0.3, count) / np.linalg.norm(push, axis=0)
        tracks = np.full((*best.shape, count), np.nan)
        for sample, point in enumerate(best):
            start = np.clip(point[:, None] + push, self.kinematics.lower, self.kinematics.upper)
            q, reached = self.kinematics.reach(start, *self.poses.at(sample), iterations=12)
            tracks[sample] = np.where(reached, q, np.nan)
        tracks[:, :, 0] = best
        return tracks

    def _sequence(self) -> FloatArray:
        """Return the best sequence of nodes, shape (N, n), by dynamic programming."""
        final = len(self.times) - 1
        stacked = [np.concatenate(one, axis=1) for one in self.nodes]
        scores = [np.sum(np.concatenate(one, axis=1) == final, axis=0) for one in self.ends]
        value = scores[0].astype(float)
        chosen = []
        for k, (now, later) in enumerate(pairwise(stacked)):
            most = np.minimum(_SPEED * self.most[k], JUMP)
            cost = np.zeros((now.shape[1], later.shape[1]))
            for f in range(len(now)):
                gap = later[f][None] - now[f][:, None]
                cost += np.where(np.abs(gap) <= most[f], _MOTION * gap**2, np.inf)
            total = value[:, None] - cost
            from_ = np.argmax(total, axis=0)
            chosen.append(from_)
            value = total[from_, np.arange(len(from_))] + scores[k + 1]
            if not np.any(np.isfinite(value)):
                self._refuse_speed(k, stacked)
        at = int(np.argmax(value))
        sequence = [stacked[-1][:, at]]
        for from_, nodes in zip(reversed(chosen), reversed(stacked[:-1]), strict=True):
            at = int(from_[at])
            sequence.append(nodes[:, at])
        return np.array(sequence[::-1])

    def _refuse_speed(self, k: int, nodes: Sequence[FloatArray]) -> None:
        """Refuse a path that no trajectory passes: the limits of speed, or of position."""
        least, names = np.inf, ""
        for point in nodes[k].T:
            ratio = np.abs(nodes[k + 1] - point[:, None]) / self.most[k][:, None]
            worst = np.max(ratio, axis=0)
            at = int(np.argmin(worst))
            if worst[at] < least:
                least = float(worst[at])
                names = self.arm.chain.names[int(np.argmax(ratio[:, at]))]
        where = place_name(float(self.places[k + 1]))
        if least > _SPEED:
            allowed = f"at least {1.1 * least:.2g} times as much time there"
            raise InputError(
                f"speed of {names} at {where}", f"{least:.3g} of its limit", allowed
            )
        allowed = "a path that one trajectory follows within the joints' limits"
        raise InputError(where, "reached from no configuration before it", allowed)

    def _measured(self, configurations: FloatArray) -> Trajectory:
        samples = np.arange(len(configurations))
        ends = survivors(
            self.kinematics, configurations.T, samples, self.poses, seed=self.search.seed
        )
        sigma = [measures.worst_case_sigma(self.arm.jacobian(one)) for one in configurations]
        return Trajectory(configurations, ends.T, np.array(sigma))

    def _polished(self, found: Trajectory, weight: float) -> tuple[str, FloatArray | None]:
        """Solve the nonlinear program from a trajectory; None if it gave no trajectory."""
        q = found.configurations
        problem = transcription(
            self.arm.chain,
            self.poses,
            self.arm.task.rows,
            self.most,
            *self._targets(found),
            weight,
        )
        solution = Solver(problem, _POLISH).solve(q.ravel())
        status = solution.status.return_status
        if status not in (SUCCESS, ACCEPTABLE, LIMIT):
            return status, None
        moved = solution.variables.reshape(q.shape)
        lower, upper = self.arm.bounds
        moved = np.clip(moved, lower, upper)
        origin, turn, _ = self.kinematics.forward(moved.T)
        off = self.kinematics.error(
            *(origin, turn, self.poses.positions.T),
            np.moveaxis(self.poses.rotations, 0, 2),
        )
        slow = np.all(np.abs(np.diff(moved, axis=0)) <= self.most + 1e-9)
        return status, moved if slow and np.max(np.abs(off)) < 1e-5 else None

    def _targets(self, found: Trajectory) -> tuple[FloatArray, FloatArray]:
        """Return where each joint should be, and how much that matters, both (N, n)."""
        final = len(self.times) - 1
        target, weight = found.configurations.copy(), np.full(found.ends.shape, 0.1)
        for k, f in zip(*np.nonzero(~found.survives), strict=True):
            nodes = np.concatenate(self.nodes[k], axis=1)
            good = np.concatenate(self.ends[k], axis=1)[f] == final
            if np.any(good):
                gaps = np.max(np.abs(nodes[:, good] - target[k][:, None]), axis=0)
                at = int(np.argmin(gaps))
                if gaps[at] < JUMP:
                    target[k, f], weight[k, f] = nodes[f, good][at], 1.0
        return target, weight

    def _report(
        self, found: Trajectory, base: FloatArray | None, statuses: list[str], polished: bool
    ) -> PathPlan:
        final = len(self.times) - 1
        kept = [np.concatenate(one, axis=1) == final for one in self.ends]
        nodes = [np.concatenate(one, axis=1) for one in self.nodes]
        best = [
            max(int(np.max(np.sum(one, axis=0))), int(np.sum(own)))
            for one, own in zip(kept, found.survives, strict=True)
        ]
        single = np.array([np.any(one, axis=1) for one in kept]) | found.survives
        least = np.array([np.min(one, axis=1) for one in nodes])
        largest = np.array([np.max(one, axis=1) for one in nodes])
        # What every later sample's range has in common.
        least = np.maximum.accumulate(least[::-1])[::-1]
        largest = np.minimum.accumulate(largest[::-1])[::-1]
        apart = (least > largest) & ~single
        hopeless = np.where(np.any(apart, 0), final - np.argmax(apart[::-1], axis=0), -1)
        q = found.configurations
        middle, _ = self.kinematics.forward((q[1:] + q[:-1]).T / 2, jacobian=False)
        straight = (self.poses.positions[1:] + self.poses.positions[:-1]).T / 2
        return PathPlan(
            joints=self.arm.chain.names,
            times=self.times,
            places=self.places,
            poses=self.poses,
            planned=found,
            minimum_norm=None if base is None else self._measured(base),
            ceiling=100 * float(np.mean(best)) / self.arm.size,
            joint_ceiling=100 * np.mean(single, axis=0),
            hopeless_until=hopeless,
            nodes=sum(one.shape[1] for one in nodes),
            polished=polished,
            statuses=tuple(statuses),
            deviation=float(np.max(np.linalg.norm(middle - straight, axis=0))),
            speed=float(np.max(np.abs(np.diff(q, axis=0)) / self.most)),
        )


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
