"""What leaves a Jacobian the same, and numbers of it that no symmetry changes.

Two Jacobians are the same manipulator Jacobian when they differ by a rotation or reflection
of the task frame, the order of the joints and the signs of their axes; for unit revolute
joints also by a common phase, (v, ω) → (cosθ v − sinθ ω, sinθ v + cosθ ω), and by the mirror
image (v, −ω). All of it acts on the joints' inner products only by relabelling, signs, phase
and conjugation. `invariants` do not depend on these and change by no more than the inner
products do: Jacobians of one class have equal numbers, and others belong to other classes.
"""

from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from itertools import combinations

import numpy as np
import numpy.typing as npt

from formulations.measures import as_jacobian
from nlp.arrays import FloatArray

# Largest difference of inner products, relative to ‖J‖_F²/n, within a class.
TOLERANCE = 1e-3
# Classes that are distinguished: where optima come in families every start has its own.
MOST = 1000


class Symmetry(Enum):
    """What leaves a Jacobian the same.

    FRAME: J → UJ for any orthogonal U (planar, positional, general screws).
    REVOLUTE: rows are (v; ω), one rotation acts on both, and the mirror image.
    UNIT_REVOLUTE: the same, and the common phase of v and ω.
    """

    FRAME = "frame"
    REVOLUTE = "revolute"
    UNIT_REVOLUTE = "unit-revolute"


def symmetry_of(jacobian: npt.ArrayLike, tolerance: float = 1e-6) -> Symmetry:
    """Return the largest symmetry that the columns allow: by their shape, from J alone."""
    matrix = as_jacobian(jacobian)
    if matrix.shape[0] != 6:
        return Symmetry.FRAME
    velocity, axis = matrix[:3], matrix[3:]
    if np.max(np.abs(np.sum(velocity * axis, axis=0))) > tolerance:
        return Symmetry.FRAME
    gap = np.sum(velocity**2, axis=0) - np.sum(axis**2, axis=0)
    return Symmetry.UNIT_REVOLUTE if np.max(np.abs(gap)) <= tolerance else Symmetry.REVOLUTE


def inner_products(matrix: FloatArray, symmetry: Symmetry) -> npt.NDArray[np.complex128]:
    """Inner products of the joints that no frame changes, shape (kinds, n, n).

    The last kind, z_iᵀz_j for unit revolute joints, turns with twice the phase.
    """
    if symmetry is Symmetry.FRAME:
        return np.array([matrix.T @ matrix], dtype=np.complex128)
    velocity, axis = matrix[:3], matrix[3:]
    if symmetry is Symmetry.REVOLUTE:
        cross = velocity.T @ axis
        kinds = [velocity.T @ velocity, axis.T @ axis, cross, cross.T]
        return np.array(kinds, dtype=np.complex128)
    z = velocity + 1j * axis
    return np.array([z.conj().T @ z, z.T @ z])


def mirror_image(matrix: FloatArray) -> FloatArray:
    """(v, −ω): the mirror image of a spatial arm, signs aside."""
    return np.vstack([matrix[:3], -matrix[3:]])


@dataclass(eq=False)
class Class:
    """A class: the first Jacobian of it, its score, and how many Jacobians it has."""

    jacobian: FloatArray
    score: float
    reached: int = 0


class Classes:
    """Classes of the Jacobians added so far; when there are `MOST`, no new ones begin."""

    def __init__(self, symmetry: Symmetry) -> None:
        self._symmetry = symmetry
        self._found: list[Class] = []
        self._numbers = np.zeros((0, 0))

    def add(self, jacobian: FloatArray, score: float) -> None:
        """Count a Jacobian in its class."""
        numbers = invariants(jacobian, self._symmetry)
        if not self._found:
            self._numbers = np.zeros((0, numbers.size))
        allowed = TOLERANCE * float(np.sum(jacobian**2)) / jacobian.shape[1]
        away = np.max(np.abs(self._numbers - numbers), axis=1, initial=0.0)
        near = np.flatnonzero(away <= allowed)
        if near.size:
            self._found[int(near[0])].reached += 1
        elif len(self._found) < MOST:
            self._found.append(Class(jacobian, score, 1))
            self._numbers = np.vstack([self._numbers, numbers])

    def most_reached(self) -> list[Class]:
        """Return the classes, the most reached first, equal ones in order of arrival."""
        return sorted(self._found, key=lambda one: -one.reached)


def invariants(jacobian: FloatArray, symmetry: Symmetry) -> FloatArray:
    """Return numbers that are the same for all Jacobians of a class, within its tolerance.

    For each kind of inner product: all moduli, sorted; for each joint, the root mean square
    and the largest of those with the others, sorted over joints; and for each three joints
    the product in a cycle, in which signs and phase cancel. None of them changes by more than
    the inner products do.
    """
    products = inner_products(jacobian, symmetry)
    one, two, three = _triples(jacobian.shape[1])
    parts = []
    for kind in products[:2] if symmetry is Symmetry.REVOLUTE else products[:1]:
        size = float(np.max(np.abs(kind))) or 1.0
        cycles = (kind[one, two] * kind[two, three] * kind[three, one]).real
        parts.append(np.sort(cycles / (3 * size**2)))
    # v_i·ω_j and v_j·ω_i are the same kind.
    for kind in np.abs(products[:3]):
        sides = (kind, kind.T)
        parts.append(np.sort(kind, axis=None))
        parts += [np.sort(np.sqrt(np.mean(side**2, axis=1))) for side in sides]
        parts += [np.sort(np.max(side, axis=1)) for side in sides]
    return np.concatenate(parts)


@lru_cache(maxsize=8)
def _triples(joints: int) -> npt.NDArray[np.intp]:
    return np.array(list(combinations(range(joints), 3)), dtype=np.intp).reshape(-1, 3).T
