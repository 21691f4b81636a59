"""Bounds for every unit revolute Jacobian: residual from below, worst case from above.

J, shape (6, n), has the columns (v; ω) of n unit revolute joints, x is their n rotations, and
nothing has a unit.

ρ(x) = ½‖JJᵀ − (n/3)I‖_F² is a function of n rotations. Averaged over the symmetries it stays as
it is, so a bound is sought among averaged sums of squares: a moment relaxation (Lasserre, 2001)
reduced by symmetry. The first two columns of a rotation are v and ω, which make a column of J.
There are three bounds: of the residual, of the worst case, and of the worst case of isotropic
arms. Each is what the verifier proves from a certificate.

Let σ be the worst case after one locked joint, and t a value that σ² is to be shown not to
reach. The signs of the columns j_f of J are those that the null vector of J fixes, with all its
entries ≥ 0. Two spaces of functions carry the pseudo-moments (`moment_program`): of degree 12,
invariant under the signs of the columns, and of degree 8, not invariant. With E = JJᵀ − (7/3)I,
and α and β as in `spectral_limit`, the condition on the spectrum says α(t) + β tr E³ − ρ ≥ 0.
Its left side is maximised under all other conditions: if the largest value is negative, t is
excluded (docs/bounds.md, section 4). The samples are those of `concentrated_samples`.

Isotropic arms with lever arms of any length are compared with unit ones: a weighted residual
of these has a lower bound under the conditions of `lever_conditions` (section 5).
"""

import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lockedjoint.formulations import measures
from lockedjoint.formulations.bounds.certified import best_known
from lockedjoint.formulations.bounds.moments import relaxation
from lockedjoint.formulations.bounds.moments.concentrated_samples import (
    absolute_values,
    concentrated_rotations,
    concentrating_weights,
    units_of_block,
)
from lockedjoint.formulations.bounds.moments.conditions import (
    WITH_SIGNS,
    worst_case_conditions,
)
from lockedjoint.formulations.bounds.moments.enclosed_matrix import EnclosedMatrix
from lockedjoint.formulations.bounds.moments.lever_conditions import (
    lever_conditions,
    lever_defect,
)
from lockedjoint.formulations.bounds.moments.moment_program import (
    moment_program,
    refined_multipliers,
)
from lockedjoint.formulations.bounds.moments.relaxation import (
    Progress,
    prepare_proof,
    silent,
)
from lockedjoint.formulations.bounds.moments.row_sectors import (
    DEGREE_4,
    RowSector,
    degree_sectors,
    unsigned_sectors,
    without_repetition,
)
from lockedjoint.formulations.bounds.moments.sampled_blocks import (
    BlockFamily,
    condition_families,
    sector_families,
)
from lockedjoint.formulations.bounds.moments.solvers import (
    DENSE,
    check_moment_solver,
)
from lockedjoint.formulations.bounds.spectral_limit import suggested_spectrum
from lockedjoint.nlp.arrays import FloatArray, Rng, one_blas_thread, whole_number
from lockedjoint.nlp.progress import part_of
from lockedjoint.nlp.starts import seed_of

#: Sectors of the squares for the residual: degree 4, and degree 6 with total spins 0 and 1.
#: Fewer prove less, and more take longer.
RESIDUAL = without_repetition([*DEGREE_4, *degree_sectors(6, range(2))])
# Sectors by the names of the conditions that their squares multiply; squares that multiply none
# are named after their space of functions. Positional numbers are RowSector(k, c, L, d, parity
# of the locked joint). Squares of larger total spin matter here, though not for the residual. A
# localiser is a sum of squares that multiplies a condition; those that are here are the ones
# whose multipliers have some size. J_f is J without column j_f, δ and δ₀ are as in
# `conditions`.
MAX_MIN: Mapping[str, Sequence[RowSector]] = {
    # No condition: squares that are invariant under the signs of the columns.
    "sectors": without_repetition(
        [
            *DEGREE_4,
            *(RowSector(0, c, spin, 6) for c in (0, 2) for spin in range(4)),
            RowSector(0, 0, 4, 6),
            *(RowSector(2, 0, spin, 6) for spin in range(3)),
            RowSector(2, 2, 0, 6),
            RowSector(4, 0, 0, 6),
            *(RowSector(6, c, 0, 6) for c in (0, 2)),
        ]
    ),
    # ρ is at most its largest value where σ² ≥ t.
    "scaled": DEGREE_4,
    # J_f J_fᵀ − tI is positive semidefinite, on j_f, M j_f and M² j_f with M = JJᵀ.
    "krylov": tuple(RowSector(0, c, spin, 4, 0) for spin in range(3) for c in (0, 2, 4)),
    # α + β tr E³ − ρ is at least 0.
    "spectral": (
        *(RowSector(1, c, spin, 3) for c, spin in ((1, 1), (1, 2), (3, 2), (3, 3))),
        *(RowSector(0, c, spin, 2) for c, spin in ((0, 1), (2, 2))),
    ),
    # No condition: squares that change with the signs of the columns.
    "unsigned": unsigned_sectors(4, range(5)) + unsigned_sectors(3, range(4)),
    # |s|² is at most its largest value where σ² ≥ t, with s = Σ j_f.
    "near": unsigned_sectors(3, range(4)),
    # ρ is at most its largest value, as in "scaled".
    "unsigned_scaled": unsigned_sectors(2, range(3)),
    # J_fᵀJ_f − tI is positive semidefinite, on (1, …, 1), J_fᵀj_f and J_fᵀs.
    "gram": (RowSector(None, 1, 1, 3, 0),),
    # δ₀M − ssᵀ is positive semidefinite, on j_f, s, M j_f and M s.
    "deviation": unsigned_sectors(1, range(3), locked=True)
    + unsigned_sectors(2, range(3), locked=True),
}
# The squares for isotropic arms are those of the residual, and those that multiply a condition.
ISOTROPY: Mapping[str, Sequence[RowSector]] = {
    "sectors": RESIDUAL,
    "turned": DEGREE_4,
    "aligned": tuple(degree_sectors(2, range(3))),
    "narrow": DEGREE_4,
}
#: The squared worst case t that is excluded. A smaller one is a better bound, but these sectors
#: soon exclude it no more.
EXCLUDED = 0.3275
# The constants that follow are those of the search for the worst case.
# Number of joints.
_JOINTS = 7
# Number of configurations at which blocks are sampled that do not depend on signs: more than
# their 476 functions. Too few are refused, and more take longer.
_SAMPLES = 540
# Number of configurations at which the other blocks are sampled: more than 278 functions.
_UNSIGNED_SAMPLES = 320
# Penalty of `penalised_program` for blocks below 0. With a smaller one they are below 0 at the
# optimum, and with a larger one the solver loses digits.
_PENALTY = 3e3
# Gap, in units of the penalty, at which the solver stops: where multipliers are still well
# inside of the cone, so that they can be refined.
_GAP = 1e-6
# Error of the dual equations, in the same units, at which the solver stops.
_ACCURACY = 1e-9
# The same penalty in the search for isotropic arms.
_LEVER_PENALTY = 1000.0
# The same gap in the search for isotropic arms, in units of that penalty.
_LEVER_GAP = 1e-8


@one_blas_thread()
def residual_bound(
    joints: int = 7,
    *,
    solver: str = DENSE,
    seed: Rng | None = None,
    rng: Rng | None = None,
    progress: Progress = silent,
    out: Path | None = None,
    executor: Executor | None = None,
) -> dict[str, Any]:
    """Bound ½‖JJᵀ − (n/3)I‖_F² of all unit revolute Jacobians of 6 to 9 joints from below.

    Parameters
    ----------
    joints
        n, from 6 to 9.
    solver
        A name of `solvers`.
    seed, rng
        What the random configurations are made from; at most one of them.
    progress
        Is told how far the work is.
    out
        Where the certificate is written to, if anywhere.
    executor
        Where the certificate is verified, by default in this process.

    Returns
    -------
    dict
        Plain values for JSON: ``quantity``, ``joints``, ``preset`` (the name of the choice of
        rows), ``kind``, ``bound``, ``best_known`` (the best score known to be reached, or
        None), ``gap`` and ``gap_percent`` (the distance of the bound from it, or None); and the
        evidence, as of `SolvedRelaxation.proved`.
    """
    whole_number("joints", joints, 6, 9)
    check_moment_solver(solver)
    generator = np.random.default_rng(seed_of(seed, rng))
    prepare_proof(out)
    families = sector_families(RESIDUAL, joints)
    solved = relaxation.solve_relaxation(
        families, joints, generator, solver=solver, progress=progress
    )
    bound, evidence = solved.refined().proved(joints, progress, out, executor)
    return _plain("residual", joints, "tight", max(0.0, bound), evidence)


@one_blas_thread()
def max_min_bound(
    *,
    solver: str = DENSE,
    seed: Rng | None = None,
    rng: Rng | None = None,
    progress: Progress = silent,
    out: Path | None = None,
    executor: Executor | None = None,
) -> dict[str, Any]:
    """Bound the worst case (5) of all unit revolute Jacobians of 7 joints from above.

    From 8 joints on eq. (6) is all: isotropic Jacobians exist. The rest is as of
    `residual_bound`. CertificateError if the value is not excluded.
    """
    number = seed_of(seed, rng)
    bound, evidence = exclude_with_signs(
        EXCLUDED,
        MAX_MIN,
        rng=number,
        solver=solver,
        progress=progress,
        out=out,
        executor=executor,
    )
    return _plain("max-min", 7, "null-vector", bound, evidence)


@one_blas_thread()
def isotropy_bound(
    *,
    solver: str = DENSE,
    seed: Rng | None = None,
    rng: Rng | None = None,
    progress: Progress = silent,
    out: Path | None = None,
    executor: Executor | None = None,
) -> dict[str, Any]:
    """Bound the worst case (5) of all isotropic Jacobians of 7 revolute joints from above.

    Lever arms may have any length. The rest is as of `residual_bound`.
    """
    check_moment_solver(solver)
    prepare_proof(out)
    generator = np.random.default_rng(seed_of(seed, rng))
    families = condition_families(ISOTROPY, _JOINTS, lever_conditions())
    solved = relaxation.solve_relaxation(
        families,
        _JOINTS,
        generator,
        objective=_lever_defects,
        penalty=_LEVER_PENALTY,
        gap=_LEVER_GAP,
        solver=solver,
        progress=progress,
    )
    bound, evidence = solved.refined().proved(
        _JOINTS, progress, out, executor, quantity="isotropy"
    )
    return _plain("isotropy", _JOINTS, "turned", bound, evidence)


def _lever_defects(rotations: FloatArray) -> FloatArray:
    """Return `lever_defect`, (configurations,), at rotations (configurations, n, 3, 3)."""
    return lever_defect(EnclosedMatrix.jacobian(rotations)).values[:, 0, 0]


def _plain(
    quantity: str, joints: int, preset: str, bound: float, evidence: Mapping[str, Any]
) -> dict[str, Any]:
    """Return a bound, its distance from the best score known, and what it rests on.

    `preset` names the choice of rows in the tables of results.
    """
    model = "lever-revolute" if quantity == "isotropy" else "unit-revolute"
    best = best_known(quantity, model, joints)
    return {
        "quantity": quantity,
        "joints": joints,
        "preset": preset,
        "kind": "rigorous",
        "bound": bound,
        "best_known": best,
        "gap": None if best is None else abs(bound - best),
        "gap_percent": measures.gap_percent(best, bound) if best and bound else None,
        **evidence,
    }


def exclude_with_signs(
    t: float,
    sectors: Mapping[str, Sequence[RowSector]],
    *,
    rng: Rng = 0,
    solver: str = DENSE,
    progress: Progress = silent,
    out: Path | None = None,
    executor: Executor | None = None,
) -> tuple[float, dict[str, Any]]:
    """Prove that no unit revolute Jacobian of 7 joints has a worst case σ with σ² ≥ t.

    The proof is a negative upper bound on α + β tr E³ − ρ (`spectral_limit`) under the
    conditions of these sectors.

    Parameters
    ----------
    t
        The squared worst case, between 0 and 1/3.
    sectors
        Sectors by the names of conditions, as in `MAX_MIN`. Squares of those of ``scaled`` must
        span what both spaces of functions have in common.
    rng, solver, progress, out, executor
        As in `residual_bound`.

    Returns
    -------
    tuple
        √t, rounded up, and the evidence, as of `SolvedRelaxation.proved`.

    Raises
    ------
    CertificateError
        If t is not excluded.
    """
    check_moment_solver(solver)
    prepare_proof(out)
    clock = [time.perf_counter()]
    generator = np.random.default_rng(rng)
    spectrum = suggested_spectrum(t)
    conditions = worst_case_conditions(_JOINTS, t, spectrum)
    spectral = BlockFamily(RowSector(0, 0, 0, 0), _JOINTS, conditions["spectral"])

    def objective(rotations: FloatArray) -> FloatArray:
        jacobian = EnclosedMatrix.jacobian(rotations)
        return -conditions["spectral"].values(jacobian, None).values[:, 0, 0]

    families = condition_families(sectors, _JOINTS, conditions)
    signed = [family for family in families if family.name not in WITH_SIGNS]
    unsigned = [family for family in families if family.name in WITH_SIGNS]
    spaces = ((signed, _SAMPLES), (unsigned, _UNSIGNED_SAMPLES))
    rotations = concentrated_rotations(generator, _SAMPLES, _JOINTS)
    weights = concentrating_weights(rotations)
    common = relaxation.evaluated(
        sector_families(sectors["scaled"], _JOINTS), rotations, silent
    )
    blocks, transforms = _sampled_blocks(spaces, rotations, weights, progress)
    sampled = moment_program(blocks, objective(rotations), common=common, weights=weights)
    both = zip(transforms, sampled.blocks, strict=True)
    in_units = tuple(transform.T @ block @ transform for transform, block in both)
    program = replace(sampled, blocks=in_units)
    clock.append(time.perf_counter())
    tell = part_of(progress, relaxation.EVALUATED, relaxation.SOLVED)
    tell(f"solving: {sampled.size}")
    outcome = relaxation.solve_penalised(
        program, _PENALTY, solver, gap=_GAP, accuracy=_ACCURACY, progress=tell
    )
    if outcome.multipliers is not None:
        refined = refined_multipliers(program, outcome.multipliers)
        # TXTᵀ are multipliers of B where X are those of TᵀBT.
        moved = tuple(
            transform @ multiplier @ transform.T
            for multiplier, transform in zip(refined, transforms, strict=True)
        )
        outcome = replace(outcome, multipliers=moved)
    clock.append(time.perf_counter())
    families = [*signed, *unsigned]
    solved = relaxation.SolvedRelaxation(families, sampled, outcome, clock)
    return solved.proved(
        _JOINTS,
        progress,
        out,
        executor,
        quantity="max-min",
        excluded=t,
        spectrum=spectrum,
        once=[spectral],
    )


class _SampledBlocks(NamedTuple):
    """Blocks of all spaces at configurations, and the units of each."""

    #: The blocks of each space, each of shape (count of the space, size, size).
    blocks: list[list[FloatArray]]
    #: T of each block, one space after another, shape (size, rank), see `units_of_block`.
    transforms: list[FloatArray]


def _sampled_blocks(
    spaces: Sequence[tuple[Sequence[BlockFamily], int]],
    rotations: FloatArray,
    weights: FloatArray,
    progress: Progress,
) -> _SampledBlocks:
    """Evaluate the blocks of each space of functions, and choose their units.

    `spaces` has the families of each space, and the number of configurations at which it is
    sampled. `rotations` has the shape (configurations, 7, 3, 3), `weights` (configurations,).
    """
    blocks: list[list[FloatArray]] = []
    transforms: list[FloatArray] = []
    for number, (own, count) in enumerate(spaces):
        ends = (relaxation.EVALUATED * (number + part) / len(spaces) for part in (0, 1))
        tell = part_of(progress, *ends)
        blocks.append(relaxation.evaluated(own, rotations[:count], tell))
        # Squares are positive semidefinite. Those of conditions need not be where σ² < t.
        semidefinite = [one.condition is None for one in own for _ in one.sizes]
        for block, positive in zip(blocks[-1], semidefinite, strict=True):
            absolute = block if positive else absolute_values(block)
            transforms.append(units_of_block(absolute, weights[:count]))
    return _SampledBlocks(blocks, transforms)
