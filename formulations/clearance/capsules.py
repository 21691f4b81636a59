"""Capsules around links, and the distance of two of their segments in CasADi.

It is for the nonlinear program; the check is by another formula, `segment_distance` in NumPy.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from formulations.clearance.shapes import Shape, solid
from nlp.arrays import FloatArray

# A cylinder's rim as so many points, on a circle that is larger by as much as they cut off.
_RIM = 32
# Added to radii: rounding.
_MARGIN = 1e-6
# Added to squared lengths of segments, in square metres: a point is a segment, too.
_TINY = 1e-10


@dataclass(frozen=True, eq=False)
class Capsule:
    """Points within a radius of a segment, in metres, in a body's frame."""

    start: FloatArray
    end: FloatArray
    radius: float


def capsule_around(shapes: Sequence[Shape], pose: FloatArray) -> Capsule:
    """Return a capsule around a link's geometry, in the frame of the link's body.

    The smallest of those along the axes of the link's frame and along the principal axes of the
    points.

    Parameters
    ----------
    shapes
        The geometry.
    pose
        Of the link in the body's frame, 4×4.
    """
    clouds = [_points(shape) for shape in shapes]
    points = np.concatenate([cloud for cloud, _ in clouds])
    extra = np.concatenate([np.full(len(cloud), around) for cloud, around in clouds])
    principal = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    fits = [_along(axis, points, extra) for axis in (*np.eye(3), *principal)]
    best = min(fits, key=_volume)
    rotation, origin = pose[:3, :3], pose[:3, 3]
    start, end = (rotation @ point + origin for point in (best.start, best.end))
    return Capsule(start, end, best.radius + _MARGIN)


def _points(shape: Shape) -> tuple[FloatArray, float]:
    """Points, shape (k, 3) in the link's frame, and how far around them the shape may reach."""
    around = 0.0
    if shape.kind == "sphere":
        points, around = np.zeros((1, 3)), shape.size[0]
    elif shape.kind == "box":
        corners = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5])).reshape(3, -1)
        points = corners.T * np.array(shape.size)
    elif shape.kind == "cylinder":
        angle = 2 * np.pi * np.arange(_RIM) / _RIM
        radius, half = shape.size[0] / np.cos(np.pi / _RIM), np.full(_RIM, shape.size[1] / 2)
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        points = np.concatenate([np.stack([x, y, z], axis=1) for z in (half, -half)])
    else:
        points = np.asarray(solid(shape).vertices(), dtype=float).reshape(-1, 3)
        with suppress(QhullError):  # where all are in one plane, all are taken
            points = points[ConvexHull(points).vertices]
    return points @ shape.pose[:3, :3].T + shape.pose[:3, 3], around


def _along(axis: FloatArray, points: FloatArray, extra: FloatArray) -> Capsule:
    """Return a capsule along an axis around points, each with a sphere about it."""
    across = np.linalg.svd(axis[None])[2][1:]
    plane, height = points @ across.T, points @ axis
    centre = plane.mean(axis=0)
    # Badoiu and Clarkson: towards the farthest point by ever smaller steps.
    for step in range(1, 200):
        far = plane[np.argmax(np.linalg.norm(plane - centre, axis=1) + extra)]
        centre = centre + (far - centre) / (step + 1)
    off = np.linalg.norm(plane - centre, axis=1)
    radius = float(np.max(off + extra))
    reach = np.sqrt(np.maximum((radius - extra) ** 2 - off**2, 0.0))
    low, high = float(np.min(height + reach)), float(np.max(height - reach))
    low, high = (low, high) if low < high else ((low + high) / 2,) * 2
    middle = centre @ across
    return Capsule(middle + low * axis, middle + high * axis, radius)


def _volume(capsule: Capsule) -> float:
    length = float(np.linalg.norm(capsule.end - capsule.start))
    return capsule.radius**2 * (length + 4 / 3 * capsule.radius)


def gap_squared(a: ca.SX, b: ca.SX, c: ca.SX, d: ca.SX) -> ca.SX:
    """Squared distance of the segments a–b and c–d.

    C. Ericson, "Real-Time Collision Detection" (2005), section 5.1.9.
    """
    u, v, w = b - a, d - c, a - c
    uu, vv, uv = ca.sumsqr(u) + _TINY, ca.sumsqr(v) + _TINY, ca.dot(u, v)
    uw, vw = ca.dot(u, w), ca.dot(v, w)
    s = _within((uv * vw - vv * uw) / (uu * vv - uv**2 + _TINY * uu))
    t = _within((uv * s + vw) / vv)
    s = _within((uv * t - uw) / uu)
    return ca.sumsqr(w + s * u - t * v)


def _within(share: ca.SX) -> ca.SX:
    return ca.fmin(ca.fmax(share, 0), 1)
