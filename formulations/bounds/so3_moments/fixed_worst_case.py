"""Exclude a worst case σ² ≥ t: show that no configuration meets the conditions it implies.

The conditions are the plain blocks B ⪰ 0; (ρ_max(t) − ρ)B ⪰ 0 for blocks of low degree; and
localisers of J_f J_fᵀ − tI. If positive semidefinite multipliers with Σ tr X = 1 make
Σ ⟨X, B(x)⟩ equal to a negative number for all x, t is not reached.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from formulations.bounds.so3_moments.blocks.block_family import BlockFamily
from formulations.bounds.so3_moments.blocks.krylov_localisers import (
    KrylovLocaliser,
    KrylovSector,
)
from formulations.bounds.so3_moments.blocks.matrix_localisers import (
    LocaliserSector,
    MatrixLocaliser,
)
from formulations.bounds.so3_moments.blocks.plain_localisers import plain_condition_sum
from formulations.bounds.so3_moments.blocks.scaled_blocks import ScaledBlocks
from formulations.bounds.so3_moments.global_bound import ProgramSize
from formulations.bounds.so3_moments.programs.feasibility_margin import margin_program
from formulations.bounds.so3_moments.programs.identity_check import (
    IdentityCheck,
    check_identity,
)
from formulations.bounds.so3_moments.programs.multipliers import nearest_semidefinite
from formulations.bounds.so3_moments.programs.predictor_corrector import (
    solve_with_predictor_corrector,
)
from formulations.bounds.so3_moments.representations.clebsch_gordan import Floats
from formulations.bounds.so3_moments.representations.row_sectors import RowSector
from formulations.bounds.so3_moments.representations.wigner import random_rotations
from formulations.bounds.so3_moments.residual_bound import (
    Progress,
    program_size,
    residual_values,
    sampled_program,
    sector_families,
)
from formulations.bounds.so3_moments.spectral_limits import largest_residual
from nlp.errors import LockedJointError

_GAP = 1e-8
_FRESH = 40


class SolverFailureError(LockedJointError):
    """The solver gave no multipliers at all."""


@dataclass(frozen=True)
class Conditions:
    """Which conditions of a worst case are put to use.

    Parameters
    ----------
    plain
        Sectors of the plain blocks.
    scaled
        Sectors of the blocks that are multiplied by ρ_max(t) − ρ.
    localised
        Sectors of the localisers of J_f J_fᵀ − tI on any polynomial vectors.
    krylov
        Sectors of the localisers of J_f J_fᵀ − tI on Krylov vectors.
    """

    plain: tuple[RowSector, ...]
    scaled: tuple[RowSector, ...]
    localised: tuple[LocaliserSector, ...] = ()
    krylov: tuple[KrylovSector, ...] = ()


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
    size, status, iterations, seconds
        Of the program.
    dual_residual, smallest_eigenvalue
        Of the solver's multipliers.
    check
        Details of the check at fresh configurations.
    """

    t: float
    margin: float
    size: ProgramSize
    status: str
    iterations: int | None
    dual_residual: float
    smallest_eigenvalue: float
    check: Mapping[str, Any] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def excluded(self) -> bool:
        """Whether t is excluded, numerically."""
        return self.margin < 0


def condition_families(conditions: Conditions, joints: int, t: float) -> list[BlockFamily]:
    """Return the blocks that are positive semidefinite wherever the worst case is σ² ≥ t."""
    limit = largest_residual(joints, t)
    size = 5 * joints / 3  # the mean of ρ, so that all blocks are of one size

    def room(rotations: Floats) -> Floats:
        return (limit - residual_values(rotations)) / size

    plain = sector_families(conditions.plain, joints)
    scaled = [
        ScaledBlocks(family, room) for family in sector_families(conditions.scaled, joints)
    ]
    localised = [MatrixLocaliser(sector, joints, ((1, t),)) for sector in conditions.localised]
    krylov = [KrylovLocaliser(sector, joints, t) for sector in conditions.krylov]
    return [
        *plain,
        *scaled,
        *(family for family in localised if family.blocks),
        *(family for family in krylov if family.blocks),
    ]


def exclude_worst_case(
    t: float,
    conditions: Conditions,
    joints: int,
    *,
    seed: int = 0,
    progress: Progress | None = None,
) -> Exclusion:
    """Try to show that no unit revolute Jacobian has a worst case σ² ≥ t.

    Parameters
    ----------
    t
        The squared worst case; at most (n − 6)/3.
    conditions
        What is put to use.
    joints
        Number n of joints, at least 7.
    seed
        Of the configurations.
    progress
        Told in words what is being done.
    """
    tell = progress or (lambda _: None)
    rng = np.random.default_rng(seed)
    clock = [time.perf_counter()]
    families = condition_families(conditions, joints, t)
    program = sampled_program(families, residual_values, joints, rng, tell)
    margins = margin_program(program)
    clock.append(time.perf_counter())
    tell(f"solving: {program.moments} moments, {len(program.blocks)} blocks")
    outcome = solve_with_predictor_corrector(margins, gap=_GAP, progress=tell)
    clock.append(time.perf_counter())
    if outcome.multipliers is None:
        raise SolverFailureError(outcome.status)
    multipliers = outcome.multipliers
    cleaned = [nearest_semidefinite(x) for x in multipliers]
    total = sum(float(np.trace(x)) for x, _ in cleaned)
    fresh = random_rotations(rng, _FRESH, joints)
    # Localisers on any vectors have no second way of evaluation.
    plain_fresh = None if conditions.localised else random_rotations(rng, 1, joints)
    tell("checking the identity at fresh configurations")
    check = margin_check(
        families, [x / total for x, _ in cleaned], program.blocks, fresh, plain_fresh
    )
    clock.append(time.perf_counter())
    return Exclusion(
        t=t,
        margin=-check.checked_bound,
        size=program_size(program),
        status=outcome.status,
        iterations=outcome.iterations,
        dual_residual=float(np.abs(margins.dual_residual(multipliers)).max()),
        smallest_eigenvalue=min(lowest for _, lowest in cleaned),
        check=check.to_dict(),
        seconds=dict(zip(("blocks", "solver", "check"), np.diff(clock).tolist(), strict=True)),
    )


def margin_check(
    families: Sequence[BlockFamily],
    multipliers: Sequence[Floats],
    blocks: Sequence[Floats],
    fresh: Floats,
    plain_fresh: Floats | None = None,
) -> IdentityCheck:
    """Check 0 − bound = Σ ⟨X, B(x)⟩ at fresh configurations, two ways at the second ones."""
    bound = -sum(float(np.vdot(x, b[0])) for x, b in zip(multipliers, blocks, strict=True))

    def nothing(rotations: Floats) -> Floats:
        return np.zeros(len(rotations))

    return check_identity(
        families, multipliers, bound, nothing, fresh, plain_fresh, plain_condition_sum
    )
