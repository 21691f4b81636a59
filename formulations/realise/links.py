"""Links: straight pieces from joint to joint, the last one to the end effector.

A joint sits at one point of its axis: the one nearest to the end effector, unless
`slide` moves it. The length of a link is the distance between the two points where its joints
sit. What lies before the first joint is the base and no link. Arrays broadcast over leading
dimensions.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np

from formulations.realise.manipulator import Manipulator
from nlp.arrays import FloatArray

SWEEPS = 200
# Joints closer than this, relative to the arm's length, are in one place.
TOUCHING = 1e-6


def link_lengths(points: FloatArray, end_effector: FloatArray) -> FloatArray:
    """Lengths of the links, shape (…, n)."""
    return np.asarray(np.linalg.norm(_ends(points, end_effector) - points, axis=-1))


def clearance(points: FloatArray, end_effector: FloatArray) -> FloatArray:
    """Smallest distance between two links that do not meet at a joint; infinity if all do.

    Links meet at a joint also where joints in one place lie between them (axes that intersect
    there, as in a universal joint).
    """
    ends = _ends(points, end_effector)
    lengths = link_lengths(points, end_effector)
    total = lengths.sum(axis=-1)
    smallest = np.full(points.shape[:-2], np.inf)
    for i, j in combinations(range(points.shape[-2]), 2):
        apart = lengths[..., i + 1 : j].sum(axis=-1) > TOUCHING * total
        segments = (points[..., i, :], ends[..., i, :], points[..., j, :], ends[..., j, :])
        distance = np.where(apart, segment_distance(*segments), np.inf)
        smallest = np.minimum(smallest, distance)
    return smallest


def segment_distance(
    start: FloatArray, end: FloatArray, other_start: FloatArray, other_end: FloatArray
) -> FloatArray:
    """Distance between two segments, shape (…): of interiors, or of an end and a segment."""
    one, two, gap = end - start, other_end - other_start, other_start - start
    cross = np.cross(one, two)
    square = np.sum(cross**2, axis=-1)
    size = np.sum(one**2, axis=-1) * np.sum(two**2, axis=-1)
    skew = square > 1e-20 * size
    safe = np.where(skew, square, 1.0)
    s = np.sum(np.cross(gap, two) * cross, axis=-1) / safe
    t = np.sum(np.cross(gap, one) * cross, axis=-1) / safe
    inside = skew & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    between = np.abs(np.sum(gap * cross, axis=-1)) / np.sqrt(safe)
    ends = np.minimum(
        np.minimum(_to(start, other_start, other_end), _to(end, other_start, other_end)),
        np.minimum(_to(other_start, start, end), _to(other_end, start, end)),
    )
    return np.asarray(np.where(inside, between, ends))


def slide(manipulator: Manipulator) -> Manipulator:
    """Return the manipulator with its joints slid along their axes, to the least total length.

    The Jacobian stays as it is. The total length is convex in the points; each in turn goes
    to the best place between its neighbours (Heron's: unfold the three into one plane and draw
    a straight line), until nothing moves.
    """
    axes, points = manipulator.directions, manipulator.points.copy()
    n = manipulator.joints
    for _ in range(SWEEPS):
        before = points.copy()
        for i in range(n):
            after = manipulator.end_effector if i == n - 1 else points[i + 1]
            ahead, off = _along(after, points[i], axes[i])
            if i == 0:
                points[i] = points[i] + ahead * axes[i]
                continue
            behind, away = _along(points[i - 1], points[i], axes[i])
            if off + away > 0:
                points[i] = points[i] + (behind * off + ahead * away) / (off + away) * axes[i]
        if np.max(np.abs(points - before)) < 1e-12 * manipulator.size:
            break
    return replace(manipulator, points=points)


def _along(target: FloatArray, point: FloatArray, axis: FloatArray) -> tuple[float, float]:
    """How far along the axis the foot of a target is, and how far off the axis the target."""
    offset = target - point
    ahead = float(offset @ axis)
    return ahead, float(np.linalg.norm(offset - ahead * axis))


def _ends(points: FloatArray, end_effector: FloatArray) -> FloatArray:
    tip = np.broadcast_to(end_effector, (*points.shape[:-2], 1, 3))
    return np.concatenate([points[..., 1:, :], tip], axis=-2)


def _to(point: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Distance from a point to a segment."""
    span = end - start
    square = np.sum(span**2, axis=-1, keepdims=True)
    part = np.sum((point - start) * span, axis=-1, keepdims=True)
    part = part / np.where(square > 0, square, 1)
    return np.asarray(np.linalg.norm(point - start - np.clip(part, 0, 1) * span, axis=-1))
