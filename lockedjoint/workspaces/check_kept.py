"""Prove cubes of a file again, of themselves alone.

What comes in: `KeptCubes`, the arm and its limits among them. What goes out: which of the cubes
are proved, shape (k,). The proof begins with larger cubes that the given ones are parts of, as
when they were found: what is proved of a large cube holds for all its parts. Cubes that are
left are tried again in passes, each with smaller parts or more starts than the one before.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from lockedjoint.kinematics.geometry import BoolArray, IntArray
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.executors import in_groups
from lockedjoint.workspaces.bisection import cells, cells_of_both, proved_cubes
from lockedjoint.workspaces.kept_cubes import KeptCubes, on_one_grid
from lockedjoint.workspaces.kept_proofs import KeptProofs


@dataclass(frozen=True)
class _Pass:
    """How hard the cubes that are left are tried."""

    halvings: int  #: How often the smallest given cubes are halved.
    better_starts: int  #: How many starts look for a better solution.


# The passes over the cubes that are left, one after the other.
_PASSES = (
    _Pass(halvings=0, better_starts=2),
    _Pass(halvings=0, better_starts=4),
    _Pass(halvings=0, better_starts=12),
    _Pass(halvings=1, better_starts=12),
    _Pass(halvings=2, better_starts=24),
    _Pass(halvings=3, better_starts=24),
)
# The last pass is made again at most so often, if few cubes are left: more takes longer, and
# may prove a cube for which random starts had no luck.
_REPEATED_PASSES = 30
# Cubes are few below this share of all.
_FEW_SHARE = 0.01
# The cubes that a proof begins with are so many times as wide as the smallest. A power of 2: a
# larger one saves work only if cubes of that size can be proved.
_LARGER = 8
# The number of these large cubes that are worked on at once: more needs more memory.
_LARGE_CUBES_AT_ONCE = 40
# The parts of a cube fill it up to this share, which is rounding.
_FILLED_SHARE = 1 - 1e-9


def check_cubes(
    cubes: KeptCubes,
    *,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> BoolArray:
    """Prove cubes again, of themselves alone; return which are, whole or in parts, shape (k,).

    Nothing is refuted by a cube that is not proved: inverse kinematics may miss a
    configuration.

    Parameters
    ----------
    cubes
        Cubes of one grid, halved again and again.
    seed
        Of the random starts of inverse kinematics.
    executor
        Where groups of cubes are worked on; by default here.
    progress
        Called with a line of text.

    Raises
    ------
    InputError
        If the cubes are not those of one grid.
    """
    if not on_one_grid(cubes):
        raise InputError("cubes", "beside a grid", "those of one grid, halved again and again")
    proved = np.zeros(len(cubes.half_width), dtype=bool)
    few = max(1, _FEW_SHARE * len(proved))
    for turn, how in enumerate((*_PASSES, *[_PASSES[-1]] * _REPEATED_PASSES)):
        left = np.flatnonzero(~proved)
        repeated = turn >= len(_PASSES)
        if not left.size or (repeated and len(left) > few):
            break
        so_far = f"{int(proved.sum())} of {len(proved)} cubes were proved before"
        work = partial(_prove_group, how, [seed, turn])
        groups = [(numbers, cubes[numbers]) for numbers in _groups(cubes, left)]
        name = f"groups of cubes; {so_far}"
        for numbers, now_proved in in_groups(work, groups, executor, progress, name):
            proved[numbers] = now_proved
    return proved


def _groups(cubes: KeptCubes, left: IntArray) -> list[IntArray]:
    """Return the numbers of the cubes that are left, those in one large cube together."""
    large = cells(cubes.centre[left], cubes.half_width.min() * _LARGER)
    number = np.unique(large, axis=0, return_inverse=True)[1].ravel()
    order = np.argsort(number, kind="stable")
    first_of_each = np.flatnonzero(np.diff(number[order], prepend=-1))
    return np.split(left[order], first_of_each[_LARGE_CUBES_AT_ONCE::_LARGE_CUBES_AT_ONCE])


def _prove_group(
    how: _Pass, seed: list[int], numbers: IntArray, cubes: KeptCubes
) -> tuple[IntArray, BoolArray]:
    """Return the numbers of some cubes, (k,), and which of them are proved, (k,).

    `seed` is the user's and the number of the pass; `numbers` are the cubes' own in the file.
    A part of half width p that is inside a cube of half width w fills (p/w)^m of it; a part
    that is not smaller fills it all.
    """
    smallest = float(cubes.half_width.min())
    half_width = max(float(cubes.half_width.max()), smallest * _LARGER)
    levels = how.halvings + round(np.log2(half_width / smallest))
    large = (np.unique(cells(cubes.centre, half_width), axis=0) + 0.5) * 2 * half_width
    rng = np.random.default_rng([*seed, numbers[0]])
    proofs = KeptProofs(cubes.arm, cubes.limits)
    found = proved_cubes(proofs, large, half_width, levels, rng, how.better_starts, cubes)
    dimension = cubes.centre.shape[1]
    # How much of each cube is proved, from 0 to 1: parts do not overlap, so shares add up.
    proved_share = np.zeros(len(numbers))
    for level, centre in enumerate(found):
        part_half_width = half_width / 2**level
        for own_half_width in np.unique(cubes.half_width):
            own = cubes.half_width == own_half_width
            here, there = cells_of_both(
                cubes.centre[own], centre, max(own_half_width, part_half_width)
            )
            counts = np.bincount(there, minlength=len(here) + len(there))[here]
            proved_share[own] += (
                counts * min(1.0, part_half_width / own_half_width) ** dimension
            )
    return numbers, proved_share > _FILLED_SHARE
