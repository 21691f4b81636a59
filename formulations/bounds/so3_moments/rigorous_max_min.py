"""The exclusion of a worst case σ² ≥ t as a theorem: all rounding is accounted for.

Let s(x) = Σ ⟨X, B(x)⟩ be the sum of squares and localisers of `fixed_worst_case`, averaged over
all orders of the joints, and c < 0 the constant that it equals but for rounding. Where σ² ≥ t,
s ≥ 0, whatever the factors of the multipliers are. f = s − c is an invariant polynomial of
degree at most 12 in J. So |f| ≤ δ everywhere, as in `rigorous_residual`. If c + δ < 0, no
Jacobian has σ² ≥ t.
"""

from collections.abc import Sequence
from math import ceil, inf, nextafter, sqrt
from pathlib import Path

import numpy as np

from formulations.bounds.so3_moments.blocks.localisers import KrylovLocaliser, ScaledBlocks
from formulations.bounds.so3_moments.blocks.sampled_blocks import BlockFamily, RowBlocks
from formulations.bounds.so3_moments.certificate import (
    BoundCertificate,
    SectorSquares,
    squares_of,
)
from formulations.bounds.so3_moments.fixed_worst_case import (
    Conditions,
    condition_families,
    solve_exclusion,
    without_objective,
)
from formulations.bounds.so3_moments.global_bound import Evidence
from formulations.bounds.so3_moments.programs.multipliers import refined_multipliers
from formulations.bounds.so3_moments.relaxation import Progress, silent
from formulations.bounds.so3_moments.representations.rounding import (
    require_extended_precision,
)
from formulations.bounds.so3_moments.rigorous_identity import (
    check_degrees,
    conditions_defect,
    multiplier_factor,
    with_multipliers,
)
from formulations.bounds.so3_moments.verification import candidate_points, degree_of
from formulations.existence.certificate import CertificateError
from nlp.arrays import FloatArray, Rng
from nlp.errors import InputError
from nlp.files import prepare_file, write_text

_LARGEST_DEGREE = 12
# Of the bound that a certificate states.
_DIGITS = 8
_HOW_CHECKED = (
    "a sum of squares and localisers by construction; its difference from a negative constant "
    "is an invariant of degree 12, bounded everywhere by its values at as many points, all "
    "rounding bounded"
)


def prove_exclusion(
    t: float,
    conditions: Conditions,
    joints: int,
    *,
    rng: Rng = 0,
    progress: Progress = silent,
    out: Path | None = None,
) -> tuple[float, Evidence]:
    """Try to prove that no unit revolute Jacobian has a worst case σ² ≥ t.

    Parameters
    ----------
    t, conditions, joints, rng, progress
        As in `exclude_worst_case`.
    out
        Where to write the certificate; nowhere if left out.

    Returns
    -------
    margin, evidence
        c + δ; t is excluded if it is negative, under the standard model of floating point
        arithmetic. The `check` of the evidence holds c, the parts of δ, and δ.

    Raises
    ------
    InputError
        If a condition has a degree above 12.
    SolverFailureError
        If the solver gives no multipliers.
    NoBasisError
        If the points do not determine all invariants.
    CertificateError
        If t is not excluded, so that there is no certificate to write.
    FileError
        If the certificate cannot be written.
    """
    require_extended_precision()
    if out is not None:
        prepare_file(out)
    generator = np.random.default_rng(rng)
    families = condition_families(conditions, joints, t)
    check_degrees(families, _LARGEST_DEGREE)
    solved = solve_exclusion(families, joints, generator, progress)
    multipliers = refined_multipliers(solved.program, solved.multipliers)
    # 0 − (−c) = Σ ⟨X, B(x)⟩ but for f.
    constant = -without_objective(solved).dual_value(multipliers)
    progress("bounding the difference of the two sides over all configurations")
    degree = degree_of(conditions.plain, conditions.scaled, conditions.krylov)
    candidates, points = candidate_points(joints, degree, generator)
    details = conditions_defect(
        families,
        multipliers,
        -constant,
        candidates,
        degree=degree,
        points=points,
        progress=progress,
    )
    lowest = float(min(np.linalg.eigvalsh(x)[0] for x in multipliers))
    check = {"constant": constant, **details}
    evidence = solved.evidence(_HOW_CHECKED, check, multipliers, lowest, phase="proof")
    margin = nextafter(constant + details["defect"], inf)
    if out is not None:
        if not margin < 0:
            raise CertificateError(f"σ² ≥ {t} is not excluded: no certificate was written.")
        certificate = exclusion_certificate(t, families, multipliers, -constant, joints)
        write_text(out, certificate.to_json())
    return margin, evidence


def exclusion_certificate(
    t: float,
    families: Sequence[BlockFamily],
    multipliers: Sequence[FloatArray],
    constant: float,
    joints: int,
) -> BoundCertificate:
    """Return the certificate of σ² < t, from −`constant` = Σ ⟨X, B(x)⟩.

    What it states is √t, rounded up.
    """
    held: dict[str, list[SectorSquares]] = {"sectors": [], "scaled": [], "krylov": []}
    for family, own in with_multipliers(families, multipliers):
        rows = family.family if isinstance(family, ScaledBlocks) else family
        if not isinstance(rows, RowBlocks):
            raise InputError("families", type(rows).__name__, "blocks of rows")
        name = "krylov" if isinstance(rows, KrylovLocaliser) else "sectors"
        name = "scaled" if rows is not family else name
        held[name] += squares_of([rows], [multiplier_factor(x) for x in own])
    stated = ceil(sqrt(t) * 10**_DIGITS) / 10**_DIGITS
    parts = {name: tuple(some) for name, some in held.items()}
    return BoundCertificate("max-min", joints, stated, constant, excluded=t, **parts)
