"""A lower bound on the residual that is a theorem: all rounding is accounted for.

Let s(x) ≥ 0 be the sum of squares of a numerical bound b and s̄ ≥ 0 its average over all orders
of the joints. Then f = ρ − b − s̄ is an invariant polynomial of degree at most 12 in J. That
space has a known dimension, so f is known by its values at as many points: with bounds on the
errors of these values, |f| ≤ δ everywhere, and ρ = b + s̄ + f ≥ b − δ.
"""

from collections.abc import Sequence
from math import inf, nextafter

import numpy as np

from formulations.bounds.certified import best_known
from formulations.bounds.so3_moments.blocks.enclosed_squares import (
    SAFETY,
    enclosed_block,
    enclosed_sums,
)
from formulations.bounds.so3_moments.blocks.invariant_basis import invariant_basis
from formulations.bounds.so3_moments.blocks.invariants import invariant_dimension
from formulations.bounds.so3_moments.blocks.sampled_blocks import SectorBlocks, sector_families
from formulations.bounds.so3_moments.global_bound import GlobalBound
from formulations.bounds.so3_moments.programs.multipliers import (
    refined_multipliers,
    semidefinite_root,
)
from formulations.bounds.so3_moments.relaxation import (
    Progress,
    check_joints,
    residual_values,
    silent,
    solve_relaxation,
)
from formulations.bounds.so3_moments.representations.rounding import (
    EXTENDED_UNIT,
    ROTATION_ENTRY,
    UNIT,
    gamma,
    require_extended_precision,
)
from formulations.bounds.so3_moments.representations.wigner import (
    jacobians_of,
    random_rotations,
)
from formulations.bounds.so3_moments.residual_bound import residual_preset
from nlp.arrays import FloatArray, Rng, one_blas_thread
from nlp.errors import InputError

_DEGREE = 12
_CANDIDATES, _POINTS = 1000, 600
# Multipliers well inside of the cone can be made to satisfy the equations to the last digits.
_GAP = 3e-8
_HOW_CHECKED = (
    "sum of squares by construction; its difference from the residual is an invariant of "
    "degree 12, bounded everywhere by its values at as many points, all rounding bounded"
)


@one_blas_thread()
def rigorous_residual_bound(
    preset: str = "fast",
    joints: int = 7,
    *,
    rng: Rng = 0,
    progress: Progress = silent,
) -> GlobalBound:
    """Prove a lower bound on ½‖JJᵀ − (n/3)I‖_F² of all unit revolute Jacobians.

    Parameters
    ----------
    preset
        ``"fast"``, ``"compact"`` or ``"tight"``: where the sum of squares comes from.
    joints
        Number n of joints, 6 to 9.
    rng
        Seed of the configurations, or a generator.
    progress
        Receives a short message at each step.

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
    """
    require_extended_precision()
    sectors = residual_preset(preset)
    check_joints(joints)
    generator = np.random.default_rng(rng)
    families = sector_families(sectors, joints)
    solved = solve_relaxation(families, joints, generator, gap=_GAP, progress=progress)
    multipliers = refined_multipliers(solved.program, solved.multipliers)
    progress("bounding the difference of the two sides over all configurations")
    candidates = random_rotations(generator, _CANDIDATES, joints, extended=True)
    claimed = solved.program.dual_value(multipliers)
    details = bound_defect(
        families, multipliers, claimed, candidates, points=_POINTS, progress=progress
    )
    bound = max(0.0, nextafter(claimed - details["defect"], -inf))
    evidence = solved.evidence(
        _HOW_CHECKED,
        {"claimed_bound": claimed, **details},
        multipliers,
        float(min(np.linalg.eigvalsh(x)[0] for x in multipliers)),
        phase="proof",
    )
    best = best_known("residual", "unit-revolute", joints)
    return GlobalBound("residual", joints, preset, "rigorous", bound, best, **vars(evidence))


def bound_defect(
    families: Sequence[SectorBlocks],
    multipliers: Sequence[FloatArray],
    claimed: float,
    candidates: FloatArray,
    *,
    degree: int = _DEGREE,
    points: int | None = None,
    progress: Progress = silent,
) -> dict[str, float]:
    """Bound |f| = |ρ − claimed − s̄| over all configurations.

    Parameters
    ----------
    families
        Blocks with rows of degree at most `degree`/2.
    multipliers
        X of each block. Only a factor of each is used, so they need not be semidefinite.
    claimed
        The constant b.
    candidates
        Rotations in extended precision, (candidates, n, 3, 3).
    degree
        Twice the largest degree of the rows, at least 4.
    points
        How many candidates to keep, those that determine the invariants best; all by default.
    progress
        Receives a short message at each step.

    Returns
    -------
    dict
        ``largest_value``, the largest |f| computed at the points, and ``largest_error``, the
        largest bound on its error there; ``amplification``, how much larger f may be
        elsewhere, per unit of root mean square at the points; ``basis_defect``, how far the
        matrix of values may be from its assumed inverse, below 1/2; and ``defect``, δ ≥ |f|.

    Raises
    ------
    InputError
        If a block has rows of more than half of `degree`: then its squares are outside of the
        space of invariants; or if the rotations are not in extended precision.
    NoBasisError
        If the points do not determine all invariants.
    """
    for sector in (family.sector for family in families):
        if 2 * sector.degree > degree:
            raise InputError("families", sector, f"rows of degree at most {degree // 2}")
    if candidates.dtype != np.longdouble:
        raise InputError("candidates", candidates.dtype, "rotations in extended precision")
    dimension = invariant_dimension(candidates.shape[1], degree)
    progress(f"proving a basis of the {dimension} invariants of degree {degree}")
    basis, rotations = invariant_basis(candidates, degree, dimension, points)
    sums, errors = np.zeros(len(rotations)), np.zeros(len(rotations))
    remaining = iter(multipliers)
    for number, family in enumerate(families, start=1):
        progress(f"evaluating sums of squares with error bounds: {number} of {len(families)}")
        enclosed = [
            enclosed_block(family, block, _root(next(remaining))) for block in family.blocks
        ]
        part, wrong = enclosed_sums(family, enclosed, rotations)
        sums += part
        errors += wrong
    residuals = residual_values(rotations).astype(float)
    values = residuals - claimed - sums
    errors += residual_error(rotations)
    errors += gamma(len(families) + 4) * (residuals + abs(claimed) + sums)
    errors *= SAFETY
    return {
        "largest_value": float(np.abs(values).max()),
        "largest_error": float(errors.max()),
        "amplification": basis.amplification,
        "basis_defect": basis.defect,
        "defect": basis.largest_value(values, errors),
    }


def residual_error(rotations: FloatArray) -> FloatArray:
    """Return a bound on the rounding error of the residual at each point.

    The entries of J are off by `ROTATION_ENTRY` units, those of JJᵀ by the sum over the
    columns, and a square by twice the entry times that.
    """
    jacobians = jacobians_of(rotations)
    joints = jacobians.shape[-1]
    unit = EXTENDED_UNIT if rotations.dtype == np.longdouble else UNIT
    entry = joints * (2.1 * ROTATION_ENTRY * unit + 1.1 * gamma(joints + 4, unit))
    gram = jacobians @ jacobians.swapaxes(-1, -2) - joints / 3 * np.eye(6)
    size = np.sqrt(np.sum(gram**2, axis=(-1, -2)))
    whole = 6.0 * entry
    return np.asarray(SAFETY * (size * whole + whole**2 + gamma(40, unit) * size**2), float)


def _root(multiplier: FloatArray) -> FloatArray:
    """Return R with RRᵀ the nearest semidefinite matrix, without columns of zeros."""
    root, _ = semidefinite_root(multiplier)
    return np.asarray(root[:, root.any(axis=0)])
