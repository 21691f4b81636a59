"""The exclusion of a worst case σ² ≥ t as a theorem: all rounding is accounted for.

Let s(x) = Σ ⟨X, B(x)⟩ be the sum of squares and localisers of `fixed_worst_case`, averaged over
all orders of the joints, and c < 0 the constant that it equals but for rounding. Where σ² ≥ t,
s ≥ 0, whatever the factors of the multipliers are. f = s − c is an invariant polynomial of
degree at most 12 in J. So |f| ≤ δ everywhere, as in `rigorous_residual`. If c + δ < 0, no
Jacobian has σ² ≥ t.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from formulations.bounds.so3_moments.blocks.enclosed_localisers import (
    EnclosedSum,
    enclosed_krylov_sum,
    enclosed_product,
)
from formulations.bounds.so3_moments.blocks.enclosed_squares import (
    SAFETY,
    enclosed_block,
    enclosed_sums,
)
from formulations.bounds.so3_moments.blocks.invariant_basis import invariant_basis
from formulations.bounds.so3_moments.blocks.invariants import invariant_dimension
from formulations.bounds.so3_moments.blocks.localisers import KrylovLocaliser, ScaledBlocks
from formulations.bounds.so3_moments.blocks.sampled_blocks import BlockFamily, SectorBlocks
from formulations.bounds.so3_moments.fixed_worst_case import (
    Conditions,
    ResidualDistance,
    condition_families,
    solve_exclusion,
)
from formulations.bounds.so3_moments.global_bound import Evidence
from formulations.bounds.so3_moments.programs.multipliers import (
    refined_multipliers,
    semidefinite_root,
)
from formulations.bounds.so3_moments.relaxation import Progress, silent
from formulations.bounds.so3_moments.representations.rounding import (
    EXTENDED_UNIT,
    gamma,
    require_extended_precision,
)
from formulations.bounds.so3_moments.representations.wigner import random_rotations
from formulations.bounds.so3_moments.verification import enclosed_residuals
from nlp.arrays import FloatArray, Rng
from nlp.errors import InputError

_DEGREE = 12
_CANDIDATES, _POINTS = 1000, 600
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
) -> tuple[float, Evidence]:
    """Try to prove that no unit revolute Jacobian has a worst case σ² ≥ t.

    Parameters
    ----------
    t, conditions, joints, rng, progress
        As in `exclude_worst_case`.

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
    """
    require_extended_precision()
    generator = np.random.default_rng(rng)
    families = condition_families(conditions, joints, t)
    check_degrees(families, _DEGREE)
    solved = solve_exclusion(families, joints, generator, progress)
    multipliers = refined_multipliers(solved.program, solved.multipliers)
    identity = replace(solved.sampled, objective=np.zeros(solved.sampled.moments))
    constant = -identity.dual_value(multipliers)
    progress("bounding the difference of the two sides over all configurations")
    candidates = random_rotations(generator, _CANDIDATES, joints, extended=True)
    details = exclusion_defect(
        families, multipliers, constant, candidates, points=_POINTS, progress=progress
    )
    lowest = float(min(np.linalg.eigvalsh(x)[0] for x in multipliers))
    check = {"constant": constant, **details}
    evidence = solved.evidence(_HOW_CHECKED, check, multipliers, lowest, phase="proof")
    return float(np.nextafter(constant + details["defect"], np.inf)), evidence


def check_degrees(families: Sequence[BlockFamily], degree: int) -> None:
    """Raise InputError unless every entry of every block has at most this degree in J.

    A block has twice the degree of its rows. The factor of a scaled block is ρ, of degree four;
    a Krylov vector has one more than its rows, and J_f J_fᵀ has two.
    """
    for family in families:
        if isinstance(family, ScaledBlocks):
            rows, more = family.family, 4
        elif isinstance(family, KrylovLocaliser):
            rows, more = family, 4
        else:
            rows, more = family, 0
        sector = getattr(rows, "sector", None)
        if sector is None:
            raise InputError("families", type(family).__name__, "blocks of rows")
        if 2 * sector.degree + more > degree:
            allowed = f"rows of degree at most {(degree - more) // 2}"
            raise InputError("families", (type(family).__name__, sector), allowed)


def exclusion_defect(
    families: Sequence[BlockFamily],
    multipliers: Sequence[FloatArray],
    constant: float,
    candidates: FloatArray,
    *,
    degree: int = _DEGREE,
    points: int | None = None,
    progress: Progress = silent,
) -> dict[str, float]:
    """Bound |f| = |s − constant| over all configurations.

    Parameters
    ----------
    families
        Plain blocks, blocks scaled by a `ResidualDistance`, and Krylov localisers.
    multipliers
        X of each block. Only a factor of each is used, so they need not be semidefinite.
    constant
        The constant c.
    candidates, degree, points, progress
        As in `bound_defect`; no entry of a block may have more than `degree`.

    Returns
    -------
    dict
        As that of `bound_defect`, for this f.

    Raises
    ------
    InputError
        If the degree of a block is too large, or there is no enclosure for its kind.
    NoBasisError
        If the points do not determine all invariants.
    """
    check_degrees(families, degree)
    dimension = invariant_dimension(candidates.shape[1], degree)
    progress(f"proving a basis of the {dimension} invariants of degree {degree}")
    basis, rotations = invariant_basis(candidates, degree, dimension, points)
    sums, errors, sizes = np.zeros((3, len(rotations)))
    start = 0
    for number, family in enumerate(families, start=1):
        progress(f"evaluating conditions with error bounds: {number} of {len(families)}")
        own = multipliers[start : start + len(family.sizes)]
        start += len(own)
        part = enclosed_condition(family, own, rotations)
        sums += part.values
        errors += part.errors
        sizes += part.sizes
    values = sums - constant
    errors = SAFETY * (errors + gamma(len(families) + 4) * (sizes + abs(constant)))
    return {
        "largest_value": float(np.abs(values).max()),
        "largest_error": float(errors.max()),
        "amplification": basis.amplification,
        "basis_defect": basis.defect,
        "defect": basis.largest_value(values, errors),
    }


def enclosed_condition(
    family: BlockFamily, multipliers: Sequence[FloatArray], rotations: FloatArray
) -> EnclosedSum:
    """Return Σ ⟨X, B(x)⟩ over the blocks of a family, averaged over all orders of the joints.

    Parameters
    ----------
    family
        Plain blocks, blocks scaled by a `ResidualDistance`, or a Krylov localiser.
    multipliers
        X of each block; a factor is used.
    rotations
        Configurations in extended precision, (configurations, n, 3, 3).

    Raises
    ------
    InputError
        If there is no enclosure for blocks of this kind.
    """
    roots = [semidefinite_root(x)[0] for x in multipliers]
    roots = [root[:, root.any(axis=0)] for root in roots]
    if isinstance(family, KrylovLocaliser):
        return enclosed_krylov_sum(family, roots, rotations)
    if isinstance(family, SectorBlocks):
        blocks = [
            enclosed_block(family, block, root)
            for block, root in zip(family.blocks, roots, strict=True)
            if root.size
        ]
        squares, errors = enclosed_sums(family, blocks, rotations)
        return EnclosedSum(squares, errors, squares)
    if isinstance(family, ScaledBlocks) and isinstance(family.factor, ResidualDistance):
        inner = enclosed_condition(family.family, multipliers, rotations)
        factor = family.factor(rotations)
        # ρ, then a difference and a division.
        wrong = enclosed_residuals(rotations)[1] / family.factor.unit
        wrong += 4 * EXTENDED_UNIT * np.abs(factor).astype(float)
        return enclosed_product(factor, SAFETY * wrong, inner.values, inner.errors)
    raise InputError("families", type(family).__name__, "blocks with bounds on all rounding")
