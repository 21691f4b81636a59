"""What is left of a Jacobian after each set of joints locks (eq. 5)."""

from collections.abc import Collection
from itertools import combinations
from math import comb

import numpy as np
import numpy.typing as npt

from formulations.measures.jacobian import as_jacobian, numerical_rank, singular_values
from nlp.arrays import FloatArray, whole_number
from nlp.errors import InputError

# More sets of locked joints than this are refused: each takes a singular value decomposition.
MOST_SETS = 100_000
# Entries of J that are decomposed at once.
_CHUNK = 1_000_000


def locked_sets(matrix: FloatArray, locked: int) -> list[tuple[int, ...]]:
    """Return every set of `locked` joints in lexicographic order; InputError if too many."""
    n = matrix.shape[1]
    if whole_number("locked joints", locked, 1) >= n:
        raise InputError("locked joints", locked, f"fewer than the {n} joints")
    check_sets(n, locked)
    return list(combinations(range(n), locked))


def check_sets(joints: int, locked: int, most: int = MOST_SETS) -> None:
    """Raise InputError if more than `most` sets of `locked` joints can be chosen."""
    sets = comb(joints, locked)
    if sets > most:
        allowed = f"numbers with at most {most} sets of joints that lock at once"
        count = sets if sets < 10**15 else "over 10**15"
        shown = f"{locked} of {joints}, which are {count} sets"
        raise InputError("locked joints", shown, allowed)


def locked_singular_values(jacobian: npt.ArrayLike, locked: int = 1) -> FloatArray:
    """Smallest singular value after each set of `locked` joints locks (eq. 5).

    Returns
    -------
    numpy.ndarray
        Shape (C(n, locked),), sets in lexicographic order; zero where fewer than m
        columns are left.
    """
    matrix = as_jacobian(jacobian)
    sets = locked_sets(matrix, locked)
    if matrix.shape[1] - locked < matrix.shape[0]:
        return np.zeros(len(sets))
    return remaining_singular_values(matrix, sets)[:, -1]


def remaining_singular_values(
    matrix: FloatArray, sets: Collection[tuple[int, ...]]
) -> FloatArray:
    """Singular values of J without the columns of each set, shape (sets, m), descending.

    All sets have one size, which leaves at least m columns.
    """
    size = max(1, _CHUNK // matrix.size)  # memory stays bounded, however many sets there are
    ordered = list(sets)
    parts = [
        np.linalg.svd(
            np.array([np.delete(matrix, one, axis=1) for one in ordered[k : k + size]]),
            compute_uv=False,
        )
        for k in range(0, len(ordered), size)
    ]
    return np.concatenate(parts)


def relative_manipulability(jacobian: npt.ArrayLike, locked: int = 1) -> FloatArray:
    """Manipulability after each set of joints locks, over that before; NaN if rank was lost."""
    matrix = as_jacobian(jacobian)
    sets, before = locked_sets(matrix, locked), singular_values(matrix)
    if numerical_rank(before, matrix) < matrix.shape[0]:
        return np.full(len(sets), np.nan)
    if locked > matrix.shape[1] - matrix.shape[0]:
        return np.zeros(len(sets))
    return np.asarray(np.prod(remaining_singular_values(matrix, sets) / before, axis=1))
