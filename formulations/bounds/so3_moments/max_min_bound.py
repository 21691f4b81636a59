"""An upper bound on the worst case of every unit revolute Jacobian after one locked joint."""

import time
from dataclasses import replace
from math import sqrt
from pathlib import Path

from formulations.bounds.certified import best_known
from formulations.bounds.so3_moments.fixed_worst_case import (
    ROUNDING,
    Conditions,
    exclude_worst_case,
    worst_case_limit,
)
from formulations.bounds.so3_moments.global_bound import GlobalBound, Kind
from formulations.bounds.so3_moments.null_vector_bound import exclude_with_signs
from formulations.bounds.so3_moments.relaxation import Progress, check_joints, silent
from formulations.bounds.so3_moments.representations.row_sectors import (
    RowSector,
    without_repetition,
)
from formulations.bounds.so3_moments.residual_bound import RESIDUAL_PRESETS, residual_bound
from formulations.bounds.so3_moments.rigorous_max_min import prove_exclusion
from formulations.bounds.so3_moments.rigorous_residual import rigorous_residual_bound
from nlp.arrays import Rng, one_blas_thread
from nlp.errors import InputError

_HOW_CHECKED = (
    "closed form, checked in rational arithmetic, from a lower bound on the residual, which "
    "was checked so: "
)
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
CONDITIONS = Conditions(
    plain=without_repetition([*RESIDUAL_PRESETS["low"], *_SQUARES]),
    scaled=RESIDUAL_PRESETS["low"],
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
    preset: str = "fast",
    joints: int = 7,
    *,
    rigorous: bool = False,
    rng: Rng = 0,
    progress: Progress = silent,
    out: Path | None = None,
) -> GlobalBound:
    """Bound the worst case (5) of all unit revolute Jacobians from above.

    A worst case σ limits the residual to ρ_max(σ²), so a lower bound on the residual limits σ.

    Parameters
    ----------
    preset
        Of the residual bound: ``"low"``, ``"fast"``, ``"compact"`` or ``"tight"``. Or
        ``"localised"``: exclude one fixed worst case, σ² = 0.3279, by conditions that it
        implies, which is sharper (0.20 % above what is attained) and takes about four
        minutes, or six if rigorous, and 1.3 GB; for 7 joints. ``"null-vector"`` adds
        conditions on the columns with the signs of the null vector, and excludes
        σ² = 0.3275, numerically only, in about five minutes and 4 GB.
    joints
        Number n of joints, 7 to 9. From 8 joints on, isotropic Jacobians exist, the residual
        can be 0 and the bound is that of eq. (6); nothing is computed then.
    rigorous
        Bound all rounding errors too, those of the residual's bound or of the exclusion.
    rng, progress
        As in `residual_bound`.
    out
        Where to write the certificate of a rigorous exclusion; nowhere if left out. Other
        rigorous bounds follow from that of `rigorous_residual_bound`, which has its own.

    Returns
    -------
    GlobalBound
        On σ, ``"numerical"`` or ``"rigorous"``; ``"closed form"`` from 8 joints on, or where
        the preset ``"localised"`` does not exclude its worst case.

    Raises
    ------
    InputError
        If the preset or the number of joints is not allowed, or there is no certificate.
    CertificateError
        If a certificate was to be written, but the worst case is not excluded.
    FileError
        If the certificate cannot be written.

    Notes
    -----
    The measure and eq. (6) are those of Maciejewski and Roberts (1995).
    """
    if preset not in (*RESIDUAL_PRESETS, *EXCLUDED):
        raise InputError("preset", preset, ", ".join((*RESIDUAL_PRESETS, *EXCLUDED)))
    check_joints(joints, smallest=7)
    if preset == NULL_VECTOR and rigorous:
        raise InputError("rigorous", rigorous, f"False for the preset {preset}")
    if out is not None and (preset != LOCALISED or not rigorous or joints > 7):
        allowed = f"none without --rigorous, --preset {LOCALISED} and 7 joints; the other "
        allowed += "rigorous bounds follow from --quantity residual, which has a certificate"
        raise InputError("--out", str(out), allowed)
    best = best_known("max-min", "unit-revolute", joints)
    if joints > 7:
        bound = worst_case_limit(joints, 0.0)
        return GlobalBound(
            "max-min", joints, preset, "closed form", bound, best, how_checked="eq. (6)"
        )
    if preset in EXCLUDED:
        return _excluded(preset, best, rigorous, rng, progress, out)
    lower_bound = rigorous_residual_bound if rigorous else residual_bound
    residual = lower_bound(preset, joints, rng=rng, progress=progress)
    start = time.perf_counter()
    limit = worst_case_limit(joints, residual.bound)
    return replace(
        residual,
        quantity="max-min",
        bound=limit,
        best_known=best,
        how_checked=_HOW_CHECKED + residual.how_checked,
        check={"residual_bound": residual.bound, **residual.check},
        seconds={**residual.seconds, "closed form": time.perf_counter() - start},
    )


def _excluded(
    preset: str,
    best: float | None,
    rigorous: bool,
    rng: Rng,
    progress: Progress,
    out: Path | None,
) -> GlobalBound:
    """Return the root of the squared worst case if it is excluded, else the bound (6)."""
    squared, joints = EXCLUDED[preset], 7
    if preset == NULL_VECTOR:
        exclusion = exclude_with_signs(squared, SIGNED, rng=rng, progress=progress)
    elif rigorous:
        exclusion = prove_exclusion(
            squared, CONDITIONS, joints, rng=rng, progress=progress, out=out
        )
    else:
        exclusion = exclude_worst_case(squared, CONDITIONS, joints, rng=rng, progress=progress)
    margin, evidence = exclusion
    excluded = margin < 0
    evidence = replace(
        evidence,
        how_checked=evidence.how_checked if excluded else "not excluded; eq. (6)",
        check={"excluded": squared, "margin": margin, **evidence.check},
    )
    proved: Kind = "rigorous" if rigorous else "numerical"
    kind: Kind = proved if excluded else "closed form"
    bound = sqrt(squared if excluded else (joints - 6) / 3) + ROUNDING
    return GlobalBound("max-min", joints, preset, kind, bound, best, **vars(evidence))
