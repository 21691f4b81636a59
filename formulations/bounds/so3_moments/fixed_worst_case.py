"""Exclude a worst case σ² ≥ t: show that no configuration meets the conditions it implies.

If M − j_f j_fᵀ ⪰ tI for every joint f, then t Σ_k 1/(λ_k − t) ≤ n − 6 for the eigenvalues λ of
M = JJᵀ (see `closed_form`), and Σ λ_k = 2n for unit revolute columns. Hence
ρ = ½ Σ (λ_k − n/3)² is at most some ρ_max(t), which falls as t grows. So if no Jacobian has ρ
below a bound, none has a t for which ρ_max(t) is below that bound.

More is excluded by the conditions together: the plain blocks B ⪰ 0; (ρ_max(t) − ρ)B ⪰ 0 for
blocks of low degree; and localisers of J_f J_fᵀ − tI. If positive semidefinite multipliers with
Σ tr X = 1 make Σ ⟨X, B(x)⟩ equal to a negative number for all x, t is not reached.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite, sqrt

import numpy as np

from formulations.bounds.closed_form import excludes, largest_residual, mean_residual
from formulations.bounds.so3_moments.blocks.localisers import KrylovLocaliser, ScaledBlocks
from formulations.bounds.so3_moments.blocks.sampled_blocks import BlockFamily, sector_families
from formulations.bounds.so3_moments.global_bound import Evidence
from formulations.bounds.so3_moments.programs.moment_program import (
    MomentProgram,
    margin_program,
)
from formulations.bounds.so3_moments.relaxation import (
    FRESH,
    Progress,
    SolvedRelaxation,
    residual_values,
    silent,
    solve_relaxation,
)
from formulations.bounds.so3_moments.representations.row_sectors import RowSector
from formulations.bounds.so3_moments.representations.wigner import random_rotations
from nlp.arrays import FloatArray, Rng
from nlp.errors import InputError

_GAP = 1e-8
#: Room for rounding in the closed form, far more than bisection in doubles needs.
ROUNDING = 1e-12
HOW_CHECKED = (
    "a sum of squares and localisers equal to a negative constant at fresh random "
    "configurations; multipliers made positive semidefinite, largest difference subtracted"
)


@dataclass(frozen=True)
class ResidualDistance:
    """The function g(x) = (limit − ρ(x))/unit of rotations (configurations, n, 3, 3)."""

    limit: float
    unit: float

    def __call__(self, rotations: FloatArray) -> FloatArray:
        """Return g, (configurations,), in the precision of the rotations."""
        return np.asarray((self.limit - residual_values(rotations)) / self.unit)


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


def condition_families(conditions: Conditions, joints: int, t: float) -> list[BlockFamily]:
    """Return the blocks that are positive semidefinite wherever the worst case is σ² ≥ t."""
    distance = ResidualDistance(largest_residual(joints, t), mean_residual(joints))
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
    rng: Rng = 0,
    progress: Progress = silent,
) -> tuple[float, Evidence]:
    """Try to show that no unit revolute Jacobian has a worst case σ² ≥ t.

    Parameters
    ----------
    t
        The squared worst case; at most (n − 6)/3.
    conditions
        The conditions to use.
    joints
        Number n of joints, at least 7.
    rng
        Seed of the configurations, or a generator.
    progress
        Receives a short message at each step.

    Returns
    -------
    margin, evidence
        Upper bound on the largest s with every block ⪰ sI, after the check; t is excluded,
        numerically, if it is negative. And the program, its solution and the check.
    """
    generator = np.random.default_rng(rng)
    families = condition_families(conditions, joints, t)
    solved = solve_exclusion(families, joints, generator, progress)
    progress("checking the identity at fresh configurations")
    fresh = random_rotations(generator, FRESH, joints)
    bound, evidence = solved.checked(
        without_objective(solved),
        lambda where: np.zeros(len(where)),
        fresh,
        HOW_CHECKED,
        unit_trace=True,
    )
    return -bound, evidence


def solve_exclusion(
    families: Sequence[BlockFamily],
    joints: int,
    rng: np.random.Generator,
    progress: Progress = silent,
) -> SolvedRelaxation:
    """Return the solution of the program with the largest s such that every block is ⪰ sI."""
    return solve_relaxation(
        families, joints, rng, adapt=margin_program, gap=_GAP, progress=progress
    )


def without_objective(solved: SolvedRelaxation) -> MomentProgram:
    """Return the program whose dual value is b in the identity 0 − b = Σ ⟨X, B(x)⟩."""
    return replace(solved.sampled, objective=np.zeros(solved.sampled.moments))


def worst_case_limit(joints: int, residual: float) -> float:
    """Return an upper bound on the worst case σ from a lower bound on the residual ρ.

    It is found in double precision, and checked in rational arithmetic (`excludes`).

    Parameters
    ----------
    joints
        Number n of unit revolute joints, at least 7.
    residual
        A lower bound on ½‖JJᵀ − (n/3)I‖_F² of all of them.

    Raises
    ------
    InputError
        If there are fewer than 7 joints or the bound is negative or not finite.
    """
    if joints < 7:
        raise InputError("joints", joints, "an integer of at least 7")
    if not (isfinite(residual) and residual >= 0):
        raise InputError("residual", residual, "a finite number, not negative")
    low, high = 0.0, (joints - 6) / 3
    while low < (middle := 0.5 * (low + high)) < high:
        if largest_residual(joints, middle) < residual:
            high = middle
        else:
            low = middle
    sigma = sqrt(high) + ROUNDING
    if not excludes(joints, residual, sigma):
        raise ArithmeticError("the bound on the worst case fails its check in exact arithmetic")
    return sigma
