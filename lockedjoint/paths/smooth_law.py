"""A way in time, as fast as limits of velocity, acceleration and jerk allow.

TOPP-RA's time is the least under limits of velocity and acceleration, by constant accelerations
along the way. They are made smooth by means over two windows of time, see `time_law`: the
narrower window is one step of the points; the wider one too, or with limits of jerk as wide as
makes the whole the shortest. Then time is stretched until the limits hold between points, too.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from lockedjoint.formulations.io.objects import library
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError
from lockedjoint.paths.motion_limits import TOPPRA, MotionLimits
from lockedjoint.paths.quintic import Quintic
from lockedjoint.paths.time_law import TimeLaw

# TOPP-RA's grid has so many points between two samples.
_GRID_POINTS = 10
# With limits of jerk so many widths of the wider window are tried, up to the whole duration.
_WIDTHS = 24
# Points are not nearer than this to each other, in nanoseconds, where nothing moves either.
_SHORTEST_STEP_NS = 1000


def time_law(q: FloatArray, limits: MotionLimits) -> TimeLaw:
    """Return TOPP-RA's law along a spline through q, shape (N, n), from rest to rest.

    InputError if it finds none.
    """
    toppra = library(*TOPPRA)
    algorithm, constraint = toppra.algorithm, toppra.constraint
    fastest, strongest = limits.velocity, limits.acceleration
    # The parameter is the length of the way in joint space, each joint by its speed.
    lengths = np.linalg.norm(np.diff(q, axis=0) / fastest, axis=1)
    place = np.concatenate(([0.0], np.cumsum(np.maximum(lengths, 1e-9))))
    way = toppra.SplineInterpolator(place, q, bc_type="natural")
    bounds = [
        constraint.JointVelocityConstraint(np.column_stack((-fastest, fastest))),
        constraint.JointAccelerationConstraint(
            np.column_stack((-strongest, strongest)),
            discretization_scheme=constraint.DiscretizationType.Interpolation,
        ),
    ]
    grid = np.interp(
        np.arange(_GRID_POINTS * (len(q) - 1) + 1) / _GRID_POINTS, np.arange(len(q)), place
    )
    found = algorithm.TOPPRA(bounds, way, gridpoints=grid)
    _, speeds, _ = found.compute_parameterization(0.0, 0.0)
    if speeds is None or not np.all(np.isfinite(speeds)):
        allowed = "one along which toppra can go within the limits of the joints"
        raise InputError("trajectory", "too rough", allowed)
    return TimeLaw.of(CubicSpline(place, q, bc_type="natural"), grid, speeds)


def smooth_points(
    law: TimeLaw, limits: MotionLimits, step: float, least: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times (N,) and positions, velocities and accelerations (3, N, n) of points.

    They are about a step apart, and at least so many; the limits hold between them, too. Last
    comes where the points are, (N,), counted in the samples of the way from 0.
    """
    tries = [_points(law, limits, step, least, width) for width in _widths(law, limits, step)]
    return min(tries, key=lambda one: float(one[0][-1]))


def _widths(law: TimeLaw, limits: MotionLimits, step: float) -> list[float]:
    """Return widths of the wider window to try, seconds; 0 for a step of the points."""
    if limits.jerk is None:
        return [0.0]
    # Points are at most a step apart: no window is narrower than one of them.
    widths = np.geomspace(step, max(2 * step, law.duration), _WIDTHS)
    return [0.0, *widths.tolist()]


def _points(
    law: TimeLaw, limits: MotionLimits, step: float, least: int, width: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return points with a window of a width, stretched in time until limits hold."""
    whole = law.duration + width
    # The windows make the whole longer by one step, or by two.
    more = 1 if width else 2
    count = max(int(np.ceil(whole / step)) + more, least)
    span = whole / (count - more)
    smooth = law.smoothed(max(width, span), span)
    times: FloatArray = span * np.arange(count + 1, dtype=float)
    states = smooth.states(times)[:3]
    # It is at rest at both ends but for rounding.
    states[1:, [0, -1]] = 0.0
    velocity, acceleration, jerk = limits.shares(Quintic.through(times, states).largest())
    slower = max(1.0, velocity, float(np.sqrt(acceleration)), float(np.cbrt(jerk)))
    # Messages of ROS have whole nanoseconds: of other times the limits would not hold there.
    nanoseconds = max(int(np.ceil(span * slower * 1e9)), _SHORTEST_STEP_NS)
    stretch = (1e-9 * nanoseconds / span) ** np.arange(3)[:, None, None]
    samples = law.way.x
    # Differences of integrals are rounded: places must not fall.
    places = np.maximum.accumulate(smooth.places(times))
    where = np.interp(places, samples, np.arange(len(samples)))
    return nanoseconds * np.arange(count + 1) / 1e9, states / stretch, where
