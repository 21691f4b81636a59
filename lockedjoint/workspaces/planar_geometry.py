"""Two links and a joint between them; unions of intervals; nodes of a quadrature."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from lockedjoint.nlp.arrays import FloatArray

#: A full turn, in radians.
TURN_RAD = 2 * np.pi


@lru_cache
def gauss_nodes(count: int) -> tuple[FloatArray, FloatArray]:
    """Return the nodes and weights of Gauss and Legendre."""
    return np.polynomial.legendre.leggauss(count)


def end_distances(a: float, b: float, limits: tuple[float, float]) -> tuple[float, float]:
    """Return the least and largest distance between the ends of two links, over the range."""
    low, high = within_a_turn(*limits)
    cosines = [np.cos(low), np.cos(high)]
    if (0 - low) % TURN_RAD <= high - low:
        cosines.append(1.0)
    if (np.pi - low) % TURN_RAD <= high - low:
        cosines.append(-1.0)
    squares = [a**2 + b**2 + 2 * a * b * cosine for cosine in cosines]
    return float(np.sqrt(max(min(squares), 0.0))), float(np.sqrt(max(squares)))


def within_a_turn(low: float, high: float) -> tuple[float, float]:
    """Return the limits of a joint, or one full turn if they are farther apart."""
    return (low, high) if high - low < TURN_RAD else (-np.pi, np.pi)


def angle_between_links(a: float, b: float, distance: FloatArray) -> FloatArray:
    """Return the angle of the joint at which the ends of two links are so far apart, 0 to π."""
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = (distance**2 - a**2 - b**2) / (2 * a * b)
    return np.asarray(np.arccos(np.clip(np.nan_to_num(cosine), -1, 1)))


def covered_length(starts: FloatArray, ends: FloatArray) -> FloatArray:
    """Return the length of the union of intervals in each column.

    An empty interval starts after its end, or has an end that is NaN.
    """
    full = starts < ends
    # Most rows are empty in all columns: without them there is less to sort.
    rows = full.any(axis=1)
    full, starts, ends = full[rows], starts[rows], ends[rows]
    starts, ends = np.where(full, starts, np.inf), np.where(full, ends, -np.inf)
    order = np.argsort(starts, axis=0)
    starts, ends = (np.take_along_axis(side, order, axis=0) for side in (starts, ends))
    before = np.full_like(ends, -np.inf)
    before[1:] = np.maximum.accumulate(ends, axis=0)[:-1]
    with np.errstate(invalid="ignore"):
        new = ends - np.maximum(starts, before)
    return np.asarray(np.sum(np.where(np.isfinite(new), np.maximum(new, 0), 0), axis=0))
