"""Exclude a worst case σ² ≥ t: show that no configuration meets the conditions it implies.

The conditions are the plain blocks B ⪰ 0; (ρ_max(t) − ρ)B ⪰ 0 for blocks of low degree; and
localisers of J_f J_fᵀ − tI. If positive semidefinite multipliers with Σ tr X = 1 make
Σ ⟨X, B(x)⟩ equal to a negative number for all x, t is not reached.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from formulations.bounds.so3_moments.blocks.localisers import KrylovLocaliser, ScaledBlocks
from formulations.bounds.so3_moments.blocks.sampled_blocks import BlockFamily, sector_families
from formulations.bounds.so3_moments.global_bound import Evidence
from formulations.bounds.so3_moments.programs.moment_program import margin_program
from formulations.bounds.so3_moments.programs.multipliers import (
    IdentityCheck,
    check_identity,
    nearest_semidefinite,
)
from formulations.bounds.so3_moments.relaxation import (
    FRESH,
    Progress,
    residual_values,
    silent,
    solve_relaxation,
)
from formulations.bounds.so3_moments.representations.row_sectors import RowSector
from formulations.bounds.so3_moments.representations.wigner import random_rotations
from formulations.bounds.so3_moments.spectral_limits import largest_residual
from nlp.arrays import FloatArray

_GAP = 1e-8
_HOW_CHECKED = (
    "a sum of squares and localisers equal to a negative constant at fresh random "
    "configurations; multipliers made positive semidefinite, largest difference subtracted"
)


@dataclass(frozen=True)
class Conditions:
    """The conditions of a worst case that are used.

    Parameters
    ----------
    plain
        Sectors of the plain blocks.
    scaled
        Sectors of the blocks that are multiplied by ρ_max(t) − ρ.
    krylov
        Sectors of the localisers of J_f J_fᵀ − tI on Krylov vectors.
    """

    plain: tuple[RowSector, ...]
    scaled: tuple[RowSector, ...]
    krylov: tuple[RowSector, ...] = ()


@dataclass(frozen=True)
class Exclusion:
    """Whether a worst case is excluded, and how that was checked.

    Parameters
    ----------
    t
        The squared worst case.
    margin
        Upper bound on the largest s with every block ⪰ sI, after the check; negative if t is
        excluded.
    evidence
        The program, its solution and the check at fresh configurations.
    """

    t: float
    margin: float
    evidence: Evidence

    @property
    def excluded(self) -> bool:
        """Whether t is excluded, numerically."""
        return self.margin < 0


def condition_families(conditions: Conditions, joints: int, t: float) -> list[BlockFamily]:
    """Return the blocks that are positive semidefinite wherever the worst case is σ² ≥ t."""
    limit = largest_residual(joints, t)
    size = 5 * joints / 3  # the mean of ρ, so that all blocks have a similar size

    def distance(rotations: FloatArray) -> FloatArray:
        return (limit - residual_values(rotations)) / size

    krylov = [KrylovLocaliser(sector, joints, t) for sector in conditions.krylov]
    return [
        *sector_families(conditions.plain, joints),
        *(ScaledBlocks(one, distance) for one in sector_families(conditions.scaled, joints)),
        *(family for family in krylov if family.blocks),
    ]


def exclude_worst_case(
    t: float,
    conditions: Conditions,
    joints: int,
    *,
    seed: int = 0,
    progress: Progress = silent,
) -> Exclusion:
    """Try to show that no unit revolute Jacobian has a worst case σ² ≥ t.

    Parameters
    ----------
    t
        The squared worst case; at most (n − 6)/3.
    conditions
        The conditions to use.
    joints
        Number n of joints, at least 7.
    seed
        Seed of the configurations.
    progress
        Receives a short message at each step.
    """
    rng = np.random.default_rng(seed)
    families = condition_families(conditions, joints, t)
    solved = solve_relaxation(
        families, joints, rng, adapt=margin_program, gap=_GAP, progress=progress
    )
    cleaned = [nearest_semidefinite(x) for x in solved.multipliers]
    total = sum(float(np.trace(x)) for x, _ in cleaned)
    progress("checking the identity at fresh configurations")
    fresh = random_rotations(rng, FRESH, joints)
    scaled = [x / total for x, _ in cleaned]
    check = margin_check(families, scaled, solved.sampled.blocks, fresh)
    evidence = solved.evidence(
        _HOW_CHECKED,
        vars(check),
        multipliers=solved.multipliers,
        smallest_eigenvalue=min(lowest for _, lowest in cleaned),
    )
    return Exclusion(t, -check.checked_bound, evidence)


def margin_check(
    families: Sequence[BlockFamily],
    multipliers: Sequence[FloatArray],
    blocks: Sequence[FloatArray],
    fresh: FloatArray,
) -> IdentityCheck:
    """Check 0 − bound = Σ ⟨X, B(x)⟩ at fresh configurations; `blocks` holds B_0 first."""
    bound = -sum(float(np.vdot(x, b[0])) for x, b in zip(multipliers, blocks, strict=True))

    def zero(rotations: FloatArray) -> FloatArray:
        return np.zeros(len(rotations))

    return check_identity(families, multipliers, bound, zero, fresh)
