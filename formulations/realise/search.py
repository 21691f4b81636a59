"""Seeded local search over arrangements, for arms with too many of them to try all."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np

from formulations.realise.family import Arrangements, flippable
from formulations.realise.manipulator import Manipulator
from formulations.realise.motion import BoolArray
from nlp.arrays import FloatArray

STARTS = 32


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
    better. A heuristic: nothing says that the best arrangement is among those seen.
    """
    free = flippable(manipulator)
    rng = np.random.default_rng(seed)
    seen: dict[tuple[tuple[int, ...], tuple[bool, ...]], float] = {}
    for _ in range(starts):
        order = rng.permutation(manipulator.joints)
        here = Arrangements(
            order[None], (rng.integers(2, size=len(order)) == 1)[None] & free[order]
        )
        value = float(cost(here)[0])
        while True:
            near = _neighbours(here, free)
            values = cost(near)
            for row, flips, one in zip(near.orders, near.flips, values, strict=True):
                seen[tuple(row.tolist()), tuple(flips.tolist())] = float(one)
            best = int(np.argmin(values))
            if values[best] >= value - 1e-12 * abs(value):
                seen[tuple(here.orders[0].tolist()), tuple(here.flips[0].tolist())] = value
                break
            here, value = near[[best]], float(values[best])
    cheapest = sorted(seen, key=lambda key: (seen[key], key))[:keep]
    return Arrangements(
        np.array([order for order, _ in cheapest], dtype=np.int64),
        np.array([flips for _, flips in cheapest], dtype=bool),
    )


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
    orders, flips = order[moved], flip[moved]
    turnable = np.flatnonzero(free[order])
    turned = np.tile(flip, (len(turnable), 1))
    turned[np.arange(len(turnable)), turnable] ^= True
    same = np.tile(order, (len(turnable), 1))
    return Arrangements(np.vstack([orders, same]), np.vstack([flips, turned]))
