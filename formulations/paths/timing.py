"""A planned trajectory as a controller runs it: from rest to rest within its limits, in time.

TOPP-RA (Pham and Pham, 2018; the library toppra) runs along a spline through the samples as
fast as limits of velocity and acceleration allow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from formulations.kinematics.chain import Chain
from formulations.kinematics.forward import Kinematics
from nlp.arrays import FloatArray, finite_vector, real_number
from nlp.errors import InputError, MissingLibraryError

# Points of the phase plane between two samples.
_GRID = 10


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
        The largest velocity and acceleration, as shares of their limits.
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

    @property
    def duration(self) -> float:
        """Seconds."""
        return float(self.times[-1])

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "duration": self.duration,
            "speed": self.speed,
            "acceleration": self.acceleration,
            "joints": list(self.joints),
            "times": self.times.tolist(),
            "positions": self.positions.tolist(),
            "velocities": self.velocities.tolist(),
            "accelerations": self.accelerations.tolist(),
            "tool": self.tool.tolist(),
        }

    def csv_lines(self) -> list[list[object]]:
        """Return lines of a table, the first with headings."""
        kinds = ("", " velocity", " acceleration")
        heads = [name + kind for kind in kinds for name in self.joints]
        numbers = np.column_stack(
            (self.times, self.positions, self.velocities, self.accelerations, self.tool)
        )
        return [["t", *heads, "x", "y", "z", "qx", "qy", "qz", "qw"], *numbers.tolist()]

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
    velocity: Sequence[float] | None,
    acceleration: Sequence[float],
    stops: Sequence[int] = (),
    step: float = 0.01,
) -> TimedTrajectory:
    """Run along configurations as fast as the limits allow, from rest to rest.

    Parameters
    ----------
    chain
        The arm.
    configurations
        Shape (N, n), N > 1: a cubic spline goes through them.
    velocity, acceleration
        Limits of each joint, above 0, shape (n,); by default velocities are those of the file.
    stops
        Samples at which the arm comes to rest: there the spline may have a corner.
    step
        Seconds between two points of the result, except for the last.

    Raises
    ------
    InputError
        If a limit is missing or not above 0, or toppra has no answer.
    MissingLibraryError
        If toppra is not installed.
    """
    fastest = _limits("velocity limits", chain, velocity)
    strongest = _limits("acceleration limits", chain, acceleration)
    step = real_number("step", step, "a number from 1e-4 to 1", 1e-4, 1.0)
    ends = sorted({0, len(configurations) - 1, *stops})
    pieces = [
        _piece(configurations[a : b + 1], fastest, strongest, step) for a, b in pairwise(ends)
    ]
    times, states, began = [], [], 0.0
    for k, (own, state) in enumerate(pieces):
        skipped = int(k > 0)  # the rest at a stop is the end of the piece before
        times.append(began + own[skipped:])
        states.append(state[:, skipped:])
        began += float(own[-1])
    motion = np.concatenate(states, axis=1)
    # TOPP-RA holds the limits at the points of its grid: in between they hold after this.
    slower = max(
        1.0,
        float(np.max(np.abs(motion[1]) / fastest)),
        float(np.max(np.sqrt(np.abs(motion[2]) / strongest))),
    )
    q, velocities, accelerations = motion[0], motion[1] / slower, motion[2] / slower**2
    position, rotation = Kinematics(chain).forward(q.T, jacobian=False)
    quaternion = Rotation.from_matrix(rotation.transpose(2, 0, 1)).as_quat()
    return TimedTrajectory(
        chain.base,
        chain.names,
        np.concatenate(times) * slower,
        q,
        velocities,
        accelerations,
        np.column_stack((position.T, quaternion)),
        float(np.max(np.abs(velocities) / fastest)),
        float(np.max(np.abs(accelerations) / strongest)),
    )


def _piece(
    q: FloatArray, fastest: FloatArray, strongest: FloatArray, step: float
) -> tuple[FloatArray, FloatArray]:
    """Return times and (q, q̇, q̈), shape (3, N, n), from rest to rest."""
    try:
        import toppra
        from toppra import algorithm, constraint
    except ModuleNotFoundError:
        raise MissingLibraryError("toppra") from None
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
    grid = np.interp(np.arange(_GRID * (len(q) - 1) + 1) / _GRID, np.arange(len(q)), place)
    timing = algorithm.TOPPRA(
        limits, way, gridpoints=grid, parametrizer="ParametrizeConstAccel"
    )
    found = timing.compute_trajectory(0.0, 0.0)
    if found is None:
        allowed = "one along which toppra can go within the limits of the joints"
        raise InputError("trajectory", "too rough", allowed)
    count = max(int(np.ceil(found.duration / step)), 1)
    times = np.append(step * np.arange(count), found.duration)
    return times, np.stack([found(times), found(times, 1), found(times, 2)])


def _limits(name: str, chain: Chain, given: Sequence[float] | None) -> FloatArray:
    values = [joint.velocity for joint in chain.joints] if given is None else given
    missing = [joint for joint, v in zip(chain.names, values, strict=False) if v is None]
    if missing:
        raise InputError(name, "missing", f"one for {missing[0]}, which has none in its file")
    limits = finite_vector(name, values, len(chain.names))
    if not np.all(limits > 0):
        raise InputError(name, limits.tolist(), "numbers above 0")
    return limits


def _duration(seconds: float) -> dict[str, int]:
    nanoseconds = round(seconds * 1e9)
    return {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}
