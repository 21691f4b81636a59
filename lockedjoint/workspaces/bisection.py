"""Prove cubes by bisection: halve what is not proved, the interval or the cube.

What comes in: middles of cubes, shape (k, m), m = 2 in the plane and 3 in space, and their half
width, in metres. What goes out: the middles of the cubes, or of parts of them, that are proved.
A half width is half of a cube's edge or of an interval.

`kept_proofs` has the test of one `Pairs`: cubes, each with an interval of positions of the
joint that is locked. What it does not prove is tried again with half the interval or half the
cube, whichever moves the joints more. An interval that is proved for a cube holds for all parts
of the cube.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from lockedjoint.kinematics.geometry import BoolArray, IntArray
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.workspaces.kept_cubes import KeptCubes
from lockedjoint.workspaces.kept_proofs import REACHED, KeptProofs, Pairs

# The number of random starts of the inverse kinematics for a pair. More takes longer, and
# misses fewer configurations: more is proved. No number makes a proof wrong.
_STARTS = 24
#: The number of these starts that look for a better solution after the first.
BETTER_STARTS = 2
# Trials are made together as long as they have at most so many starts: about as many take
# hardly longer than one. It changes no result.
_STARTS_AT_ONCE = 2000
# The least half width of an interval, in radians or metres. If it is smaller, more is tried
# before a cube is halved or given up.
_NARROWEST_HALF_WIDTH = 1e-4
# The number of pairs that are worked on at once: more need more memory.
_PAIRS_AT_ONCE = 20_000
# The test is of cubes a little wider: those of a file are on their grid to a part in 10⁹.
_WIDENED = 1 + 1e-7
# A cube is given up if inverse kinematics misses its middle by so many of its half widths.
_FAR_HALF_WIDTHS = 2.0


def proved_cubes(
    proofs: KeptProofs,
    centre: FloatArray,
    half_width: float,
    levels: int,
    rng: np.random.Generator,
    better_starts: int = BETTER_STARTS,
    wanted: KeptCubes | None = None,
) -> Iterator[FloatArray]:
    """Yield the middles of the cubes that are proved: of the half width, then of half that.

    Parameters
    ----------
    proofs
        The test, which knows the arm and its limits.
    centre, half_width
        Middles of the first cubes, shape (k, m), and their half width, in metres.
    levels
        How often cubes are halved.
    rng
        Where the random starts of inverse kinematics come from.
    better_starts
        How many starts look for a better solution after the first.
    wanted
        Parts are looked at only if they are parts of these cubes, or hold one; by default all.
    """
    half_steps = np.array(list(product((-1, 1), repeat=len(proofs.rows)))) / 2
    pairs = proofs.whole(centre, half_width * _WIDENED)
    for level in range(levels + 1):
        unproved, given_up = _try_to_prove(proofs, pairs, len(centre), rng, better_starts)
        proved = ~given_up
        proved[unproved.cube] = False
        yield centre[proved]
        if level == levels:
            return
        centre, pairs = _halved(
            unproved[~given_up[unproved.cube]], centre, half_width, half_steps
        )
        half_width /= 2
        if wanted is not None:
            centre, pairs = _only_wanted(centre, pairs, half_width, wanted)


def _halved(
    pairs: Pairs, centre: FloatArray, half_width: float, half_steps: FloatArray
) -> tuple[FloatArray, Pairs]:
    """Return the parts of the cubes that pairs are of: their middles, and their pairs.

    A part's middle is a half step, of 2^m, times the half width from that of the whole.
    """
    whole, number = np.unique(pairs.cube, return_inverse=True)
    count = len(half_steps)
    parts = (centre[whole][:, None] + half_width * half_steps).reshape(-1, centre.shape[1])
    return parts, Pairs.joined(
        [
            replace(
                pairs,
                cube=count * number + part,
                centre=pairs.centre + half_width * half_step,
                width=pairs.width / 2,
            )
            for part, half_step in enumerate(half_steps)
        ]
    )


def _only_wanted(
    centre: FloatArray, pairs: Pairs, half_width: float, wanted: KeptCubes
) -> tuple[FloatArray, Pairs]:
    """Return the cubes of one half width, and their pairs, that meet cubes that are wanted."""
    meets = np.zeros(len(centre), dtype=bool)
    for other_half_width in np.unique(wanted.half_width):
        others = wanted.centre[wanted.half_width == other_half_width]
        here, there = cells_of_both(centre, others, max(other_half_width, half_width))
        meets |= np.isin(here, there)
    new_number = np.cumsum(meets) - 1
    pairs = pairs[meets[pairs.cube]]
    return centre[meets], replace(pairs, cube=new_number[pairs.cube])


def cells(centre: FloatArray, half_width: float) -> FloatArray:
    """Return the places, (k, m), of points in the grid of cubes of a half width."""
    return np.asarray(np.floor(centre / (2 * half_width)))


def cells_of_both(
    one: FloatArray, other: FloatArray, half_width: float
) -> tuple[IntArray, IntArray]:
    """Return the numbers of the cells of two lists of points: equal for equal cells."""
    both = np.concatenate([cells(one, half_width), cells(other, half_width)])
    numbers = np.unique(both, axis=0, return_inverse=True)[1].ravel()
    return numbers[: len(one)], numbers[len(one) :]


def _try_to_prove(
    proofs: KeptProofs,
    pairs: Pairs,
    cubes: int,
    rng: np.random.Generator,
    better_starts: int,
) -> tuple[Pairs, BoolArray]:
    """Return the pairs that are not proved, and which of so many cubes are given up.

    Intervals are halved here, cubes are not. Once a pair of a cube needs a smaller cube, its
    other pairs wait for that, too.
    """
    unproved = [pairs[:0]]
    needs_halving, given_up = np.zeros(cubes, bool), np.zeros(cubes, bool)
    while len(pairs):
        next_pairs = [pairs[:0]]
        for first in range(0, len(pairs), _PAIRS_AT_ONCE):
            some = pairs[first : first + _PAIRS_AT_ONCE]
            waits = needs_halving[some.cube]
            unproved.append(some[waits])
            tried = _attempt(proofs, some[~waits], rng, better_starts)
            some = tried.pairs
            far = tried.missed > _FAR_HALF_WIDTHS * some.width
            given_up[some.cube[far]] = True
            wide = some.half > 2 * _NARROWEST_HALF_WIDTH
            halve_interval = (
                ~tried.proved & (tried.missed <= REACHED) & tried.interval_hinders & wide
            )
            halve_cube = some[~tried.proved & ~halve_interval]
            unproved.append(halve_cube)
            needs_halving[halve_cube.cube] = True
            half = replace(some[halve_interval], half=some.half[halve_interval] / 2)
            next_pairs += [
                replace(half, middle=half.middle + side * half.half) for side in (-1, 1)
            ]
        pairs = Pairs.joined(next_pairs)
    return Pairs.joined(unproved), given_up


@dataclass(frozen=True, eq=False)
class _Attempt:
    """What comes of an attempt to prove k pairs; each array has shape (k,)."""

    pairs: Pairs  #: With the best configurations that are found.
    proved: BoolArray
    missed: FloatArray  #: The distance from the middle of the cube, in metres.
    interval_hinders: BoolArray  #: Whether the interval moves the joints more than the cube.


def _attempt(
    proofs: KeptProofs, pairs: Pairs, rng: np.random.Generator, better_starts: int
) -> _Attempt:
    """Look for configurations that reach the middles, and try to prove the pairs from them.

    The first trial starts from the configurations that are known, the others at random.
    """
    least, most = proofs.drawn_from(pairs)
    count = len(pairs)
    q, hardness = pairs.q.copy(), np.full(count, np.inf)
    proved, interval_hinders = np.zeros(count, bool), np.zeros(count, bool)
    missed = np.full(count, np.inf)
    trial, trials, together = 0, max(_STARTS, better_starts) + 1, 1
    while trial < trials:
        open_pairs = ~proved
        if trial > better_starts:
            open_pairs &= missed > REACHED
        if trial == 0:
            open_pairs &= ~np.isnan(pairs.q[:, 0])
        at = np.flatnonzero(open_pairs)
        if not at.size:
            trial += 1
            continue
        # Now only a pair that is reached changes which are tried: trials are made together.
        at_once = min(together, trials - trial, _STARTS_AT_ONCE // len(at) or 1)
        size = at_once if trial > better_starts else 1
        drawn, states = [], []
        for _ in range(size):
            # The first trial draws, too, so that what a seed finds stays the same.
            shares = rng.random((proofs.n, len(at)))
            drawn.append(least[:, at] + (most - least)[:, at] * shares)
            states.append(rng.bit_generator.state)
        some = pairs[np.tile(at, size)]
        start = some.q.T if trial == 0 else np.concatenate(drawn, axis=1)
        found, distance = proofs.reached(some, start)
        rounds = distance.reshape(size, len(at))
        hits = np.flatnonzero((rounds <= REACHED).any(axis=1))
        # The trials after one that reached a pair would have had other starts.
        used = int(hits[0]) + 1 if hits.size else size
        rng.bit_generator.state = states[used - 1]
        trial += used
        together = 1 if hits.size else 2 * together
        missed[at] = np.minimum(missed[at], rounds[:used].min(axis=0))
        reached = rounds[used - 1] <= REACHED
        if not reached.any():
            continue
        last = slice((used - 1) * len(at), used * len(at))
        at, some = at[reached], replace(some[last], q=found.T[last])[reached]
        holds, hard, hinders = proofs.hold(some)
        better = holds | (hard < hardness[at])
        at, some = at[better], some[better]
        q[at], hardness[at] = some.q, hard[better]
        proved[at], interval_hinders[at] = holds[better], hinders[better]
    return _Attempt(replace(pairs, q=q), proved, missed, interval_hinders)
