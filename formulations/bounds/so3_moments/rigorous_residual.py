"""A lower bound on the residual that is a theorem: all rounding is accounted for.

Let s(x) ≥ 0 be the sum of squares of a numerical bound b and s̄ ≥ 0 its average over all orders
of the joints. Then f = ρ − b − s̄ is an invariant polynomial of degree at most 12 in J. That
space has a known dimension, so f is known by its values at as many points: with bounds on the
errors of these values, |f| ≤ δ everywhere, and ρ = b + s̄ + f ≥ b − δ.
"""

from collections.abc import Sequence
from math import floor, inf, nextafter
from pathlib import Path

import numpy as np

from formulations.bounds.certified import best_known
from formulations.bounds.so3_moments.blocks.enclosed_localisers import enclosed_residuals
from formulations.bounds.so3_moments.blocks.sampled_blocks import SectorBlocks, sector_families
from formulations.bounds.so3_moments.certificate import BoundCertificate, squares_of
from formulations.bounds.so3_moments.global_bound import GlobalBound
from formulations.bounds.so3_moments.programs.multipliers import refined_multipliers
from formulations.bounds.so3_moments.relaxation import (
    Progress,
    check_joints,
    silent,
    solve_relaxation,
)
from formulations.bounds.so3_moments.representations.rounding import (
    require_extended_precision,
)
from formulations.bounds.so3_moments.residual_bound import residual_preset
from formulations.bounds.so3_moments.rigorous_identity import (
    conditions_defect,
    multiplier_factor,
)
from formulations.bounds.so3_moments.verification import candidate_points, degree_of
from nlp.arrays import FloatArray, Rng, one_blas_thread
from nlp.files import prepare_file, write_text

# A certificate states less than was proved, since δ depends on the points and those of the
# verifier are others: b less 1.5 δ, rounded down to so many digits.
_ALLOWANCE, _DIGITS = 1.5, 8
# Multipliers well inside of the cone can be made to satisfy the equations to the last digits.
_GAP = 3e-8
_HOW_CHECKED = (
    "sum of squares by construction; its difference from the residual is an invariant "
    "polynomial, bounded everywhere by its values at points, all rounding bounded"
)


@one_blas_thread()
def rigorous_residual_bound(
    preset: str = "fast",
    joints: int = 7,
    *,
    rng: Rng = 0,
    progress: Progress = silent,
    out: Path | None = None,
) -> GlobalBound:
    """Prove a lower bound on ½‖JJᵀ − (n/3)I‖_F² of all unit revolute Jacobians.

    Parameters
    ----------
    preset
        ``"low"``, ``"fast"``, ``"compact"`` or ``"tight"``: where the sum of squares comes
        from.
    joints
        Number n of joints, 6 to 9.
    rng
        Seed of the configurations, or a generator.
    progress
        Receives a short message at each step.
    out
        Where to write the certificate; nowhere if left out.

    Returns
    -------
    GlobalBound
        Of kind ``"rigorous"``: it rests on the standard model of double precision arithmetic
        and not on the solver. Its `check` holds the parts of the defect.

    Raises
    ------
    InputError
        If the preset or the number of joints is not allowed.
    SolverFailureError
        If the solver gives no multipliers.
    NoBasisError
        If the points do not determine all invariants.
    FileError
        If the certificate cannot be written.
    """
    require_extended_precision()
    if out is not None:
        prepare_file(out)
    sectors = residual_preset(preset)
    check_joints(joints)
    generator = np.random.default_rng(rng)
    families = sector_families(sectors, joints)
    solved = solve_relaxation(families, joints, generator, gap=_GAP, progress=progress)
    multipliers = refined_multipliers(solved.program, solved.multipliers)
    progress("bounding the difference of the two sides over all configurations")
    degree = degree_of(sectors)
    candidates, points = candidate_points(joints, degree, generator)
    claimed = solved.program.dual_value(multipliers)
    details = conditions_defect(
        families,
        multipliers,
        claimed,
        candidates,
        objective=enclosed_residuals,
        degree=degree,
        points=points,
        progress=progress,
    )
    proved = nextafter(claimed - details["defect"], -inf)
    if out is not None:
        certificate = residual_certificate(families, multipliers, claimed, details["defect"])
        write_text(out, certificate.to_json())
    evidence = solved.evidence(
        _HOW_CHECKED,
        {"claimed_bound": claimed, **details},
        multipliers,
        float(min(np.linalg.eigvalsh(x)[0] for x in multipliers)),
        phase="proof",
    )
    best = best_known("residual", "unit-revolute", joints)
    return GlobalBound(
        "residual", joints, preset, "rigorous", max(0.0, proved), best, **vars(evidence)
    )


def residual_certificate(
    families: Sequence[SectorBlocks],
    multipliers: Sequence[FloatArray],
    claimed: float,
    defect: float,
) -> BoundCertificate:
    """Return the certificate of ρ ≥ `claimed` − `defect`; it states a little less."""
    stated = floor((claimed - _ALLOWANCE * defect) * 10**_DIGITS) / 10**_DIGITS
    squares = squares_of(families, [multiplier_factor(x) for x in multipliers])
    return BoundCertificate("residual", families[0].joints, stated, claimed, squares)
