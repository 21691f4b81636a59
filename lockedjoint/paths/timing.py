"""A planned trajectory as a controller runs it: from rest to rest within its limits, in time.

TOPP-RA (Pham and Pham, 2018; the library toppra) runs along a spline through the samples as
fast as limits of velocity and acceleration allow.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Self

import numpy as np
from scipy.spatial.transform import Rotation

from lockedjoint.clearance.motion import ClearMotion
from lockedjoint.formulations.io.escaping import yaml_text
from lockedjoint.formulations.io.files import csv_text
from lockedjoint.formulations.io.objects import library
from lockedjoint.kinematics.chain import Chain
from lockedjoint.nlp.arrays import (
    FloatArray,
    as_floats,
    finite_vector,
    real_number,
    whole_number,
)
from lockedjoint.nlp.errors import InputError

# TOPP-RA needs these modules.
_TOPPRA = ("toppra", "toppra.algorithm", "toppra.constraint")
# TOPP-RA's grid has so many points between two samples.
_GRID_POINTS = 10
# Limits are checked at points that are this far apart in time.
_FINE_S = 1e-3
# Limits are checked at least at so many points of each piece.
_LEAST_FINE_POINTS = 200
# Limits are checked at most at about so many points of all pieces.
_MOST_FINE_POINTS = 100_000
# A result has at most so many points: those of slow joints are farther apart in time.
_MOST_POINTS = 10_000
# Limits of velocity and acceleration may not be smaller, nor larger than its inverse.
_SMALLEST_LIMIT = 1e-10
# A trajectory must be shorter: whole seconds of ROS's messages are numbers of 32 bits.
_LONGEST_S = 2.0**31
# So many distances from points to lines are in the memory at once.
_DISTANCES_AT_ONCE = 2_000_000
#: `TimedTrajectory.files` returns files with these names.
TRAJECTORY_FILES = ("trajectory.csv", "trajectory.json", "trajectory.yaml")
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
        The largest velocity and acceleration, as shares of their limits, by a finer grid of
        times than `times`.
    off_path
        Largest distance of the tip from straight lines between the samples of the path,
        metres; likewise.
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

    @property
    def duration(self) -> float:
        """Seconds."""
        return float(self.times[-1])

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
        return {"duration": self.duration, **values, "joints": list(self.joints)}

    def csv_lines(self) -> list[list[object]]:
        """Return lines of a table, the first with headings."""
        kinds = ("", " velocity", " acceleration")
        heads = [name + kind for kind in kinds for name in self.joints]
        numbers = np.column_stack(
            (self.times, self.positions, self.velocities, self.accelerations, self.tool)
        )
        return [["t", *heads, "x", "y", "z", "qx", "qy", "qz", "qw"], *numbers.tolist()]

    def files(self, **more: object) -> dict[str, str]:
        """Return the content of files by name: CSV, JSON with more entries, and ROS's YAML."""
        return {
            "trajectory.csv": csv_text(self.csv_lines()),
            "trajectory.json": json.dumps({**more, **self.to_dict()}, indent=1) + "\n",
            "trajectory.yaml": yaml_text(self.to_ros()),
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


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """Largest velocities and accelerations of joints, shape (n,) each, above 0."""

    velocity: FloatArray
    acceleration: FloatArray

    @classmethod
    def of(
        cls,
        chain: Chain,
        acceleration: Sequence[float],
        velocity: Sequence[float] | None = None,
    ) -> Self:
        """Return those of an arm; velocities are by default those of its file.

        Raises
        ------
        InputError
            If a limit is missing or not above 0.
        """
        fastest = [joint.velocity for joint in chain.joints] if velocity is None else velocity
        for name, limit in zip(chain.names, fastest, strict=False):
            if limit is None or not np.isfinite(limit):
                allowed = f"one for {name}, which has none in its file"
                raise InputError("velocity limits", "missing", allowed)
        return cls(
            _positive("velocity limits", fastest, len(chain.names)),
            _positive("acceleration limits", acceleration, len(chain.names)),
        )


def require_toppra() -> None:
    """Raise MissingLibraryError, which says how to install toppra, if it is not installed."""
    library(*_TOPPRA)


def timed(
    chain: Chain,
    configurations: FloatArray,
    limits: MotionLimits,
    stops: Sequence[int] = (),
    step: float = 0.01,
    path: FloatArray | None = None,
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
        Seconds between two points of the result, except for the last; longer where the result
        would have more than 10 000 points.
    path
        Where the tip is to be at the samples, shape (N, 3); by default where they have it.

    Raises
    ------
    InputError
        If toppra has no answer, the spline leaves the limits of position between samples, or
        the joints are so slow that the way takes longer than 2³¹ seconds.
    MissingLibraryError
        If toppra is not installed.
    """
    fastest, strongest = limits.velocity, limits.acceleration
    step = real_number("step", step, "a number from 1e-4 to 1", 1e-4, 1.0)
    samples = as_floats("configurations", configurations)
    if samples.ndim != 2 or len(samples) < 2 or samples.shape[1] != len(chain.joints):
        allowed = f"shape (N, {len(chain.joints)}), N > 1"
        raise InputError("configurations", f"an array of shape {samples.shape}", allowed)
    last = len(samples) - 1
    for stop in stops:
        whole_number("stop", stop, 0, last)
    ends = sorted({0, last, *stops})
    pieces = [_piece(samples[a : b + 1], fastest, strongest) for a, b in pairwise(ends)]
    total = _checked_duration(sum(piece.duration for piece in pieces))
    step, dense = max(step, total / _MOST_POINTS), max(_FINE_S, total / _MOST_FINE_POINTS)
    fine = np.concatenate([_fine_states(piece, dense) for piece in pieces], axis=1)
    _check_positions(chain, fine[0])
    times, states, began = [], [], 0.0
    for k, piece in enumerate(pieces):
        skipped = int(k > 0)  # the rest at a stop is the end of the piece before
        own, state = _states(piece, step)
        times.append(began + own[skipped:])
        states.append(state[:, skipped:])
        began += float(own[-1])
    q, velocities, accelerations = np.concatenate(states, axis=1)
    # TOPP-RA keeps the limits at the points of its grid. The slower trajectory keeps them
    # between these points, too.
    both = np.concatenate([fine, *states], axis=1)
    speed = float(np.max(np.abs(both[1]) / fastest))
    acceleration = float(np.max(np.abs(both[2]) / strongest))
    slower = max(1.0, speed, float(np.sqrt(acceleration)))
    _checked_duration(total * slower)
    velocities, accelerations = velocities / slower, accelerations / slower**2
    position, rotation = chain.tip_at(q.T)
    corners = chain.tip_at(samples.T)[0].T if path is None else path
    way = chain.tip_at(fine[0].T)[0].T
    quaternion = Rotation.from_matrix(rotation.transpose(2, 0, 1)).as_quat()
    return TimedTrajectory(
        chain.base,
        chain.names,
        np.concatenate(times) * slower,
        q,
        velocities,
        accelerations,
        np.column_stack((position.T, quaternion)),
        speed / slower,
        acceleration / slower**2,
        float(np.max(off_lines(way, corners)[0])),
    )


def joined(runs: Sequence[TimedTrajectory]) -> TimedTrajectory:
    """Return trajectories of the same joints, each from where the one before ends, as one."""
    whole = runs[0]
    for run in runs[1:]:
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


def _states(piece: Any, step: float) -> tuple[FloatArray, FloatArray]:
    """Return times at most `step` apart and (q, q̇, q̈), shape (3, N, n), of a timed spline."""
    count = max(int(np.ceil(piece.duration / step)), 1)
    times = np.append(step * np.arange(count), piece.duration)
    return times, np.stack([piece(times), piece(times, 1), piece(times, 2)])


def _fine_states(piece: Any, step: float) -> FloatArray:
    """Return (q, q̇, q̈), shape (3, N, n), of a timed spline where limits are looked at."""
    count = max(int(np.ceil(piece.duration / step)), _LEAST_FINE_POINTS)
    times = np.linspace(0.0, piece.duration, count + 1)
    return np.stack([piece(times), piece(times, 1), piece(times, 2)])


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


def _piece(q: FloatArray, fastest: FloatArray, strongest: FloatArray) -> Any:
    """Return toppra's trajectory along a spline through q, shape (N, n), from rest to rest."""
    toppra = library(*_TOPPRA)
    algorithm, constraint = toppra.algorithm, toppra.constraint
    # The parameter is the length of the way in joint space, each joint by its speed.
    lengths = np.linalg.norm(np.diff(q, axis=0) / fastest, axis=1)
    place = np.concatenate(([0.0], np.cumsum(np.maximum(lengths, 1e-9))))
    way = toppra.SplineInterpolator(place, q, bc_type="natural")
    limits = [
        constraint.JointVelocityConstraint(np.column_stack((-fastest, fastest))),
        constraint.JointAccelerationConstraint(
            np.column_stack((-strongest, strongest)),
            discretization_scheme=constraint.DiscretizationType.Interpolation,
        ),
    ]
    grid = np.interp(
        np.arange(_GRID_POINTS * (len(q) - 1) + 1) / _GRID_POINTS, np.arange(len(q)), place
    )
    timing = algorithm.TOPPRA(
        limits, way, gridpoints=grid, parametrizer="ParametrizeConstAccel"
    )
    found = timing.compute_trajectory(0.0, 0.0)
    if found is None:
        allowed = "one along which toppra can go within the limits of the joints"
        raise InputError("trajectory", "too rough", allowed)
    return found


def for_each(name: str, given: Sequence[float] | float, joints: int) -> FloatArray:
    """Return a number for each joint, from one for each or one for all."""
    values = np.atleast_1d(as_floats(name, given))
    return finite_vector(
        name, np.repeat(values, joints) if len(values) == 1 else values, joints
    )


def _positive(name: str, given: Sequence[float | None], size: int) -> FloatArray:
    limits = finite_vector(name, np.asarray(given, dtype=float), size)
    if not np.all((limits >= _SMALLEST_LIMIT) & (limits <= 1 / _SMALLEST_LIMIT)):
        allowed = f"numbers above 0, from {_SMALLEST_LIMIT:g} to {1 / _SMALLEST_LIMIT:g}"
        raise InputError(name, limits.tolist(), allowed)
    return limits


def _duration(seconds: float) -> dict[str, int]:
    nanoseconds = round(seconds * 1e9)
    return {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}
