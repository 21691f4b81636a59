"""Look for cheap arrangements of a manipulator's joints, where there are too many to try all.

What comes in: a manipulator and a function that gives arrangements their costs. What goes out:
the cheapest arrangements that were seen. To let the search take other steps, change
`_neighbours`.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np

from lockedjoint.kinematics.geometry import BoolArray
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.progress import Progress, Step
from lockedjoint.synthesis.family import Arrangements, flippable
from lockedjoint.synthesis.manipulator import Manipulator

# Number of random arrangements that the local search starts from: more find better ones.
STARTS = 32
# Least gain of a step, as a share of the cost: less is rounding.
_LEAST_GAIN = 1e-12


def search(
    manipulator: Manipulator,
    cost: Callable[[Arrangements], FloatArray],
    seed: int,
    keep: int,
    starts: int = STARTS,
    progress: Progress = lambda _: None,
) -> Arrangements:
    """Return the `keep` cheapest arrangements seen, the cheapest first.

    Steepest descent from random arrangements: each step tries every exchange of two joints,
    every move of one joint to another place and every flip, and takes the best, until none is
    better. A heuristic: the best arrangement of all need not be among those seen.

    Parameters
    ----------
    manipulator
        The joints, n of them.
    cost
        Function that returns the costs of N arrangements, shape (N,).
    seed
        Random seed of the starts.
    keep, starts
        Number of arrangements to return, and of random starts.
    progress
        A function that is told what is being done.
    """
    may_flip, rng = flippable(manipulator), np.random.default_rng(seed)
    rows, costs = [], []
    for number in range(starts):
        progress(Step(f"local search {number + 1} of {starts}", number / starts))
        order = rng.permutation(manipulator.joints)
        flips = (rng.integers(2, size=len(order)) == 1) & may_flip[order]
        here = Arrangements(order[None], flips[None])
        while True:
            near = _neighbours(here, may_flip)
            near_costs = cost(near)
            rows.append(np.hstack([near.orders, near.flips]))
            costs.append(near_costs)
            # The first neighbour is the arrangement itself.
            best, own_cost = int(np.argmin(near_costs)), float(near_costs[0])
            if near_costs[best] >= own_cost - _LEAST_GAIN * abs(own_cost):
                break
            here = near[[best]]
    # The last cost of an arrangement that was seen several times counts.
    seen, places = np.unique(np.vstack(rows)[::-1], axis=0, return_index=True)
    cheapest = np.argsort(np.concatenate(costs)[::-1][places], kind="stable")[:keep]
    orders, flips_seen = np.hsplit(seen[cheapest], 2)
    return Arrangements(orders, flips_seen.astype(bool))


def _neighbours(here: Arrangements, may_flip: BoolArray) -> Arrangements:
    """Return an arrangement itself, and then all that one step leads to.

    `here` is one arrangement, shape (1, n); `may_flip`, shape (n,), says which joints of the
    manipulator a flip moves.
    """
    order, flip = here.orders[0], here.flips[0]
    n = len(order)
    places = [np.arange(n)]
    for i, j in combinations(range(n), 2):
        exchanged = np.arange(n)
        exchanged[[i, j]] = j, i
        moves = (np.insert(np.delete(np.arange(n), a), b, a) for a, b in ((i, j), (j, i)))
        places += [exchanged, *moves]
    moved = np.array(places)
    flipped = flip ^ np.eye(n, dtype=bool)[may_flip[order]]
    same_order = np.tile(order, (len(flipped), 1))
    orders = np.vstack([order[moved], same_order])
    return Arrangements(orders, np.vstack([flip[moved], flipped]))
