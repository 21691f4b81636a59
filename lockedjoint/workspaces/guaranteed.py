"""The workspace that is kept for certain, as cubes of positions.

What comes in: an arm, artificial limits of its joints, and the size of the smallest cubes. What
goes out: `KeptCubes`, all positions of which are kept. A coarse grid of cubes covers all that
the arm reaches; groups of them go through `bisection`, which halves what is not proved.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from functools import partial
from itertools import product

import numpy as np

from lockedjoint.kinematics.chain import Chain
from lockedjoint.kinematics.serial_chain import Ranges, from_first_joint
from lockedjoint.nlp.arrays import FloatArray, real_number, whole_number
from lockedjoint.nlp.errors import InputError
from lockedjoint.nlp.executors import in_groups
from lockedjoint.workspaces.bisection import cells, proved_cubes
from lockedjoint.workspaces.kept_cubes import KeptCubes
from lockedjoint.workspaces.kept_proofs import KeptProofs
from lockedjoint.workspaces.workspace import check_limits

# Cubes are halved at most so often.
_MOST_LEVELS = 12
# The number of first cubes that are worked on at once.
_CUBES_AT_ONCE = 100
# The number of random configurations that say where the first cubes are.
_CONFIGURATIONS = 400_000
#: The largest number of first cubes, without those beside them.
MOST_CUBES = 100_000


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
    whole_number("levels", levels, 0, _MOST_LEVELS)
    width = finest * 2**levels
    first = _first_cubes(KeptProofs(arm, limits), finest, levels, seed)
    groups = [first[k : k + _CUBES_AT_ONCE] for k in range(0, len(first), _CUBES_AT_ONCE)]
    work = partial(_prove_group, arm, limits, width, levels, seed)
    yield from in_groups(work, list(enumerate(groups)), executor, progress, "groups of cubes")


def _first_cubes(proofs: KeptProofs, finest: float, levels: int, seed: int) -> FloatArray:
    """Return middles of cubes, (k, m), in or beside which are positions before a failure.

    InputError if there are too many.
    """
    width = finest * 2**levels
    lower, upper = proofs.ends[:-1].T[:, :, None]
    draws = np.random.default_rng(seed).random((proofs.n, _CONFIGURATIONS))
    q = lower + (upper - lower) * draws
    positions = from_first_joint(proofs.arm).tip_at(q)[0][proofs.rows].T
    reached = np.unique(cells(positions, width), axis=0)
    if len(reached) > MOST_CUBES:
        allowed = f"a length for which the first cubes are at most {MOST_CUBES}"
        raise InputError("finest", finest, f"{allowed}; or more halvings")
    dimension = len(proofs.rows)
    neighbours = np.array(list(product((-1, 0, 1), repeat=dimension)))
    around = np.unique((reached[:, None] + neighbours).reshape(-1, dimension), axis=0)
    return np.asarray((around + 0.5) * 2 * width)


def _prove_group(
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
    found = list(proved_cubes(KeptProofs(arm, limits), centre, width, levels, rng))
    widths = np.repeat(width / 2.0 ** np.arange(len(found)), [len(level) for level in found])
    return KeptCubes(arm, limits, np.concatenate(found), widths)
