"""Exclude a worst case σ² ≥ t: show that no configuration meets the conditions it implies.

If M − j_f j_fᵀ ⪰ tI for every joint f, then t Σ_k 1/(λ_k − t) ≤ n − 6 for the eigenvalues λ of
M = JJᵀ (see `closed_form`), and Σ λ_k = 2n for unit revolute columns. Hence
ρ = ½ Σ (λ_k − n/3)² is at most some ρ_max(t), which falls as t grows.

The conditions are the plain blocks B ⪰ 0; (ρ_max(t) − ρ)B ⪰ 0 for blocks of low degree; and
localisers of J_f J_fᵀ − tI. If positive semidefinite multipliers with Σ tr X = 1 make
Σ ⟨X, B(x)⟩ equal to a negative number for all x, t is not reached. For a proof, `verification`
bounds how far the sum may be from that number.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from formulations.bounds.closed_form import largest_residual, mean_residual, root_above
from formulations.bounds.so3_moments.blocks.localisers import KrylovLocaliser, ScaledBlocks
from formulations.bounds.so3_moments.blocks.sampled_blocks import BlockFamily, sector_families
from formulations.bounds.so3_moments.certifying import search_certificate, verify_search
from formulations.bounds.so3_moments.global_bound import Evidence
from formulations.bounds.so3_moments.programs.moment_program import (
    MomentProgram,
    margin_program,
)
from formulations.bounds.so3_moments.programs.multipliers import refined_multipliers
from formulations.bounds.so3_moments.relaxation import (
    FRESH,
    Progress,
    SolvedRelaxation,
    residual_values,
    silent,
    solve_relaxation,
)
from formulations.bounds.so3_moments.representations.rounding import (
    require_extended_precision,
)
from formulations.bounds.so3_moments.representations.row_sectors import RowSector
from formulations.bounds.so3_moments.representations.wigner import random_rotations
from formulations.existence.certificate import CertificateError
from nlp.arrays import FloatArray, Rng
from nlp.files import prepare_file, write_text

_GAP = 1e-8
_HOW_CHECKED = (
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
class WorstCaseConditions:
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


def condition_families(
    conditions: WorstCaseConditions, joints: int, t: float
) -> list[BlockFamily]:
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
    conditions: WorstCaseConditions,
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
        _HOW_CHECKED,
        unit_trace=True,
    )
    return -bound, evidence


def prove_exclusion(
    t: float,
    conditions: WorstCaseConditions,
    joints: int,
    *,
    rng: Rng = 0,
    progress: Progress = silent,
    out: Path | None = None,
) -> tuple[float, Evidence]:
    """Prove that no unit revolute Jacobian has a worst case σ² ≥ t, by a certificate.

    Parameters
    ----------
    t, conditions, joints, rng, progress
        As in `exclude_worst_case`.
    out
        Where to write the certificate; nowhere if left out.

    Returns
    -------
    bound, evidence
        √t, rounded up, which the certificate states. And the program, its solution and what
        was verified.

    Raises
    ------
    NoExtendedPrecisionError
        If this machine has no extended precision.
    SolverFailureError
        If the solver gives no multipliers.
    CertificateError
        If t is not excluded; no certificate is written then.
    FileError
        If the certificate cannot be written.
    """
    require_extended_precision()
    if out is not None:
        prepare_file(out)
    families = condition_families(conditions, joints, t)
    solved = solve_exclusion(families, joints, np.random.default_rng(rng), progress)
    multipliers = refined_multipliers(solved.program, solved.multipliers)
    # 0 − constant = Σ ⟨X, B(x)⟩ but for rounding.
    constant = without_objective(solved).dual_value(multipliers)
    if constant <= 0:
        raise CertificateError(f"σ² ≥ {t} is not excluded: there is no certificate.")
    bound = root_above(Fraction(t))
    certificate = search_certificate(families, multipliers, constant, bound, joints, t)
    _, evidence = verify_search(solved, multipliers, certificate, progress)
    if out is not None:
        write_text(out, certificate.to_json())
    return bound, evidence


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
