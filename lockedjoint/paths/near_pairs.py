"""Configurations that are near each other, whole turns of joints not counted."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from lockedjoint.kinematics.geometry import BoolArray, IntArray
from lockedjoint.nlp.arrays import FloatArray

# Least distance of a joint that counts as near: it is also a divisor.
_LEAST_DISTANCE_M_OR_RAD = 1e-9


def near_pairs(
    q: FloatArray, other: FloatArray | None, most: FloatArray, turns: BoolArray
) -> tuple[IntArray, IntArray]:
    """Return the pairs of configurations (n, B) whose joints are at most `most`, (n,), apart.

    Without others each pair among themselves once. Whole turns do not count for the joints that
    are True in `turns`, shape (n, 1). Both results hold numbers of configurations, (pairs,).
    """
    scale = np.maximum(most, _LEAST_DISTANCE_M_OR_RAD)[:, None]
    tree = configuration_tree(q, turns, scale)
    if other is None:
        first, second = tree.query_pairs(1.0, p=np.inf, output_type="ndarray").T
        return first, second
    there = configuration_tree(other, turns, scale)
    pairs = tree.sparse_distance_matrix(there, 1.0, p=np.inf, output_type="coo_matrix")
    return pairs.row.astype(int), pairs.col.astype(int)


def configuration_tree(
    q: FloatArray, turns: BoolArray, scale: FloatArray | float = 1.0
) -> cKDTree:
    """Return a tree of configurations (n, B), in which joints that turn are circles.

    Coordinates are divided by the `scale`, (n, 1), of each joint.
    """
    circle = np.where(turns, 2 * np.pi / scale, 0.0)[:, 0]
    inside = np.where(turns, np.mod(q, 2 * np.pi), q) / scale
    # A rounding error must not put a point beside its circle.
    most = np.where(turns, np.nextafter(circle, 0)[:, None], np.inf)
    return cKDTree(np.minimum(inside, most).T, leafsize=32, boxsize=circle)
