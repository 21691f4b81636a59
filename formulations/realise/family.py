"""The manipulators that share one Jacobian: orders and flips, all of them or by a search."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations, permutations, product
from math import factorial

import numpy as np
import numpy.typing as npt

from formulations.realise.manipulator import Manipulator
from formulations.realise.motion import BoolArray
from nlp.arrays import FloatArray

IntArray = npt.NDArray[np.int64]
# Random arrangements that the local search starts from.
STARTS = 32


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
    axes = manipulator.rearranged(arrangements.orders, arrangements.flips)
    return Family(*axes, manipulator.end_effector, manipulator.task.rows, manipulator.size)


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


def search(
    manipulator: Manipulator,
    cost: Callable[[Arrangements], FloatArray],
    seed: int,
    keep: int,
    starts: int = STARTS,
) -> Arrangements:
    """Return the `keep` cheapest arrangements seen, the cheapest first.

    Steepest descent from random arrangements: each step tries every exchange of two joints,
    every move of one joint to another place and every flip, and takes the best, until none is
    better. A heuristic: the best arrangement of all need not be among those seen.
    """
    free = flippable(manipulator)
    rng = np.random.default_rng(seed)
    seen: dict[tuple[tuple[int, ...], tuple[bool, ...]], float] = {}
    for _ in range(starts):
        order = rng.permutation(manipulator.joints)
        flips = (rng.integers(2, size=len(order)) == 1) & free[order]
        here = Arrangements(order[None], flips[None])
        value = float(cost(here)[0])
        while True:
            near = _neighbours(here, free)
            values = cost(near)
            for row, turned, one in zip(near.orders, near.flips, values, strict=True):
                seen[tuple(row.tolist()), tuple(turned.tolist())] = float(one)
            best = int(np.argmin(values))
            if values[best] >= value - 1e-12 * abs(value):
                seen[tuple(here.orders[0].tolist()), tuple(here.flips[0].tolist())] = value
                break
            here, value = near[[best]], float(values[best])
    cheapest = sorted(seen, key=lambda key: (seen[key], key))[:keep]
    orders, turns = zip(*cheapest, strict=True)
    return Arrangements(np.array(orders, dtype=np.int64), np.array(turns, dtype=bool))


def _neighbours(here: Arrangements, free: BoolArray) -> Arrangements:
    order, flip = here.orders[0], here.flips[0]
    n = len(order)
    places = [np.arange(n)]
    for i, j in combinations(range(n), 2):
        exchanged = np.arange(n)
        exchanged[[i, j]] = j, i
        places.append(exchanged)
        for source, target in ((i, j), (j, i)):
            places.append(np.insert(np.delete(np.arange(n), source), target, source))
    moved = np.array(places)
    turnable = np.flatnonzero(free[order])
    turned = np.tile(flip, (len(turnable), 1))
    turned[np.arange(len(turnable)), turnable] ^= True
    same = np.tile(order, (len(turnable), 1))
    return Arrangements(np.vstack([order[moved], same]), np.vstack([flip[moved], turned]))
