"""A lower bound on the residual of every unit revolute Jacobian.

ρ(x) = ½‖JJᵀ − (n/3)I‖_F² is a function of n rotations. Averaged over the frame, the phase,
conjugation, the order and the signs of the columns it stays as it is, so a bound may be sought
among averaged sums of squares: a moment relaxation (Lasserre, 2001) reduced by symmetry.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from formulations.bounds.certified import best_known
from formulations.bounds.so3_moments.certifying import prepare_proof, verify_search
from formulations.bounds.so3_moments.global_bound import Evidence, GlobalBound, Kind
from formulations.bounds.so3_moments.relaxation import (
    FRESH,
    Progress,
    check_joints,
    silent,
    solve_relaxation,
)
from formulations.bounds.so3_moments.row_sectors import (
    DEGREE_4,
    RowSector,
    degree_sectors,
    without_repetition,
)
from formulations.bounds.so3_moments.sampled_blocks import SectorBlocks, sector_families
from formulations.bounds.so3_moments.wigner import random_rotations, residual_values
from nlp.arrays import Rng, one_blas_thread
from nlp.errors import InputError
from nlp.starts import seed_of

# With rows of degree 6; total spin 1 is needed.
RESIDUAL_PRESETS: Mapping[str, tuple[RowSector, ...]] = {
    "compact": without_repetition(
        [*DEGREE_4, RowSector(2, 0, 0, 6), RowSector(6, 0, 0, 6), RowSector(2, 0, 1, 6)]
    ),
    "tight": without_repetition([*DEGREE_4, *degree_sectors(6, range(2))]),
}
_HOW_CHECKED = (
    "sum-of-squares identity at fresh random configurations, multipliers made positive "
    "semidefinite, largest difference subtracted"
)
# Multipliers well inside of the cone can be made to satisfy the equations to the last digits.
_RIGOROUS_GAP = 3e-8


@one_blas_thread()
def residual_bound(
    preset: str | None = None,
    joints: int = 7,
    *,
    rigorous: bool = False,
    seed: Rng | None = None,
    rng: Rng | None = None,
    progress: Progress = silent,
    out: Path | None = None,
) -> GlobalBound:
    """Bound ½‖JJᵀ − (n/3)I‖_F² of all unit revolute Jacobians from below.

    Parameters
    ----------
    preset
        ``"compact"``, the default, or ``"tight"``.
    joints
        Number n of joints, 6 to 9.
    rigorous
        Write the sum of squares to a certificate and verify it from there, all rounding
        bounded.
    seed, rng
        Seed of the sampled and of the fresh configurations, or a generator.
    progress
        Receives a short message at each step.
    out
        Where to write the certificate of a rigorous bound; nowhere if left out.

    Returns
    -------
    GlobalBound
        Of kind ``"numerical"``; also if the solver fails: then the bound is 0, which needs no
        proof, and `status` gives the reason. Or of kind ``"rigorous"``, as the certificate
        states it: it rests on the standard model of double precision arithmetic and not on
        the solver. Its `check` holds what was verified.

    Raises
    ------
    InputError
        If the preset or the number of joints is not allowed, or there is no certificate.
    NoExtendedPrecisionError
        If it is to be rigorous and this machine has no extended precision.
    SolverFailureError, CertificateError
        If it is to be rigorous, and the solver gives no multipliers, or they do not prove even
        ρ ≥ −1.
    FileError
        If the certificate cannot be written.

    Notes
    -----
    The residual is that of Maciejewski and Roberts (1995), Section 4, in a form that does not
    depend on the frame.
    """
    preset = preset or "compact"
    if preset not in RESIDUAL_PRESETS:
        raise InputError("preset", preset, ", ".join(RESIDUAL_PRESETS))
    check_joints(joints)
    generator = np.random.default_rng(seed_of(seed, rng))
    families = sector_families(RESIDUAL_PRESETS[preset], joints)
    if rigorous:
        bound, evidence = _proved(families, generator, progress, out)
    elif out is not None:
        raise InputError("--out", str(out), "none without --rigorous")
    else:
        bound, evidence = _checked(families, generator, progress)
    kind: Kind = "rigorous" if rigorous else "numerical"
    best = best_known("residual", "unit-revolute", joints)
    return GlobalBound(
        "residual", joints, preset, kind, max(0.0, bound), best, **vars(evidence)
    )


def _checked(
    families: list[SectorBlocks], rng: np.random.Generator, progress: Progress
) -> tuple[float, Evidence]:
    joints = families[0].joints
    solved = solve_relaxation(families, joints, rng, progress=progress)
    if solved.outcome.multipliers is None:
        return 0.0, solved.evidence("nothing to check: ρ ≥ 0")
    progress("checking the identity at fresh configurations")
    fresh = random_rotations(rng, FRESH, joints)
    return solved.checked(solved.sampled, residual_values, fresh, _HOW_CHECKED)


def _proved(
    families: list[SectorBlocks], rng: np.random.Generator, progress: Progress, out: Path | None
) -> tuple[float, Evidence]:
    prepare_proof(out)
    joints = families[0].joints
    solved = solve_relaxation(families, joints, rng, gap=_RIGOROUS_GAP, progress=progress)
    return verify_search(solved, solved.program, joints, progress, out)
