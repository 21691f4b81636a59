"""A lower bound on the residual of every unit revolute Jacobian.

ρ(x) = ½‖JJᵀ − (n/3)I‖_F² is a function of n rotations. Averaged over the frame, the phase,
conjugation, the order and the signs of the columns it stays as it is, so a bound may be sought
among averaged sums of squares: a moment relaxation (Lasserre, 2001) reduced by symmetry.
"""

from collections.abc import Mapping
from dataclasses import replace
from math import floor
from pathlib import Path

import numpy as np

from formulations.bounds.certified import best_known
from formulations.bounds.so3_moments.blocks.sampled_blocks import SectorBlocks, sector_families
from formulations.bounds.so3_moments.certifying import search_certificate, verify_search
from formulations.bounds.so3_moments.global_bound import Evidence, GlobalBound
from formulations.bounds.so3_moments.programs.multipliers import refined_multipliers
from formulations.bounds.so3_moments.relaxation import (
    FRESH,
    Progress,
    check_joints,
    residual_values,
    silent,
    solve_relaxation,
)
from formulations.bounds.so3_moments.representations.rounding import (
    require_extended_precision,
)
from formulations.bounds.so3_moments.representations.row_sectors import (
    RowSector,
    degree_sectors,
    without_repetition,
)
from formulations.bounds.so3_moments.representations.wigner import random_rotations
from nlp.arrays import Rng, one_blas_thread
from nlp.errors import InputError
from nlp.files import prepare_file, write_text

#: Rows of degree 4, which alone give no more than 0 for seven joints.
DEGREE_4 = tuple(degree_sectors(4, range(3)))
# With rows of degree 6; total spin 1 is needed.
RESIDUAL_PRESETS: Mapping[str, tuple[RowSector, ...]] = {
    "compact": without_repetition(
        [
            *DEGREE_4,
            RowSector(2, 0, 0, 6),
            RowSector(6, 0, 0, 6),
            RowSector(2, 0, 1, 6),
        ]
    ),
    "tight": without_repetition([*DEGREE_4, *degree_sectors(6, range(2))]),
}
_HOW_CHECKED = (
    "sum-of-squares identity at fresh random configurations, multipliers made positive "
    "semidefinite, largest difference subtracted"
)
# Multipliers well inside of the cone can be made to satisfy the equations to the last digits.
_RIGOROUS_GAP = 3e-8
# What a certificate states before it is verified: nothing, as ρ ≥ 0. Afterwards it states what
# was proved, less a share of δ, rounded down to so many digits: elsewhere δ may be larger.
_NOTHING, _SHARE, _DIGITS = -1.0, 0.1, 8


def residual_preset(name: str) -> tuple[RowSector, ...]:
    """Return the rows of a preset of the residual bound.

    Raises
    ------
    InputError
        If there is no such preset.
    """
    if name not in RESIDUAL_PRESETS:
        raise InputError("preset", name, ", ".join(RESIDUAL_PRESETS))
    return RESIDUAL_PRESETS[name]


@one_blas_thread()
def residual_bound(
    preset: str = "compact",
    joints: int = 7,
    *,
    rng: Rng = 0,
    progress: Progress = silent,
) -> GlobalBound:
    """Bound ½‖JJᵀ − (n/3)I‖_F² of all unit revolute Jacobians from below, numerically.

    Parameters
    ----------
    preset
        ``"compact"`` or ``"tight"``.
    joints
        Number n of joints, 6 to 9.
    rng
        Seed of the sampled and of the fresh configurations, or a generator.
    progress
        Receives a short message at each step.

    Returns
    -------
    GlobalBound
        Of kind ``"numerical"``; also if the solver fails: then the bound is 0, which needs no
        proof, and `status` gives the reason.

    Raises
    ------
    InputError
        If the preset or the number of joints is not allowed.

    Notes
    -----
    The residual is that of Maciejewski and Roberts (1995), Section 4, in a form that does not
    depend on the frame.
    """
    sectors = residual_preset(preset)
    check_joints(joints)
    generator = np.random.default_rng(rng)
    families = sector_families(sectors, joints)
    solved = solve_relaxation(families, joints, generator, progress=progress)
    if solved.outcome.multipliers is None:
        bound, evidence = 0.0, solved.evidence("nothing to check: ρ ≥ 0")
    else:
        progress("checking the identity at fresh configurations")
        fresh = random_rotations(generator, FRESH, joints)
        bound, evidence = solved.checked(solved.sampled, residual_values, fresh, _HOW_CHECKED)
        bound = max(0.0, bound)
    best = best_known("residual", "unit-revolute", joints)
    return GlobalBound("residual", joints, preset, "numerical", bound, best, **vars(evidence))


@one_blas_thread()
def rigorous_residual_bound(
    preset: str = "compact",
    joints: int = 7,
    *,
    rng: Rng = 0,
    progress: Progress = silent,
    out: Path | None = None,
) -> GlobalBound:
    """Prove a lower bound on ½‖JJᵀ − (n/3)I‖_F² of all unit revolute Jacobians.

    The sum of squares of `residual_bound` is written to a certificate and verified from there.

    Parameters
    ----------
    preset, joints, rng, progress
        As in `residual_bound`.
    out
        Where to write the certificate; nowhere if left out.

    Returns
    -------
    GlobalBound
        Of kind ``"rigorous"``, with the bound that the certificate states: it rests on the
        standard model of double precision arithmetic and not on the solver. Its `check` holds
        what was verified.

    Raises
    ------
    InputError
        If the preset or the number of joints is not allowed.
    NoExtendedPrecisionError
        If this machine has no extended precision.
    SolverFailureError
        If the solver gives no multipliers.
    CertificateError
        If they do not prove even ρ ≥ −1.
    FileError
        If the certificate cannot be written.
    """
    require_extended_precision()
    sectors = residual_preset(preset)
    check_joints(joints)
    if out is not None:
        prepare_file(out)
    families = sector_families(sectors, joints)
    bound, evidence = _proved(families, np.random.default_rng(rng), progress, out)
    best = best_known("residual", "unit-revolute", joints)
    return GlobalBound("residual", joints, preset, "rigorous", bound, best, **vars(evidence))


def _proved(
    families: list[SectorBlocks],
    rng: np.random.Generator,
    progress: Progress,
    out: Path | None,
) -> tuple[float, Evidence]:
    joints = families[0].joints
    solved = solve_relaxation(families, joints, rng, gap=_RIGOROUS_GAP, progress=progress)
    multipliers = refined_multipliers(solved.program, solved.multipliers)
    constant = solved.program.dual_value(multipliers)
    certificate = search_certificate(families, multipliers, constant, _NOTHING, joints)
    verified, evidence = verify_search(solved, multipliers, certificate, progress)
    surely = verified.bound - _SHARE * verified.check["defect"]
    stated = floor(surely * 10**_DIGITS) / 10**_DIGITS
    if out is not None:
        write_text(out, replace(certificate, bound=stated).to_json())
    return max(0.0, stated), evidence
