"""The worst failure, and the direction that it hurts most."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from formulations.measures.jacobian import (
    as_jacobian,
    locked_sets,
    locked_singular_values,
)
from nlp.arrays import FloatArray, as_floats
from nlp.errors import InputError

# Failures tie when they leave the same to this share of it, or of the largest entry of J.
TIE = 1e-6


@dataclass(frozen=True, eq=False)
class WorstCase:
    """The worst set of locked joints.

    Attributes
    ----------
    sigma
        Smallest singular value that is left (eq. 5).
    joints
        The locked joints that leave it, counted from 0; the first such set on a tie.
    sets
        Every set of locked joints that leaves no more than that, to a relative `TIE`.
    direction
        End-effector direction that suffers most when `joints` lock, a unit vector of shape
        (m,) (eq. 15), its largest entry positive.
    """

    sigma: float
    joints: tuple[int, ...]
    sets: tuple[tuple[int, ...], ...]
    direction: FloatArray

    def to_dict(self) -> dict[str, object]:
        """Return plain values for tables and JSON."""
        return {
            "sigma": self.sigma,
            "joints": list(self.joints),
            "sets": [list(joints) for joints in self.sets],
            "direction": self.direction.tolist(),
        }


def worst_case_sigma(jacobian: npt.ArrayLike, locked: int = 1) -> float:
    """Worst case over sets of locked joints of the smallest singular value (eq. 5)."""
    return float(np.min(locked_singular_values(jacobian, locked)))


def worst_case(jacobian: npt.ArrayLike, locked: int = 1) -> WorstCase:
    """Worst set of `locked` joints, and the direction that it hurts most (eqs. 5 and 15)."""
    matrix = as_jacobian(jacobian)
    sets, sigmas = locked_sets(matrix, locked), locked_singular_values(matrix, locked)
    worst = int(np.argmin(sigmas))
    limit = sigmas[worst] + TIE * max(float(sigmas[worst]), float(np.max(np.abs(matrix))))
    tied = tuple(joints for joints, sigma in zip(sets, sigmas, strict=True) if sigma <= limit)
    direction = weakest_direction(np.delete(matrix, sets[worst], axis=1))
    return WorstCase(float(sigmas[worst]), sets[worst], tied, direction)


def weakest_direction(matrix: FloatArray) -> FloatArray:
    """Left singular vector of the smallest singular value, its largest entry positive."""
    matrix = as_floats("matrix", matrix)
    if matrix.ndim != 2 or not len(matrix) or not np.all(np.isfinite(matrix)):
        raise InputError("matrix", f"of shape {matrix.shape}", "a matrix of finite numbers")
    direction = np.linalg.svd(matrix)[0][:, -1]
    return np.asarray(direction * np.sign(direction[np.argmax(np.abs(direction))]))
