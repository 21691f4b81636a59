"""A numerical identity with all rounding bounded: the side of the proof that has multipliers.

    objective(x) − b = Σ ⟨X, B(x)⟩ + f(x),   |f(x)| ≤ δ for all x

The X are those of a solver. `verification` bounds f, here for blocks and multipliers and there
for what a certificate holds.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from formulations.bounds.so3_moments.blocks.enclosed_localisers import (
    enclosed_krylov_sum,
    enclosed_powers,
    enclosed_scaled,
)
from formulations.bounds.so3_moments.blocks.enclosed_squares import (
    EnclosedSum,
    enclosed_block,
    enclosed_sums,
)
from formulations.bounds.so3_moments.blocks.localisers import KrylovLocaliser, ScaledBlocks
from formulations.bounds.so3_moments.blocks.sampled_blocks import BlockFamily, SectorBlocks
from formulations.bounds.so3_moments.fixed_worst_case import ResidualDistance
from formulations.bounds.so3_moments.programs.multipliers import semidefinite_root
from formulations.bounds.so3_moments.relaxation import Progress, silent
from formulations.bounds.so3_moments.verification import LOCALISED, identity_defect
from nlp.arrays import FloatArray
from nlp.errors import InputError


def conditions_defect(
    families: Sequence[BlockFamily],
    multipliers: Sequence[FloatArray],
    constant: float,
    candidates: FloatArray,
    *,
    degree: int = 12,
    objective: Callable[[FloatArray], EnclosedSum] | None = None,
    points: int | None = None,
    progress: Progress = silent,
) -> dict[str, float]:
    """Bound |f| = |objective − constant − Σ ⟨X, B⟩| over all configurations.

    Parameters
    ----------
    families
        Plain blocks, blocks scaled by a `ResidualDistance`, and Krylov localisers.
    multipliers
        X of each block. Only a factor of each is used, so they need not be semidefinite.
    constant, candidates, degree, objective, points, progress
        As in `identity_defect`, which also says what is returned.

    Raises
    ------
    InputError
        If an entry of a block may have more than `degree`, so that it is outside of the space
        of invariants, or there is no enclosure for blocks of its kind.
    NoBasisError
        If the points do not determine all invariants.
    """
    check_degrees(families, degree)
    summands = [
        partial(enclosed_condition, family, own)
        for family, own in with_multipliers(families, multipliers)
    ]
    return identity_defect(
        summands,
        constant,
        candidates,
        degree,
        objective=objective,
        points=points,
        progress=progress,
    )


def check_degrees(families: Sequence[BlockFamily], degree: int) -> None:
    """Raise InputError unless every entry of every block has at most this degree in J.

    A block has twice the degree of its rows, and `LOCALISED` more if it is scaled or a Krylov
    localiser.
    """
    for family in families:
        rows = family.family if isinstance(family, ScaledBlocks) else family
        more = LOCALISED if isinstance(family, (ScaledBlocks, KrylovLocaliser)) else 0
        sector = getattr(rows, "sector", None)
        if sector is None:
            raise InputError("families", type(family).__name__, "blocks of rows")
        if 2 * sector.degree + more > degree:
            allowed = f"rows of degree at most {(degree - more) // 2}"
            raise InputError("families", (type(family).__name__, sector), allowed)


def enclosed_condition(
    family: BlockFamily, multipliers: Sequence[FloatArray], rotations: FloatArray
) -> EnclosedSum:
    """Return Σ ⟨X, B(x)⟩ over the blocks of a family, averaged over all orders of the joints.

    Parameters
    ----------
    family
        Plain blocks, blocks scaled by a `ResidualDistance`, or a Krylov localiser.
    multipliers
        X of each block; a factor is used.
    rotations
        Configurations in extended precision, (configurations, n, 3, 3).

    Raises
    ------
    InputError
        If there is no enclosure for blocks of this kind.
    """
    if isinstance(family, ScaledBlocks) and isinstance(family.factor, ResidualDistance):
        inner = enclosed_condition(family.family, multipliers, rotations)
        return enclosed_scaled(family.factor.limit, family.factor.unit, inner, rotations)
    factors = map(multiplier_factor, multipliers)
    if isinstance(family, KrylovLocaliser):
        together = zip(family.blocks, factors, strict=True)
        powers = [enclosed_powers(family, block, factor) for block, factor in together]
        return enclosed_krylov_sum(family, powers, rotations)
    if isinstance(family, SectorBlocks):
        together = zip(family.blocks, factors, strict=True)
        blocks = [enclosed_block(family, block, factor) for block, factor in together]
        return enclosed_sums(family, blocks, rotations)
    raise InputError("families", type(family).__name__, "blocks with bounds on all rounding")


def with_multipliers(
    families: Sequence[BlockFamily], multipliers: Sequence[FloatArray]
) -> Iterator[tuple[BlockFamily, Sequence[FloatArray]]]:
    """Give each family with the multipliers of its blocks."""
    start = 0
    for family in families:
        end = start + len(family.sizes)
        yield family, multipliers[start:end]
        start = end


def multiplier_factor(multiplier: FloatArray) -> FloatArray:
    """Return L with LLᵀ the nearest semidefinite matrix, without columns of zeros."""
    root, _ = semidefinite_root(multiplier)
    return np.asarray(root[:, root.any(axis=0)])
