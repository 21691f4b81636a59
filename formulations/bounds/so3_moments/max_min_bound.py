"""An upper bound on the worst case of every unit revolute Jacobian after one locked joint."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from formulations.bounds.certified import best_known
from formulations.bounds.closed_form import root_above
from formulations.bounds.so3_moments.fixed_worst_case import (
    WorstCaseConditions,
    exclude_worst_case,
    prove_exclusion,
)
from formulations.bounds.so3_moments.global_bound import GlobalBound, Kind
from formulations.bounds.so3_moments.null_vector_bound import exclude_with_signs
from formulations.bounds.so3_moments.relaxation import Progress, check_joints, silent
from formulations.bounds.so3_moments.representations.row_sectors import (
    RowSector,
    without_repetition,
)
from formulations.bounds.so3_moments.residual_bound import DEGREE_4
from nlp.arrays import Rng, one_blas_thread
from nlp.errors import InputError
from nlp.starts import seed_of

LOCALISED = "localised"
NULL_VECTOR = "null-vector"
# The squared worst cases that are excluded for seven joints.
EXCLUDED = {LOCALISED: 0.3279, NULL_VECTOR: 0.3275}
# Squares of total spin 2 and 3 matter here, though not for the residual.
_SQUARES = [
    *(RowSector(0, c, spin, 6) for c in (0, 2) for spin in (0, 1, 2)),
    RowSector(0, 0, 3, 6),
    *(RowSector(2, 0, spin, 6) for spin in (0, 1, 2)),
    RowSector(2, 2, 0, 6),
    RowSector(4, 0, 0, 6),
    *(RowSector(6, c, 0, 6) for c in (0, 2)),
]
CONDITIONS = WorstCaseConditions(
    plain=without_repetition([*DEGREE_4, *_SQUARES]),
    scaled=DEGREE_4,
    krylov=tuple(
        RowSector(k, c, spin, 4, locked)
        for k, locked in ((0, 0), (2, 0), (1, 1))
        for spin in range(3)
        for c in (0, 2, 4)
    ),
)
# With the signs of the null vector, squares of larger total spin are worth their time.
_MORE_SQUARES = (RowSector(0, 2, 3, 6), RowSector(0, 0, 4, 6))
SIGNED = replace(CONDITIONS, plain=without_repetition([*CONDITIONS.plain, *_MORE_SQUARES]))


@one_blas_thread()
def max_min_bound(
    preset: str | None = None,
    joints: int = 7,
    *,
    rigorous: bool = False,
    seed: Rng | None = None,
    rng: Rng | None = None,
    progress: Progress = silent,
    out: Path | None = None,
) -> GlobalBound:
    """Bound the worst case (5) of all unit revolute Jacobians from above.

    One fixed worst case is excluded by conditions that it implies.

    Parameters
    ----------
    preset
        ``"localised"``, the default, excludes σ² = 0.3279, which is 0.20 % above what is
        attained in σ, in about 1.5 minutes, or four if rigorous, and 1.3 GB.
        ``"null-vector"`` adds conditions on the columns with the signs of the null vector, and excludes σ² = 0.3275, numerically
        only, in about five minutes and 4 GB. Both are for 7 joints.
    joints
        Number n of joints, 7 to 9. From 8 joints on, isotropic Jacobians exist, the residual
        can be 0 and the bound is that of eq. (6); nothing is computed then.
    rigorous
        Write a certificate of the exclusion and verify it, all rounding bounded.
    seed, rng
        Seed of the sampled and of the fresh configurations, or a generator.
    progress
        Receives a short message at each step.
    out
        Where to write the certificate of a rigorous exclusion; nowhere if left out.

    Returns
    -------
    GlobalBound
        On σ, ``"numerical"`` or ``"rigorous"``; ``"closed form"`` from 8 joints on, or where
        the worst case is not excluded numerically.

    Raises
    ------
    InputError
        If the preset or the number of joints is not allowed, or there is no certificate.
    NoExtendedPrecisionError
        If it is to be rigorous and this machine has no extended precision.
    SolverFailureError
        If the solver gives no multipliers.
    CertificateError
        If it is to be rigorous, but the worst case is not excluded.
    FileError
        If the certificate cannot be written.

    Notes
    -----
    The measure and eq. (6) are those of Maciejewski and Roberts (1995).
    """
    preset, seed = preset or LOCALISED, seed_of(seed, rng)
    if preset not in EXCLUDED:
        raise InputError("preset", preset, ", ".join(EXCLUDED))
    check_joints(joints, smallest=7)
    if preset == NULL_VECTOR and rigorous:
        raise InputError("rigorous", rigorous, f"False for the preset {preset}")
    if out is not None and (not rigorous or joints > 7):
        raise InputError("--out", str(out), "none without --rigorous and 7 joints")
    best = best_known("max-min", "unit-revolute", joints)
    closed_form = root_above(Fraction(joints - 6, 3))
    if joints > 7:
        return GlobalBound(
            "max-min", joints, "", "closed form", closed_form, best, how_checked="eq. (6)"
        )
    t = EXCLUDED[preset]
    if rigorous:
        bound, evidence = prove_exclusion(
            t, CONDITIONS, joints, rng=seed, progress=progress, out=out
        )
        return GlobalBound("max-min", joints, preset, "rigorous", bound, best, **vars(evidence))
    if preset == NULL_VECTOR:
        margin, evidence = exclude_with_signs(t, SIGNED, rng=seed, progress=progress)
    else:
        margin, evidence = exclude_worst_case(
            t, CONDITIONS, joints, rng=seed, progress=progress
        )
    excluded = margin < 0
    evidence = replace(
        evidence,
        how_checked=evidence.how_checked if excluded else "not excluded; eq. (6)",
        check={"excluded": t, "margin": margin, **evidence.check},
    )
    kind: Kind = "numerical" if excluded else "closed form"
    bound = root_above(Fraction(t)) if excluded else closed_form
    return GlobalBound("max-min", joints, preset, kind, bound, best, **vars(evidence))
