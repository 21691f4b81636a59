"""Exclude a worst case σ² ≥ t with the signs of the columns fixed by the null vector of J.

Two spaces of functions carry the pseudo-moments: of degree 12, invariant under the signs of the
columns (`fixed_worst_case`), and of degree 8, not invariant. They share the functions of degree
8 that are. The conditions on the second space are those of `blocks.null_vector`.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import sqrt

import numpy as np

from formulations.bounds.closed_form import largest_residual
from formulations.bounds.so3_moments.blocks.localisers import ScaledBlocks
from formulations.bounds.so3_moments.blocks.null_vector import (
    JOINTS,
    FormLocaliser,
    deviation_form,
    gram_form,
    krylov_form,
    null_vector_deviation,
)
from formulations.bounds.so3_moments.blocks.sampled_blocks import (
    BlockFamily,
    SectorBlocks,
    sector_families,
)
from formulations.bounds.so3_moments.fixed_worst_case import (
    HOW_CHECKED,
    Conditions,
    condition_families,
)
from formulations.bounds.so3_moments.global_bound import Evidence
from formulations.bounds.so3_moments.programs.moment_program import (
    MomentProgram,
    joined_program,
    margin_program,
)
from formulations.bounds.so3_moments.programs.predictor_corrector import (
    solve_with_predictor_corrector,
)
from formulations.bounds.so3_moments.relaxation import (
    FRESH,
    PREDICTOR_CORRECTOR,
    Progress,
    SolvedRelaxation,
    residual_values,
    silent,
)
from formulations.bounds.so3_moments.representations.row_sectors import UnsignedSector
from formulations.bounds.so3_moments.representations.wigner import (
    jacobians_of,
    random_rotations,
)
from nlp.arrays import FloatArray, Rng

_SAMPLES = 520
# Relative to a shift of some thousands; the margin is about 1e-6.
_GAP = 1e-13
_MARGIN_OVER_RESIDUAL = 30.0


@dataclass(frozen=True)
class UnsignedConditions:
    """The conditions on the functions that change with the signs of the columns.

    Parameters
    ----------
    plain
        Sectors of the plain blocks.
    near
        Sectors of the blocks that are multiplied by δ − |s|².
    scaled
        Sectors of the blocks that are multiplied by ρ_max(t) − ρ.
    gram, krylov
        Sectors of the localisers of J_fᵀJ_f − tI, and of J_f J_fᵀ − tI and δ₀M − ssᵀ.
    """

    plain: tuple[UnsignedSector, ...]
    near: tuple[UnsignedSector, ...]
    scaled: tuple[UnsignedSector, ...]
    gram: tuple[UnsignedSector, ...]
    krylov: tuple[UnsignedSector, ...]


def unsigned_sectors(
    degree: int, spins: range, *, locked: bool = False
) -> tuple[UnsignedSector, ...]:
    """Return the sectors of all charges of a degree, within the given total spins."""
    charges = range(degree % 2, degree + 1, 2)
    return tuple(UnsignedSector(c, spin, degree, locked) for spin in spins for c in charges)


UNSIGNED = UnsignedConditions(
    plain=unsigned_sectors(4, range(3)) + unsigned_sectors(3, range(4)),
    near=unsigned_sectors(3, range(4)),
    scaled=unsigned_sectors(2, range(3)),
    gram=unsigned_sectors(2, range(3), locked=True)
    + unsigned_sectors(3, range(3), locked=True),
    krylov=unsigned_sectors(1, range(3), locked=True)
    + unsigned_sectors(2, range(3), locked=True),
)


def unsigned_families(conditions: UnsignedConditions, t: float) -> list[BlockFamily]:
    """Return the blocks that are positive semidefinite wherever the worst case is σ² ≥ t.

    The signs of the columns are those of the null vector. For the spectrum with one deviation
    d of an eigenvalue from its mean, ρ ≥ (3/5)d²; so λ_max ≤ n/3 + √(5ρ_max/3).
    """
    limit = largest_residual(JOINTS, t)
    deviation = null_vector_deviation(t)
    nearest = deviation * (JOINTS / 3 + sqrt(5 * limit / 3)) + 1e-12
    size = 5 * JOINTS / 3

    def distance(rotations: FloatArray) -> FloatArray:
        return np.asarray((limit - residual_values(rotations)) / size)

    def nearness(rotations: FloatArray) -> FloatArray:
        total = jacobians_of(rotations).sum(axis=2)
        return np.asarray((nearest - np.sum(total**2, axis=1)) / 2)

    localisers = [
        *(FormLocaliser(sector, gram_form(t)) for sector in conditions.gram),
        *(
            FormLocaliser(sector, form)
            for form in (krylov_form(t), deviation_form(deviation))
            for sector in conditions.krylov
        ),
    ]
    return [
        *sector_families(conditions.plain, JOINTS),
        *(ScaledBlocks(one, nearness) for one in sector_families(conditions.near, JOINTS)),
        *(ScaledBlocks(one, distance) for one in sector_families(conditions.scaled, JOINTS)),
        *(family for family in localisers if family.blocks),
    ]


def exclude_with_signs(
    t: float,
    signed: Conditions,
    unsigned: UnsignedConditions = UNSIGNED,
    *,
    rng: Rng = 0,
    progress: Progress = silent,
) -> tuple[float, Evidence]:
    """Try to show that no unit revolute 7R Jacobian has a worst case σ² ≥ t.

    Parameters
    ----------
    t
        The squared worst case, at most 1/3.
    signed, unsigned
        Conditions on the functions that are invariant under the signs of columns, and on the
        others. The entries of the scaled blocks of the first, without their factor, must span
        what the two spaces of functions share.
    rng, progress
        As in `exclude_worst_case`.

    Returns
    -------
    margin, evidence
        As of `exclude_worst_case`.
    """
    clock = [time.perf_counter()]
    generator = np.random.default_rng(rng)
    families: tuple[list[BlockFamily], list[BlockFamily]] = (
        condition_families(signed, JOINTS, t),
        unsigned_families(unsigned, t),
    )
    rotations = random_rotations(generator, _SAMPLES, JOINTS)
    common = _evaluated(sector_families(signed.scaled, JOINTS), rotations, silent)
    blocks = [_evaluated(own, rotations, progress) for own in families]
    sampled = joined_program(blocks[0], blocks[1], common)
    program = margin_program(sampled)
    clock.append(time.perf_counter())
    progress(f"solving with {PREDICTOR_CORRECTOR}: {sampled.size}")
    outcome = solve_with_predictor_corrector(
        program, gap=_GAP, stop=partial(excludes_t, sampled), progress=progress
    )
    clock.append(time.perf_counter())
    seconds = dict(zip(("blocks", "solver"), np.diff(clock).tolist(), strict=True))
    together = [*families[0], *families[1]]
    solved = SolvedRelaxation(
        together, sampled, program, PREDICTOR_CORRECTOR, outcome, seconds, clock[-1]
    )
    progress("checking the identity at fresh configurations")
    fresh = random_rotations(generator, FRESH, JOINTS)
    bound, evidence = solved.checked(
        sampled, lambda where: np.zeros(len(where)), fresh, HOW_CHECKED, unit_trace=True
    )
    return -bound, evidence


def excludes_t(sampled: MomentProgram, multipliers: Sequence[FloatArray]) -> bool:
    """Whether multipliers exclude t by more than their residual."""
    residual = float(np.linalg.norm(sampled.dual_residual(multipliers)))
    return sampled.dual_value(multipliers) > _MARGIN_OVER_RESIDUAL * residual


def _evaluated(
    families: list[BlockFamily] | list[SectorBlocks],
    rotations: FloatArray,
    progress: Progress,
) -> list[FloatArray]:
    found: list[FloatArray] = []
    for number, family in enumerate(families, start=1):
        progress(f"evaluating blocks: {number} of {len(families)}")
        found += family.evaluate(rotations)
    return found
