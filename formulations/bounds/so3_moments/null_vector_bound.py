"""Exclude a worst case σ² ≥ t with the signs of the columns fixed by the null vector of J.

Two spaces of functions carry the pseudo-moments: of degree 12, invariant under the signs of the
columns (`fixed_worst_case`), and of degree 8, not invariant. They share the functions of degree
8 that are. The conditions on the second space are those of `blocks.null_vector`.

One condition on the spectrum of JJᵀ, α(t) + β tr E³ − ρ ≥ 0, is maximised under all others: if
the largest value is negative, t is excluded.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from formulations.bounds.closed_form import largest_residual
from formulations.bounds.so3_moments.blocks.localisers import ScaledBlocks
from formulations.bounds.so3_moments.blocks.near_null_vector import (
    concentrated_rotations,
    concentrating_weights,
    transformed,
    units,
)
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
    sector_families,
)
from formulations.bounds.so3_moments.blocks.spectrum import (
    MAXIMISED,
    QUARTIC,
    SpectralDistance,
    spectral_families,
    spectral_limit,
)
from formulations.bounds.so3_moments.fixed_worst_case import (
    ResidualDistance,
    WorstCaseConditions,
    condition_families,
)
from formulations.bounds.so3_moments.global_bound import Evidence
from formulations.bounds.so3_moments.programs.moment_program import (
    MomentProgram,
    joined_program,
    penalised_program,
)
from formulations.bounds.so3_moments.programs.multipliers import (
    refined_interior_multipliers,
)
from formulations.bounds.so3_moments.programs.predictor_corrector import (
    solve_with_predictor_corrector,
)
from formulations.bounds.so3_moments.relaxation import (
    FRESH,
    PREDICTOR_CORRECTOR,
    Progress,
    SolvedRelaxation,
    silent,
)
from formulations.bounds.so3_moments.representations.row_sectors import (
    RowSector,
    UnsignedSector,
    degree_sectors,
)
from formulations.bounds.so3_moments.representations.wigner import (
    jacobians_of,
    random_rotations,
)
from nlp.arrays import FloatArray, Rng

_SAMPLES, _UNSIGNED_SAMPLES = 540, 320
_PENALTY = 3e3
_GAP, _ACCURACY = 1e-9, 1e-9
# The solver stops where multipliers are still well inside of the cone: there they can be
# refined, which takes away most of their residual.
_LEAST_MARGIN, _MARGIN_OVER_RESIDUAL = 1e-3, 100.0
_HOW_CHECKED = (
    "condition on the spectrum + a sum of squares and localisers equal to a negative constant "
    "at fresh configurations, half of them uniform and half with a small sum of the columns; "
    "multipliers made positive semidefinite, largest difference subtracted"
)
#: Sectors of the first space that are multiplied by conditions on the spectrum.
SIGNED_SPECTRAL = (*degree_sectors(3, range(4)), *degree_sectors(2, range(3)))


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
    spectral
        Sectors of the blocks that are multiplied by α + β tr E³ − ρ, see `spectral_limit`.
    gram, krylov
        Sectors of the localisers of J_fᵀJ_f − tI, and of J_f J_fᵀ − tI and δ₀M − ssᵀ.
    """

    plain: tuple[UnsignedSector, ...]
    near: tuple[UnsignedSector, ...]
    scaled: tuple[UnsignedSector, ...]
    spectral: tuple[UnsignedSector, ...]
    gram: tuple[UnsignedSector, ...]
    krylov: tuple[UnsignedSector, ...]


def unsigned_sectors(
    degree: int, spins: range, *, locked: bool = False
) -> tuple[UnsignedSector, ...]:
    """Return the sectors of all charges of a degree, within the given total spins."""
    charges = range(degree % 2, degree + 1, 2)
    return tuple(UnsignedSector(c, spin, degree, locked) for spin in spins for c in charges)


UNSIGNED = UnsignedConditions(
    plain=unsigned_sectors(4, range(5)) + unsigned_sectors(3, range(4)),
    near=unsigned_sectors(3, range(4)),
    scaled=unsigned_sectors(2, range(3)),
    spectral=unsigned_sectors(1, range(2)),
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
    distance = ResidualDistance(limit, 5 * JOINTS / 3)
    deviation = null_vector_deviation(t)
    nearest = deviation * (JOINTS / 3 + sqrt(5 * limit / 3)) + 1e-12

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
        *spectral_families(conditions.spectral, t),
        *(family for family in localisers if family.blocks),
    ]


def exclude_with_signs(
    t: float,
    signed: WorstCaseConditions,
    unsigned: UnsignedConditions = UNSIGNED,
    signed_spectral: Sequence[RowSector] = SIGNED_SPECTRAL,
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
    signed_spectral
        Sectors of the first space that are multiplied by α + β tr E³ − ρ; if none, the
        conditions with tr E⁴ are left out as well.
    rng, progress
        As in `exclude_worst_case`.

    Returns
    -------
    margin, evidence
        Upper bound on α + β tr E³ − ρ (`spectral_limit`, β = 1/5) under all other conditions,
        after the check; t is excluded, numerically, if it is negative. And the program, its
        solution and the check.
    """
    clock = [time.perf_counter()]
    generator = np.random.default_rng(rng)
    distance = SpectralDistance(spectral_limit(t, MAXIMISED), MAXIMISED)
    plain: tuple[list[BlockFamily], ...] = (
        [*sector_families(signed.plain, JOINTS)],
        [*sector_families(unsigned.plain, JOINTS)],
    )
    others = (
        [
            *condition_families(replace(signed, plain=()), JOINTS, t),
            *spectral_families(signed_spectral, t),
            *spectral_families([RowSector(0, 0, 0, 0)] if signed_spectral else [], t, QUARTIC),
        ],
        unsigned_families(replace(unsigned, plain=()), t),
    )
    families = [*plain[0], *others[0], *plain[1], *others[1]]
    rotations = concentrated_rotations(generator, _SAMPLES, JOINTS)
    weights = concentrating_weights(rotations)
    common = _evaluated(sector_families(signed.scaled, JOINTS), rotations, silent)
    blocks: list[list[FloatArray]] = []
    transforms: list[FloatArray] = []
    for own, rest, count in zip(plain, others, (_SAMPLES, _UNSIGNED_SAMPLES), strict=True):
        blocks.append([])
        for some, semidefinite in ((own, True), (rest, False)):
            found = _evaluated(some, rotations[:count], progress)
            blocks[-1] += found
            transforms += [
                units(block, weights[:count], semidefinite=semidefinite) for block in found
            ]
    sampled = joined_program(
        blocks[0], blocks[1], common, weights=weights, objective=-distance(rotations)
    )
    program = sampled.congruent(transforms)
    clock.append(time.perf_counter())
    progress(f"solving with {PREDICTOR_CORRECTOR}: {sampled.size}")
    outcome = solve_with_predictor_corrector(
        penalised_program(program, _PENALTY),
        gap=_GAP,
        accuracy=_ACCURACY,
        stop=lambda found: excludes_t(program, [_PENALTY * x for x in found[:-1]]),
        progress=progress,
    )
    if outcome.multipliers is not None:
        scaled = [_PENALTY * x for x in outcome.multipliers[:-1]]
        refined = refined_interior_multipliers(program, scaled)
        outcome = replace(outcome, multipliers=transformed(refined, transforms))
    clock.append(time.perf_counter())
    seconds = dict(zip(("blocks", "solver"), np.diff(clock).tolist(), strict=True))
    solved = SolvedRelaxation(families, sampled, sampled, outcome, seconds, clock[-1])
    progress("checking the identity at fresh configurations")
    fresh = np.concatenate(
        [
            random_rotations(generator, FRESH // 2, JOINTS),
            concentrated_rotations(generator, FRESH // 2, JOINTS),
        ]
    )
    bound, evidence = solved.checked(
        sampled, lambda where: -distance(where), fresh, _HOW_CHECKED
    )
    return -bound, evidence


def excludes_t(program: MomentProgram, multipliers: Sequence[FloatArray]) -> bool:
    """Whether multipliers exclude t by more than their residual."""
    margin = program.dual_value(multipliers)
    if margin < _LEAST_MARGIN:
        return False
    residual = float(np.linalg.norm(program.dual_residual(multipliers)))
    return margin > _MARGIN_OVER_RESIDUAL * residual


def _evaluated(
    families: Sequence[BlockFamily], rotations: FloatArray, progress: Progress
) -> list[FloatArray]:
    found: list[FloatArray] = []
    for number, family in enumerate(families, start=1):
        progress(f"evaluating blocks: {number} of {len(families)}")
        found += family.evaluate(rotations)
    return found
