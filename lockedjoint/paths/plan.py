"""What is found for a path: a joint trajectory, which joints may lock, and how to go on."""

from __future__ import annotations

import io
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from lockedjoint.clearance.link_clearance import Closest, LinkClearance
from lockedjoint.clearance.motion import ClearMotion
from lockedjoint.kinematics.geometry import BoolArray, IntArray
from lockedjoint.kinematics.robot_arm import RobotArm
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.paths.approach import Approach
from lockedjoint.paths.plan_in_time import PlanInTime, RestOfPlan, check_followed
from lockedjoint.paths.survival import survivors
from lockedjoint.paths.waypoints import Poses, at_waypoints


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


@dataclass(frozen=True)
class JointRow:
    """A joint's line of a plan: how often its failure is survived, and where the others end."""

    joint: str
    percent: float
    minimum_norm_percent: float | None
    best_of_samples_percent: float
    unrecoverable_until_s: float | None
    others_end_s: list[float] | None


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
    deviation
        Largest distance of the tool from the path, at the samples and between them, in metres.
    speed
        Largest joint speed, as a share of its limit; None if no joint has a limit of speed.
    closest
        Where links have to stay apart: the nearest two at a sample. Between samples none touch.
    complete
        Whether the search ended; if not, the user interrupted it.
    approach
        How the arm gets to the first sample from where it stands, if that was given.
    units
        Of the positions of each joint, rad or m.
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
    deviation: float
    speed: float | None
    closest: Closest | None = None
    complete: bool = True
    approach: Approach | None = None
    units: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Say in one line how many failures are survived."""
        base = self.minimum_norm
        beside = f", {base.share:.1f} % at minimum norm" if base else ""
        survived = f"{self.planned.share:.1f} % of failures survived"
        return f"<PathPlan: {survived}{beside}, {len(self.times)} samples>"

    @property
    def waypoints(self) -> FloatArray:
        """Waypoints, shape (W, 3) or (W, 7): x, y, z and, if it counts, the orientation.

        Metres, and quaternions with the scalar last.
        """
        chosen = at_waypoints(self.places)
        positions = self.poses.positions[chosen]
        if max(self.poses.rows) < 3:
            return positions
        turns = Rotation.from_matrix(self.poses.rotations[chosen])
        return np.column_stack((positions, turns.as_quat()))

    def after(self, seconds: float) -> RestOfPlan:
        """Return where the arm is at a time, and the rest of the path, for `recover`.

        Parameters
        ----------
        seconds
            The time, as `times` has it.

        Raises
        ------
        InputError
            If the plan is not under way then, or keeps only some directions of the tool.
        """
        check_followed(self.poses.rows)
        waypoints, q = self.waypoints, self.planned.configurations
        return PlanInTime(
            joints=self.joints,
            positions=waypoints[:, :3],
            quaternions=waypoints[:, 3:] if waypoints.shape[1] > 3 else None,
            at_waypoints=q[at_waypoints(self.places)],
            times=self.times,
            states=q[None],
            places=self.places,
        ).after(seconds)

    def joint_rows(self) -> list[dict[str, object]]:
        """Return a line for each joint: shares that survive, and where the others end."""
        rows: list[dict[str, object]] = []
        base = self.minimum_norm
        for f, name in enumerate(self.joints):
            survives, ends = self.planned.survives[:, f], self.planned.ends[:, f]
            lost, until = self.times[ends[~survives]], int(self.unrecoverable_until[f])
            usual = None if base is None else base.survives[:, f]
            row = JointRow(
                joint=name,
                percent=100 * float(np.mean(survives)),
                minimum_norm_percent=None if usual is None else 100 * float(np.mean(usual)),
                best_of_samples_percent=float(self.joint_best_of_samples[f]),
                unrecoverable_until_s=float(self.times[until]) if until >= 0 else None,
                others_end_s=[float(lost.min()), float(lost.max())] if lost.size else None,
            )
            rows.append(asdict(row))
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
            "configurations_tested": self.nodes,
            "complete": self.complete,
            "approach": self.approach and self.approach.to_dict(),
            "joints": self.joint_rows(),
            "units": list(self.units),
            "unit_of_times": "s",
            "times": self.times.tolist(),
            "places": self.places.tolist(),
            "waypoints": self.waypoints.tolist(),
            "trajectory": self.planned.to_dict(self.times),
            "minimum_norm": base and base.to_dict(self.times),
        }

    def csv_lines(self) -> list[list[object]]:
        """Return the trajectory as lines of a table, the first with headings."""
        ends = [f"{name} locked ends at (s)" for name in self.joints]
        units = self.units or ("rad or m",) * len(self.joints)
        heads = [f"{name} ({unit})" for name, unit in zip(self.joints, units, strict=True)]
        way = self.planned
        columns = (self.times, *way.configurations.T, way.sigma, way.survives.sum(axis=1))
        lines = zip(*(x.tolist() for x in (*columns, *self.times[way.ends].T)), strict=True)
        return [["t (s)", *heads, "sigma", "survivors", *ends], *map(list, lines)]


def continuations(
    arm: RobotArm, plan: PathPlan, seed: int = 0, clearance: LinkClearance | None = None
) -> bytes:
    """Return how a planned path is finished after each failure that it survives, as NPZ.

    With the seed and the clearance of the plan's search. Arrays are `joints`, names of the n
    joints; `times`, seconds of the N samples; and `configurations`, radians or metres, shape
    (n, N, N, n): if joint f locks at sample k, the arm is at ``configurations[f, k, i]`` at
    sample i ≥ k; NaN before, and where f is not survived. At i = k it is where the arm was, or
    another point of the self-motion of that pose, to which it has to move first. Where links
    have to stay apart there is also `closest`, metres, shape (n, N): the least distance of two
    links at the samples after each failure, NaN where it is not survived; they touch nowhere
    between samples.
    """
    q = plan.planned.configurations
    count, n = q.shape
    tracks = np.full((n, count, count, n), np.nan)
    allowed = None if clearance is None else ClearMotion(clearance, arm.chain).clear
    given = arm.chain, q.T, np.arange(count), plan.poses, seed, allowed
    survivors(*given, tracks=tracks)
    file = io.BytesIO()
    names = np.array(plan.joints)
    arrays: dict[str, Any] = {"joints": names, "times": plan.times, "configurations": tracks}
    if clearance is not None:
        arrays["closest"] = _least_after(arm, clearance, tracks)
    np.savez_compressed(file, **arrays)
    return file.getvalue()


def _least_after(arm: RobotArm, clearance: LinkClearance, tracks: FloatArray) -> FloatArray:
    """Return the least distance of links on tracks after failures, (n, N, N, n), as (n, N)."""
    motion = ClearMotion(clearance, arm.chain)
    least = np.full(tracks.shape[:2], np.nan)
    for joint, sample in np.argwhere(np.isfinite(tracks[:, :, -1, 0])).tolist():
        track = tracks[joint, sample, sample:]
        least[joint, sample] = motion.closest(track).distance
    return least
