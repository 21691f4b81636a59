"""Jacobians classified one after another, by numbers that no symmetry changes.

Sorted moduli of the joints' inner products, and sorted products of three in a cycle, do not
depend on frame, phase, order, signs and mirror image, and change by no more than the inner
products do: Jacobians of one class have equal numbers, and others belong to other classes. They
are compared instead of canonical forms, which take milliseconds each.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
import numpy.typing as npt

from formulations.measures.joint_order import Symmetry, inner_products
from nlp.arrays import FloatArray

# Largest difference of inner products, relative to ‖J‖_F²/n, within a class.
TOLERANCE = 1e-3
# Classes that are distinguished: where optima come in families every start has its own.
MOST = 1000


@dataclass(eq=False)
class Class:
    """A class: the first Jacobian of it, its merit, and how many Jacobians it has."""

    jacobian: FloatArray
    merit: float
    reached: int = 0


class Classes:
    """Classes of the Jacobians added so far; when there are `MOST`, no new ones begin."""

    def __init__(self, symmetry: Symmetry) -> None:
        self._symmetry = symmetry
        self._found: list[Class] = []
        self._numbers = np.zeros((0, 0))

    def add(self, jacobian: FloatArray, merit: float) -> None:
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
            self._found.append(Class(jacobian, merit, 1))
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
