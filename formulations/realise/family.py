"""The manipulators that share one Jacobian: orders and flips, many side by side."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product
from math import factorial

import numpy as np
import numpy.typing as npt

from formulations.realise.manipulator import Manipulator
from formulations.realise.motion import BoolArray
from nlp.arrays import FloatArray

IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Arrangements:
    """Orders and flips of the joints of one manipulator, as `Manipulator.arranged` takes them.

    Attributes
    ----------
    orders
        Shape (N, n), whole numbers.
    flips
        Shape (N, n).
    """

    orders: IntArray
    flips: BoolArray

    def __len__(self) -> int:
        return len(self.orders)

    def __getitem__(self, chosen: npt.ArrayLike | slice) -> Arrangements:
        which = chosen if isinstance(chosen, slice) else np.asarray(chosen)
        return Arrangements(self.orders[which], self.flips[which])


@dataclass(frozen=True, eq=False)
class Family:
    """Manipulators side by side: N of them, with n joints each.

    Attributes
    ----------
    directions, points
        Axes and where joints sit, shape (N, n, 3).
    prismatic
        Shape (N, n).
    end_effector
        Shape (3,), common to all.
    rows
        Rows of (v; ω) that the task needs.
    size
        The `Manipulator.size` of the manipulator they came from.
    """

    directions: FloatArray
    points: FloatArray
    prismatic: BoolArray
    end_effector: FloatArray
    rows: tuple[int, ...]
    size: float


def family(manipulator: Manipulator, arrangements: Arrangements) -> Family:
    """Return the geometry of all arrangements of a manipulator."""
    orders, flips = arrangements.orders, arrangements.flips
    tip = manipulator.end_effector
    prismatic = manipulator.prismatic[orders]
    points = manipulator.points[orders]
    if manipulator.task.free_directions:
        reflected = (flips & ~prismatic)[..., None]
        points = np.where(reflected, 2 * tip - points, points)
    directions = np.where(flips[..., None], -1.0, 1.0) * manipulator.directions[orders]
    rows = manipulator.task.rows
    return Family(directions, points, prismatic, tip, rows, manipulator.size)


def flippable(manipulator: Manipulator) -> BoolArray:
    """Which joints a flip moves to another place, shape (n,).

    Revolute joints of planar and positional tasks whose axis does not pass through the end
    effector. Any other flip only changes the sign of a joint's displacement.
    """
    if not manipulator.task.free_directions:
        return np.zeros(manipulator.joints, dtype=bool)
    lever = np.linalg.norm(manipulator.points - manipulator.end_effector, axis=1)
    return np.asarray(~manipulator.prismatic & (lever > 1e-9 * manipulator.size))


def count(manipulator: Manipulator) -> int:
    """Return the number of orders and of flips that move a joint: n!·2ᶠ arrangements."""
    return factorial(manipulator.joints) << int(np.sum(flippable(manipulator)))


def every(manipulator: Manipulator) -> Arrangements:
    """Return all n!·2ᶠ arrangements, in lexicographic order."""
    n, free = manipulator.joints, flippable(manipulator)
    orders = np.array(list(permutations(range(n))), dtype=np.int64)
    choices = [(False, True) if can else (False,) for can in free]
    flips = np.array(list(product(*choices)), dtype=bool)
    repeated = np.repeat(orders, len(flips), axis=0)
    tiled = np.tile(flips, (len(orders), 1))
    return Arrangements(repeated, np.take_along_axis(tiled, repeated, axis=1))
