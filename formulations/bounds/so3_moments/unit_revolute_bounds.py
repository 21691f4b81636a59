"""The two bounds for every unit revolute Jacobian: residual from below, worst case from above.

ρ(x) = ½‖JJᵀ − (n/3)I‖_F² is a function of n rotations. Averaged over the symmetries it stays as
it is, so a bound is sought among averaged sums of squares: a moment relaxation (Lasserre, 2001)
reduced by symmetry. Of the worst case one value σ² ≥ t is excluded: multipliers X of the blocks
B of `condition_families`, Σ tr X = 1, make Σ ⟨X, B(x)⟩ equal to a negative number for all x.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from formulations.bounds.certified import best_known
from formulations.bounds.closed_form import root_above
from formulations.bounds.so3_moments import GlobalBound, Kind
from formulations.bounds.so3_moments.conditions import worst_case_conditions
from formulations.bounds.so3_moments.null_vector_bound import exclude_with_signs
from formulations.bounds.so3_moments.relaxation import (
    FRESH,
    Progress,
    prepare_proof,
    silent,
    solve_relaxation,
)
from formulations.bounds.so3_moments.sampled_blocks import (
    condition_families,
    sector_families,
)
from formulations.bounds.so3_moments.wigner import (
    DEGREE_4,
    RowSector,
    degree_sectors,
    random_rotations,
    unsigned_sectors,
    without_repetition,
)
from nlp.arrays import Rng, one_blas_thread, whole_number
from nlp.errors import InputError, one_of
from nlp.starts import seed_of

# With rows of degree 6; total spin 1 is needed.
RESIDUAL_PRESETS: Mapping[str, tuple[RowSector, ...]] = {
    "compact": without_repetition(
        [*DEGREE_4, RowSector(2, 0, 0, 6), RowSector(6, 0, 0, 6), RowSector(2, 0, 1, 6)]
    ),
    "tight": without_repetition([*DEGREE_4, *degree_sectors(6, range(2))]),
}
# Squares of total spin 2 and 3 matter here, though not for the residual.
_SQUARES = [
    *(RowSector(0, c, spin, 6) for c in (0, 2) for spin in (0, 1, 2)),
    RowSector(0, 0, 3, 6),
    *(RowSector(2, 0, spin, 6) for spin in (0, 1, 2)),
    RowSector(2, 2, 0, 6),
    RowSector(4, 0, 0, 6),
    *(RowSector(6, c, 0, 6) for c in (0, 2)),
]
#: Sectors by the names of conditions.
CONDITIONS: Mapping[str, Sequence[RowSector]] = {
    "sectors": without_repetition([*DEGREE_4, *_SQUARES]),
    "scaled": DEGREE_4,
    "krylov": tuple(
        RowSector(k, c, spin, 4, locked)
        for k, locked in ((0, 0), (2, 0), (1, 1))
        for spin in range(3)
        for c in (0, 2, 4)
    ),
}
# With the signs of the null vector, squares of larger total spin are worth their time. Of the
# localisers those are left that have multipliers of some size.
SIGNED: Mapping[str, Sequence[RowSector]] = {
    "sectors": without_repetition(
        [*CONDITIONS["sectors"], RowSector(0, 2, 3, 6), RowSector(0, 0, 4, 6)]
    ),
    "scaled": DEGREE_4,
    "krylov": tuple(one for one in CONDITIONS["krylov"] if one.odd == one.locked == 0),
    "spectral": (
        *(RowSector(1, c, spin, 3) for c, spin in ((1, 1), (1, 2), (3, 2), (3, 3))),
        *(RowSector(0, c, spin, 2) for c, spin in ((0, 1), (2, 2))),
    ),
    "unsigned": unsigned_sectors(4, range(5)) + unsigned_sectors(3, range(4)),
    "near": unsigned_sectors(3, range(4)),
    "unsigned_scaled": unsigned_sectors(2, range(3)),
    "gram": (RowSector(None, 1, 1, 3, 0),),
    "deviation": unsigned_sectors(1, range(3), locked=True)
    + unsigned_sectors(2, range(3), locked=True),
}
LOCALISED, NULL_VECTOR = "localised", "null-vector"
# The squared worst cases that are excluded for seven joints.
EXCLUDED = {LOCALISED: 0.3279, NULL_VECTOR: 0.3275}
_MOST_JOINTS = 9
_GAP = 1e-8
# Multipliers well inside of the cone can be made to satisfy the equations to the last digits.
_RIGOROUS_GAP = 3e-8
_HOW_CHECKED = (
    "sum-of-squares identity at fresh random configurations, multipliers made positive "
    "semidefinite, largest difference subtracted"
)
_HOW_EXCLUDED = (
    "a sum of squares and localisers equal to a negative constant at fresh random "
    "configurations; multipliers made positive semidefinite, largest difference subtracted"
)


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
    executor: Executor | None = None,
) -> GlobalBound:
    """Bound ½‖JJᵀ − (n/3)I‖_F² of all unit revolute Jacobians of 6 to 9 joints from below.

    By preset ``"compact"`` or ``"tight"``. A `rigorous` bound is what the verifier proves from
    a certificate, which goes to `out`; the executor is where it is verified, by default here. A
    numerical one is 0 if the solver fails.
    """
    preset = one_of("preset", preset or "compact", RESIDUAL_PRESETS)
    whole_number("joints", joints, 6, _MOST_JOINTS)
    generator = np.random.default_rng(seed_of(seed, rng))
    if out is not None and not rigorous:
        raise InputError("--out", str(out), "none without --rigorous")
    families = sector_families(RESIDUAL_PRESETS[preset], joints)
    if rigorous:
        prepare_proof(out)
    gap = _RIGOROUS_GAP if rigorous else 1e-9
    solved = solve_relaxation(families, joints, generator, gap=gap, progress=progress)
    if rigorous:
        bound, evidence = solved.refined().proved(joints, progress, out, executor)
    elif solved.outcome.multipliers is None:
        bound, evidence = 0.0, solved.evidence("nothing to check: ρ ≥ 0", {}, ())
    else:
        fresh = random_rotations(generator, FRESH, joints)
        bound, evidence = solved.checked(fresh, _HOW_CHECKED, progress)
    kind: Kind = "rigorous" if rigorous else "numerical"
    best = best_known("residual", "unit-revolute", joints)
    return GlobalBound("residual", joints, preset, kind, max(0.0, bound), best, **evidence)


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
    executor: Executor | None = None,
) -> GlobalBound:
    """Bound the worst case (5) of all unit revolute Jacobians of 7 to 9 joints from above.

    By preset ``"localised"`` or ``"null-vector"``, with the signs of the null vector. From 8
    joints on eq. (6) is all: isotropic Jacobians exist. The rest is as of `residual_bound`.
    """
    preset, seed = one_of("preset", preset or LOCALISED, EXCLUDED), seed_of(seed, rng)
    whole_number("joints", joints, 7, _MOST_JOINTS)
    if out is not None and (not rigorous or joints > 7):
        raise InputError("--out", str(out), "none without --rigorous and 7 joints")
    best = best_known("max-min", "unit-revolute", joints)
    kind: Kind = "closed form"
    evidence: dict[str, Any] = {"how_checked": "eq. (6)"}
    bound = root_above(Fraction(joints - 6, 3))
    if joints > 7:
        return GlobalBound("max-min", joints, "", kind, bound, best, **evidence)
    t = EXCLUDED[preset]
    exclude = exclude_with_signs if preset == NULL_VECTOR else exclude_worst_case
    sectors = SIGNED if preset == NULL_VECTOR else CONDITIONS
    margin, evidence = exclude(
        *(t, sectors),
        rigorous=rigorous,
        rng=seed,
        progress=progress,
        out=out,
        executor=executor,
    )
    if not rigorous:
        evidence["check"] = {"excluded": t, "margin": margin, **evidence["check"]}
    if margin < 0:
        kind, bound = "rigorous" if rigorous else "numerical", root_above(Fraction(t))
    else:
        evidence["how_checked"] = "not excluded; eq. (6)"
    return GlobalBound("max-min", joints, preset, kind, bound, best, **evidence)


def exclude_worst_case(
    t: float,
    sectors: Mapping[str, Sequence[RowSector]],
    *,
    rigorous: bool = False,
    rng: Rng = 0,
    progress: Progress = silent,
    out: Path | None = None,
    executor: Executor | None = None,
) -> tuple[float, dict[str, Any]]:
    """Try to show that no unit revolute 7R Jacobian has a worst case σ² ≥ t.

    Returns an upper bound on the largest s with every block ⪰ sI, checked at fresh
    configurations or proved: t is excluded if it is negative; and the evidence.
    """
    if rigorous:
        prepare_proof(out)
    generator = np.random.default_rng(rng)
    families = condition_families(sectors, 7, worst_case_conditions(7, t))
    solved = solve_relaxation(
        families, 7, generator, exclusion=True, gap=_GAP, progress=progress
    )
    if rigorous:
        _, evidence = solved.refined().proved(7, progress, out, executor, excluded=t)
        return float(evidence["check"]["margin"]), evidence
    fresh = random_rotations(generator, FRESH, 7)
    bound, evidence = solved.checked(fresh, _HOW_EXCLUDED, progress)
    return -bound, evidence
