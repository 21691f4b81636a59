"""The workspace that is kept for certain: cubes of positions, by bisection.

`kept_proofs` has the test. What it does not prove is tried again with half the interval of the
locked joint, or half the cube, whichever moves the joints more. An interval that is proved for
a cube holds for all its parts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.geometry import BoolArray, IntArray
from lockedjoint.kinematics.serial_chain import Ranges, from_first_joint
from lockedjoint.nlp.arrays import FloatArray, real_number, whole_number
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.executors import in_groups
from lockedjoint.workspaces.kept_cubes import KeptCubes, on_one_grid
from lockedjoint.workspaces.kept_proofs import REACHED, KeptProofs, Pairs
from lockedjoint.workspaces.workspace import check_limits

# The number of random starts of the inverse kinematics for a pair.
_STARTS = 24
# The number of these starts that look for a better solution after the first.
_BETTER_STARTS = 2
# The least half width of an interval, in radians or metres.
_NARROWEST_HALF_WIDTH = 1e-4
# The number of first cubes that are worked on at once.
_CUBES_AT_ONCE = 100
# The number of pairs that are worked on at once.
_PAIRS_AT_ONCE = 20_000
# The number of configurations that are drawn for the first cubes.
_DRAWN = 400_000
#: The largest number of first cubes, without those beside them.
MOST_CUBES = 100_000
# Passes of `check_cubes` over the cubes that are left: how often these are halved, and how many
# starts look for a better solution.
_PASSES = ((0, 2), (0, 4), (0, 12), (1, 12), (2, 24), (3, 24))
# The last pass is made again at most so often, if few cubes are left.
_REPEATED_PASSES = 30
# Cubes are few below this share of all.
_FEW_SHARE = 0.01
# The first cubes of `check_cubes` are so many times as wide as the smallest.
_LARGER = 8
# The number of these first cubes that are worked on at once.
_CHECKED_AT_ONCE = 40
# The test is of cubes a little wider, as those of a file are on their grid to a part in 10⁹.
_WIDER = 1 + 1e-7
# A cube is given up if its middle is missed by so many of its half widths.
_FAR_HALF_WIDTHS = 2.0


def guaranteed_workspace(
    arm: Chain,
    limits: Ranges,
    finest: float,
    levels: int = 3,
    *,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Iterator[KeptCubes]:
    """Prove of cubes that all their positions are kept; yield those of some, then of more.

    Parameters
    ----------
    arm, limits
        The arm and its artificial limits, as of `workspace`.
    finest
        Half width of the smallest cubes, in metres.
    levels
        How often the first cubes are halved, 0 to 12.
    seed
        Of the inverse kinematics' random starts. What is proved is true with any seed.
    executor
        Where groups of cubes are worked on; by default here.
    progress
        Called with a line of text.

    Raises
    ------
    InputError
        If a limit is outside the physical ones, or finest or levels are not as above.
    """
    check_limits(arm, limits)
    real_number("finest", finest, "a length above 0", np.nextafter(0, 1))
    whole_number("levels", levels, 0, 12)
    width = finest * 2**levels
    first = first_cubes(KeptProofs(arm, limits), width, seed)
    groups = [first[k : k + _CUBES_AT_ONCE] for k in range(0, len(first), _CUBES_AT_ONCE)]
    work = partial(_group, arm, limits, width, levels, seed)
    yield from in_groups(work, list(enumerate(groups)), executor, progress, "groups of cubes")


def check_cubes(
    cubes: KeptCubes,
    *,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> BoolArray:
    """Prove cubes again, of themselves alone; return which are, whole or in parts, shape (k,).

    As they were found, from larger cubes that they are parts of: what is proved of these holds
    for all parts. Nothing is refuted by a cube that is not proved: inverse kinematics may miss
    a configuration. The executor is where groups of cubes are worked on; by default here.
    InputError if the cubes are not those of one grid, halved again and again.
    """
    if not on_one_grid(cubes):
        raise InputError("cubes", "beside a grid", "those of one grid, halved again and again")
    good = np.zeros(len(cubes.width), dtype=bool)
    for turn, (parts, better) in enumerate((*_PASSES, *[_PASSES[-1]] * _REPEATED_PASSES)):
        left = np.flatnonzero(~good)
        if not left.size or (
            turn >= len(_PASSES) and len(left) > max(1, _FEW_SHARE * len(good))
        ):
            break
        name = f"groups of cubes; {int(good.sum())} of {len(good)} cubes were proved before"
        work = partial(_proved_again, parts, better, [seed, turn])
        calls = [(some, cubes[some]) for some in _beside(cubes, left)]
        for some, proved in in_groups(work, calls, executor, progress, name):
            good[some] = proved
    return good


def _beside(cubes: KeptCubes, left: IntArray) -> list[IntArray]:
    """Return the numbers of the cubes that are left, those in one large cube together."""
    cells = _cells(cubes.centre[left], cubes.width.min() * _LARGER)
    first = np.unique(cells, axis=0, return_inverse=True)[1].ravel()
    order = np.argsort(first, kind="stable")
    starts = np.flatnonzero(np.diff(first[order], prepend=-1))
    return np.split(left[order], starts[_CHECKED_AT_ONCE::_CHECKED_AT_ONCE])


def _proved_again(
    parts: int, better: int, seed: list[int], numbers: IntArray, cubes: KeptCubes
) -> tuple[IntArray, BoolArray]:
    """Return the numbers of some cubes, and which of them are proved."""
    least = float(cubes.width.min())
    width = max(float(cubes.width.max()), least * _LARGER)
    levels = parts + round(np.log2(width / least))
    first = (np.unique(_cells(cubes.centre, width), axis=0) + 0.5) * 2 * width
    rng = np.random.default_rng([*seed, numbers[0]])
    proofs = KeptProofs(cubes.arm, cubes.limits)
    found = list(kept_cubes(proofs, first, width, levels, rng, better, cubes))
    share = np.zeros(len(numbers))
    for level, some in enumerate(found):
        for own in np.unique(cubes.width):
            at, size = cubes.width == own, width / 2**level
            of_cubes, of_found = _places(cubes.centre[at], some, max(own, size))
            counts = np.bincount(of_found, minlength=len(of_cubes) + len(of_found))[of_cubes]
            share[at] += counts * min(1.0, size / own) ** cubes.centre.shape[1]
    return numbers, share > 1 - 1e-9


def _cells(centre: FloatArray, width: float) -> FloatArray:
    """Return the places of cubes in the grid of cubes of a half width."""
    return np.asarray(np.floor(centre / (2 * width)))


def _places(one: FloatArray, other: FloatArray, width: float) -> tuple[IntArray, IntArray]:
    """Return numbers of the cells that cubes are in, the same for the same cell."""
    cells = np.concatenate([_cells(one, width), _cells(other, width)])
    numbers = np.unique(cells, axis=0, return_inverse=True)[1].ravel()
    return numbers[: len(one)], numbers[len(one) :]


def first_cubes(proofs: KeptProofs, width: float, seed: int) -> FloatArray:
    """Return middles of cubes, (k, m), in or beside which are positions before a failure.

    InputError if there are too many.
    """
    lower, upper = proofs.ends[:-1].T[:, :, None]
    q = lower + (upper - lower) * np.random.default_rng(seed).random((proofs.n, _DRAWN))
    tips = from_first_joint(proofs.arm).tip_at(q)[0][proofs.rows].T
    cells = np.unique(np.floor(tips / (2 * width)), axis=0)
    if len(cells) > MOST_CUBES:
        allowed = f"a length for which the first cubes are at most {MOST_CUBES}"
        raise InputError("finest", width, f"{allowed}; or more halvings")
    around = np.array(list(product((-1, 0, 1), repeat=len(proofs.rows))))
    cells = np.unique((cells[:, None] + around).reshape(-1, len(proofs.rows)), axis=0)
    return np.asarray((cells + 0.5) * 2 * width)


def _group(
    arm: Chain,
    limits: Ranges,
    width: float,
    levels: int,
    seed: int,
    number: int,
    centre: FloatArray,
) -> KeptCubes:
    """Return the cubes that are proved of a group, which has its own random numbers."""
    rng = np.random.default_rng([seed, number])
    found = list(kept_cubes(KeptProofs(arm, limits), centre, width, levels, rng))
    widths = np.repeat(width / 2.0 ** np.arange(len(found)), [len(some) for some in found])
    return KeptCubes(arm, limits, np.concatenate(found), widths)


def kept_cubes(
    proofs: KeptProofs,
    centre: FloatArray,
    width: float,
    levels: int,
    rng: np.random.Generator,
    better: int = _BETTER_STARTS,
    of: KeptCubes | None = None,
) -> Iterator[FloatArray]:
    """Yield the middles of the cubes that are proved: of the half width, then of half that.

    Parts are looked at if they are parts of some cubes, or hold them; by default all.
    """
    parts = np.array(list(product((-1, 1), repeat=len(proofs.rows)))) / 2
    pairs = proofs.whole(centre, width * _WIDER)
    for level in range(levels + 1):
        rest, given_up = _rest(proofs, pairs, len(centre), rng, better)
        proved = ~given_up
        proved[rest.cube] = False
        yield centre[proved]
        if level == levels:
            return
        rest = rest[~given_up[rest.cube]]
        old, cube = np.unique(rest.cube, return_inverse=True)
        centre = (centre[old][:, None] + width * parts).reshape(-1, parts.shape[1])
        pairs = Pairs.joined(
            [
                replace(
                    rest,
                    cube=len(parts) * cube + k,
                    centre=rest.centre + width * part,
                    width=rest.width / 2,
                )
                for k, part in enumerate(parts)
            ]
        )
        width /= 2
        if of is not None:
            looked = np.zeros(len(centre), dtype=bool)
            for own in np.unique(of.width):
                here, there = _places(centre, of.centre[of.width == own], max(own, width))
                looked |= np.isin(here, there)
            pairs = pairs[looked[pairs.cube]]
            pairs = replace(pairs, cube=(np.cumsum(looked) - 1)[pairs.cube])
            centre = centre[looked]


def _rest(
    proofs: KeptProofs, pairs: Pairs, cubes: int, rng: np.random.Generator, better: int
) -> tuple[Pairs, BoolArray]:
    """Return the pairs that are not proved, and which cubes are given up.

    Once a pair of a cube needs a smaller cube, its other pairs wait for that, too.
    """
    rest, stopped, given_up = [pairs[:0]], np.zeros(cubes, bool), np.zeros(cubes, bool)
    while len(pairs):
        halves = [pairs[:0]]
        for k in range(0, len(pairs), _PAIRS_AT_ONCE):
            some = pairs[k : k + _PAIRS_AT_ONCE]
            waits = stopped[some.cube]
            rest.append(some[waits])
            some, done, missed, by_angle = _attempt(proofs, some[~waits], rng, better)
            given_up[some.cube[missed > _FAR_HALF_WIDTHS * some.width]] = True
            halved = (
                ~done & (missed <= REACHED) & by_angle & (some.half > 2 * _NARROWEST_HALF_WIDTH)
            )
            stuck = some[~done & ~halved]
            rest.append(stuck)
            stopped[stuck.cube] = True
            half = replace(some[halved], half=some.half[halved] / 2)
            halves += [replace(half, middle=half.middle + side * half.half) for side in (-1, 1)]
        pairs = Pairs.joined(halves)
    return Pairs.joined(rest), given_up


def _attempt(
    proofs: KeptProofs, pairs: Pairs, rng: np.random.Generator, better: int
) -> tuple[Pairs, BoolArray, FloatArray, BoolArray]:
    """Return pairs with the best configurations that are found, and what comes of them.

    Which are proved, by how much the middles are missed, and whether the interval hinders.
    """
    least, most = proofs.drawn_from(pairs)
    q, hard = pairs.q.copy(), np.full(len(pairs), np.inf)
    done, by_angle = np.zeros(len(pairs), bool), np.zeros(len(pairs), bool)
    missed = np.full(len(pairs), np.inf)
    for trial in range(max(_STARTS, better) + 1):
        again = ~done & (missed > REACHED) if trial > better else ~done
        at = np.flatnonzero(again & ~np.isnan(pairs.q[:, 0]) if trial == 0 else again)
        if not at.size:
            continue
        start = least[:, at] + (most - least)[:, at] * rng.random((proofs.n, len(at)))
        some = pairs[at]
        found, missing = proofs.reached(some, some.q.T if trial == 0 else start)
        missed[at] = np.minimum(missed[at], missing)
        there = missing <= REACHED
        at, some = at[there], replace(some, q=found.T)[there]
        holds, own, hinders = proofs.hold(some)
        best = holds | (own < hard[at])
        at, some = at[best], some[best]
        q[at], hard[at], done[at], by_angle[at] = some.q, own[best], holds[best], hinders[best]
    return replace(pairs, q=q), done, missed, by_angle
