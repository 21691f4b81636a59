"""What a solver returns: pseudo-moments, multipliers and its own words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from formulations.bounds.so3_moments.representations.clebsch_gordan import Floats


@dataclass(frozen=True, eq=False)
class ConicOutcome:
    """The answer of a solver, unchecked.

    Parameters
    ----------
    moments
        y_1, y_2, …, or None if there is no answer.
    multipliers
        X of each block, symmetric, or None if there is no answer.
    status
        What the solver said, whole.
    iterations
        Number of iterations, if known.
    """

    moments: Floats | None
    multipliers: tuple[Floats, ...] | None
    status: str
    iterations: int | None = None


def nearest_semidefinite(matrix: Floats) -> tuple[Floats, float]:
    """Return the nearest positive semidefinite matrix and the smallest eigenvalue before."""
    if not len(matrix):
        return matrix, 0.0
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(root @ root.T), float(values[0])
