"""A planned trajectory as a controller runs it: from rest to rest within its limits, in time.

TOPP-RA (Pham and Pham, 2018; the library toppra) runs along a spline through the samples as
fast as limits of velocity and acceleration allow; see `smooth_law` for limits of jerk. Limits
hold between the points of a trajectory too, as controllers interpolate; see `Quintic`.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from lockedjoint.clearance.motion import ClearMotion
from lockedjoint.formulations.io.escaping import yaml_text
from lockedjoint.formulations.io.files import csv_text
from lockedjoint.kinematics.chain import Chain
from lockedjoint.nlp.arrays import (
    FloatArray,
    as_floats,
    real_number,
    whole_number,
)
from lockedjoint.nlp.errors import InputError
from lockedjoint.paths.motion_limits import MotionLimits
from lockedjoint.paths.quintic import Quintic
from lockedjoint.paths.smooth_law import smooth_points, time_law

# A result has at most so many points: those of slow joints are farther apart in time.
_MOST_POINTS = 10_000
# Each piece of a result has so many points at least, unless pieces are many.
_LEAST_POINTS = 200
# A trajectory must be shorter: whole seconds of ROS's messages are numbers of 32 bits.
_LONGEST_S = 2.0**31
# So many distances from points to lines are in the memory at once.
_DISTANCES_AT_ONCE = 2_000_000
#: `TimedTrajectory.files` returns files with these names.
TRAJECTORY_FILES = (
    "trajectory.csv",
    "trajectory.json",
    "trajectory.yaml",
    "trajectory.ros2_control.csv",
)
# A controller goes so from point to point, for the limits to hold there.
_INTERPOLATION = "quintic: position, velocity and acceleration of both points"
# A spline may pass a limit of position by this much, which is rounding.
_SLACK_M_OR_RAD = 1e-9


@dataclass(frozen=True, eq=False)
class TimedTrajectory:
    """A joint trajectory in time, from rest to rest.

    Attributes
    ----------
    base
        Name of the link that the tool's pose is relative to.
    joints
        Names of the n joints.
    times
        Seconds from the start, shape (N,).
    positions, velocities, accelerations
        Radians or metres and their derivatives, shape (N, n).
    tool
        Position in metres and quaternion (x, y, z, w) of the tip, shape (N, 7).
    speed, acceleration
        The largest velocity and acceleration, as shares of their limits, also between the
        points, where a polynomial of degree five has positions, velocities and accelerations
        of both.
    off_path
        Largest distance of the tip from straight lines between the samples of the path,
        metres; likewise.
    jerk
        The largest jerk, as a share of its limit, likewise; None without such a limit.
    units
        Of the positions of each joint, rad or m.
    begins
        Seconds from the start to the beginning of the path, while the arm gets there.
    places
        Where on a planned path each point is, counted in waypoints from 1, shape (N,): 2.5 is
        midway from waypoint 2 to 3. None of other ways.
    """

    base: str
    joints: tuple[str, ...]
    times: FloatArray
    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray
    tool: FloatArray
    speed: float
    acceleration: float
    off_path: float
    jerk: float | None = None
    units: tuple[str, ...] = ()
    begins: float = 0.0
    places: FloatArray | None = None

    @property
    def duration(self) -> float:
        """Seconds."""
        return float(self.times[-1])

    def summary(self) -> dict[str, object]:
        """Return how long it takes and how near it comes to its limits, by name."""
        shares = {"velocity": self.speed, "acceleration": self.acceleration, "jerk": self.jerk}
        return {
            "duration (s)": self.duration,
            **({"path begins at (s)": self.begins} if self.begins else {}),
            "points": len(self.times),
            "shares of limits": ", ".join(
                f"{name} {100 * share:.4g} %" for name, share in shares.items() if share
            ),
        }

    def check_clear(self, motion: ClearMotion) -> None:
        """Raise InputError if links touch on straight ways of the joints between the points."""
        clear = motion.clear(self.positions[:-1].T, self.positions[1:].T)
        for k in np.flatnonzero(~clear)[:1]:
            where = f"trajectory at {self.times[k]:.3g} s"
            allowed = "one without, also between samples: more samples, or stops at corners"
            raise InputError(where, "in a collision", allowed)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        values = {
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in vars(self).items()
            if name != "base"
        }
        lists = {"joints": list(self.joints), "units": list(self.units)}
        how = {"unit_of_times": "s", "unit_of_tool": "m", "interpolation": _INTERPOLATION}
        return {"duration": self.duration, **values, **lists, **how}

    def csv_lines(self) -> list[list[object]]:
        """Return lines of a table, the first with headings."""
        kinds = {"": "", " velocity": "/s", " acceleration": "/s²"}
        units = self.units or ("rad or m",) * len(self.joints)
        heads = [
            f"{name}{kind} ({unit}{rate})"
            for kind, rate in kinds.items()
            for name, unit in zip(self.joints, units, strict=True)
        ]
        numbers = np.column_stack(
            (self.times, self.positions, self.velocities, self.accelerations, self.tool)
        )
        tool = ["x (m)", "y (m)", "z (m)", "qx", "qy", "qz", "qw"]
        return [["t (s)", *heads, *tool], *numbers.tolist()]

    def ros2_control_lines(self) -> list[list[object]]:
        """Return lines of a table with the names of ros2_control's interfaces.

        Seconds, radians and metres, as in ROS: time_from_start, and for each joint
        NAME/position, NAME/velocity and NAME/acceleration.
        """
        heads = [
            f"{name}/{kind}"
            for name in self.joints
            for kind in ("position", "velocity", "acceleration")
        ]
        states = np.stack([self.positions, self.velocities, self.accelerations], axis=2)
        numbers = np.column_stack((self.times, states.reshape(len(self.times), -1)))
        return [["time_from_start", *heads], *numbers.tolist()]

    def files(self, **more: object) -> dict[str, str]:
        """Return the content of files by name: tables, JSON with more entries, ROS's YAML."""
        return {
            "trajectory.csv": csv_text(self.csv_lines()),
            "trajectory.json": json.dumps({**more, **self.to_dict()}, indent=1) + "\n",
            "trajectory.yaml": yaml_text(self.to_ros()),
            "trajectory.ros2_control.csv": csv_text(self.ros2_control_lines()),
        }

    def to_ros(self) -> dict[str, Any]:
        """Return the fields of ROS's trajectory_msgs/JointTrajectory."""
        parts = (self.times, self.positions, self.velocities, self.accelerations)
        return {
            "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": self.base},
            "joint_names": list(self.joints),
            "points": [
                {
                    "positions": q.tolist(),
                    "velocities": velocity.tolist(),
                    "accelerations": acceleration.tolist(),
                    "effort": [],
                    "time_from_start": _duration(float(t)),
                }
                for t, q, velocity, acceleration in zip(*parts, strict=True)
            ],
        }


def timed(
    chain: Chain,
    configurations: FloatArray,
    limits: MotionLimits,
    stops: Sequence[int] = (),
    step: float = 0.01,
    path: FloatArray | None = None,
    places: FloatArray | None = None,
) -> TimedTrajectory:
    """Run along configurations as fast as the limits allow, from rest to rest.

    Parameters
    ----------
    chain
        The arm.
    configurations
        Shape (N, n), N > 1: a cubic spline goes through them.
    limits
        Of each joint.
    stops
        Samples at which the arm comes to rest: there the spline may have a corner.
    step
        Seconds between two points of the result, about: less where a piece is short, and more
        where the result would have more than 10 000 points.
    path
        Where the tip is to be at the samples, shape (N, 3); by default where they have it.
    places
        Where on a path the samples are, shape (N,); then the result says it of its points.

    Raises
    ------
    InputError
        If toppra has no answer, the spline leaves the limits of position between samples, or
        the joints are so slow that the way takes longer than 2³¹ seconds.
    MissingLibraryError
        If toppra is not installed.
    """
    step = real_number("step", step, "a number from 1e-4 to 1", 1e-4, 1.0)
    samples = as_floats("configurations", configurations)
    if samples.ndim != 2 or len(samples) < 2 or samples.shape[1] != len(chain.joints):
        allowed = f"shape (N, {len(chain.joints)}), N > 1"
        raise InputError("configurations", f"an array of shape {samples.shape}", allowed)
    last = len(samples) - 1
    for stop in stops:
        whole_number("stop", stop, 0, last)
    ends = sorted({0, last, *stops})
    laws = [time_law(samples[a : b + 1], limits) for a, b in pairwise(ends)]
    total = _checked_duration(sum(law.duration for law in laws))
    # Short pieces have many points, too: what makes accelerations smooth is as long as a few.
    least = min(_LEAST_POINTS, _MOST_POINTS // (2 * len(laws)))
    step = max(step, total / (_MOST_POINTS - least * len(laws)))
    pieces = [smooth_points(law, limits, step, least) for law in laws]
    _checked_duration(sum(float(times[-1]) for times, _, _ in pieces))
    times, states, where = pieces[0]
    for first, (more, others, ahead) in zip(ends[1:], pieces[1:], strict=False):
        times = np.concatenate([times, times[-1] + more[1:]])
        # The rest at a stop is the end of the piece before.
        states = np.concatenate([states, others[:, 1:]], axis=1)
        where = np.concatenate([where, first + ahead[1:]])
    between = Quintic.through(times, states)
    speed, acceleration, jerk = limits.shares(between.largest())
    way = between.positions()
    _check_positions(chain, way)
    q, velocities, accelerations = states
    position, rotation = chain.tip_at(q.T)
    corners = chain.tip_at(samples.T)[0].T if path is None else path
    quaternion = Rotation.from_matrix(rotation.transpose(2, 0, 1)).as_quat()
    return TimedTrajectory(
        chain.base,
        chain.names,
        times,
        q,
        velocities,
        accelerations,
        np.column_stack((position.T, quaternion)),
        speed,
        acceleration,
        float(np.max(off_lines(chain.tip_at(way.T)[0].T, corners)[0])),
        None if limits.jerk is None else jerk,
        tuple(joint.unit for joint in chain.joints),
        places=None if places is None else np.interp(where, np.arange(len(samples)), places),
    )


def joined(runs: Sequence[TimedTrajectory]) -> TimedTrajectory:
    """Return trajectories of the same joints, each from where the one before ends, as one."""
    whole = runs[0]
    for run in runs[1:]:
        places = None
        if whole.places is not None and run.places is not None:
            places = np.concatenate([whole.places, run.places[1:]])
        whole = replace(
            whole,
            times=np.concatenate([whole.times, whole.duration + run.times[1:]]),
            positions=np.concatenate([whole.positions, run.positions[1:]]),
            velocities=np.concatenate([whole.velocities, run.velocities[1:]]),
            accelerations=np.concatenate([whole.accelerations, run.accelerations[1:]]),
            tool=np.concatenate([whole.tool, run.tool[1:]]),
            speed=max(whole.speed, run.speed),
            acceleration=max(whole.acceleration, run.acceleration),
            off_path=max(whole.off_path, run.off_path),
            jerk=None if run.jerk is None else max(whole.jerk or 0.0, run.jerk),
            places=places,
        )
    return whole


def _check_positions(chain: Chain, q: FloatArray) -> None:
    """Refuse a spline that leaves the limits of position between samples."""
    lower, upper = chain.limits
    beyond = np.max(np.maximum(lower - q, q - upper), axis=0)
    worst = int(np.argmax(beyond))
    if beyond[worst] > _SLACK_M_OR_RAD:
        joint, by = chain.names[worst], f"{beyond[worst]:.2g} beyond its limits"
        allowed = "within them between samples, too: more samples, or wider limits"
        raise InputError(f"position of {joint}", by, allowed)


def _checked_duration(seconds: float) -> float:
    """Return a duration; InputError if it is longer than a message of ROS can say."""
    if not seconds < _LONGEST_S:
        allowed = "less than 2^31 s: faster joints, or larger accelerations"
        raise InputError("duration of the trajectory", f"{seconds:.3g} s", allowed)
    return seconds


def off_lines(points: FloatArray, corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far points (N, 3) are from lines between corners (K, 3), and where along them.

    Metres, and places counted in corners from 0, shape (N,) each.
    """
    most = max(1, _DISTANCES_AT_ONCE // len(corners))
    parts = (points[k : k + most] for k in range(0, len(points), most))
    found = [_off_lines(part, corners) for part in parts]
    distances, places = (np.concatenate(part) for part in zip(*found, strict=True))
    return distances, places


def _off_lines(points: FloatArray, corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    ways = np.diff(corners, axis=0)
    along = np.einsum("nki,ki->nk", points[:, None] - corners[:-1], ways)
    share = np.clip(along / np.maximum(np.sum(ways**2, axis=1), 1e-300), 0.0, 1.0)
    nearest = corners[:-1] + share[:, :, None] * ways
    distances = np.linalg.norm(points[:, None] - nearest, axis=2)
    line, each = np.argmin(distances, axis=1), np.arange(len(points))
    return distances[each, line], line + share[each, line]


def _duration(seconds: float) -> dict[str, int]:
    nanoseconds = round(seconds * 1e9)
    return {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}
