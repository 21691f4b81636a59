"""Bounds for every unit revolute Jacobian: residual from below, worst case from above.

ρ(x) = ½‖JJᵀ − (n/3)I‖_F² is a function of n rotations. Averaged over the symmetries it stays as
it is, so a bound is sought among averaged sums of squares: a moment relaxation (Lasserre, 2001)
reduced by symmetry. Both bounds are what the verifier proves from a certificate.

Of the worst case one value σ² ≥ t is excluded, with the signs of the columns fixed by the null
vector of J. Two spaces of functions carry the pseudo-moments: of degree 12, invariant under the
signs of the columns, and of degree 8, not invariant. The condition on the spectrum, α(t) +
β tr E³ − ρ ≥ 0, is maximised under all others: if the largest value is negative, t is excluded.
Samples concentrate where s and ρ are small, which gives units in which all numbers of the
program have ordinary sizes (docs/bounds.md, section 4).

Isotropic arms with lever arms of any length are compared with unit ones: a weighted residual
of these has a lower bound under the conditions of `lever_conditions` (section 5).
"""

import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from lockedjoint.formulations import measures
from lockedjoint.formulations.bounds.certified import best_known
from lockedjoint.formulations.bounds.moments import relaxation
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
from lockedjoint.formulations.bounds.moments.rotations import (
    jacobians_of,
    random_rotations,
    residual_values,
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

# Rows of degree 6 need total spin 1.
RESIDUAL = without_repetition([*DEGREE_4, *degree_sectors(6, range(2))])
# Sectors by the names of conditions. Squares of larger total spin matter here, though not for
# the residual. Of the localisers those are left that have multipliers of some size.
MAX_MIN: Mapping[str, Sequence[RowSector]] = {
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
    "scaled": DEGREE_4,
    "krylov": tuple(RowSector(0, c, spin, 4, 0) for spin in range(3) for c in (0, 2, 4)),
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
# The squares for isotropic arms are those of the residual, and those that multiply a condition.
ISOTROPY: Mapping[str, Sequence[RowSector]] = {
    "sectors": RESIDUAL,
    "turned": DEGREE_4,
    "aligned": tuple(degree_sectors(2, range(3))),
    "narrow": DEGREE_4,
}
#: The squared worst case that is excluded.
EXCLUDED = 0.3275
# The constants that follow are those of the search for the worst case.
# Number of joints.
_JOINTS = 7
# Length of a step of steepest descent of ½|s|² + bρ, radians for a gradient of size 1.
_STEP = 0.06
# Largest number of such steps.
_MOST_STEPS = 1500
# |s|² from which on the weight of a sample falls.
_NEAR = 0.05
# ρ from which on the weight of a sample falls, and the ρ beyond it after which it has halved.
_LOW = 0.6
_WIDTH = 0.3
# Eigenvalue of the weighted mean of a block, relative to the largest, that counts as 0.
_RELATIVE_RANK = 1e-9
# Number of configurations at which blocks are sampled that do not depend on signs.
_SAMPLES = 540
# Number of configurations at which the other blocks are sampled.
_UNSIGNED_SAMPLES = 320
# Penalty for what the equations of the moments miss.
_PENALTY = 3e3
# Gap and residual, in units of the penalty, at which the solver stops: where multipliers are
# still well inside of the cone, so that they can be refined.
_GAP = 1e-6
_ACCURACY = 1e-9
# The same penalty, and gap in its units, of the search for isotropic arms.
_LEVER_PENALTY = 1000.0
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

    `solver` is a name of `solvers`. The certificate goes to `out`; the executor is where it is
    verified, by default here. What is returned are plain values for JSON, the bound and the
    evidence.
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
    return lever_defect(EnclosedMatrix.jacobian(rotations)).values[:, 0, 0]


def _plain(
    quantity: str, joints: int, preset: str, bound: float, evidence: Mapping[str, Any]
) -> dict[str, Any]:
    """Return a bound, its distance from the best score known, and what it rests on."""
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
    """Prove that no unit revolute 7R Jacobian has a worst case σ² ≥ t; CertificateError if not.

    Returns √t, rounded up, and the evidence: a negative upper bound on α + β tr E³ − ρ
    (`spectral_limit`) under the conditions of these `sectors`. Squares of the sectors of
    ``scaled`` must span what both spaces have in common.
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
    rotations = _concentrated_rotations(generator, _SAMPLES, _JOINTS)
    weights = _concentrating_weights(rotations)
    common = relaxation.evaluated(
        sector_families(sectors["scaled"], _JOINTS), rotations, silent
    )
    blocks: list[list[FloatArray]] = []
    transforms: list[FloatArray] = []
    for number, (own, count) in enumerate(spaces):
        ends = (relaxation.EVALUATED * (number + part) / len(spaces) for part in (0, 1))
        tell = part_of(progress, *ends)
        blocks.append(relaxation.evaluated(own, rotations[:count], tell))
        semidefinite = [one.condition is None for one in own for _ in one.sizes]
        for block, positive in zip(blocks[-1], semidefinite, strict=True):
            size = block if positive else _absolute(block)
            transforms.append(_units(size, weights[:count]))
    sampled = moment_program(blocks, objective(rotations), common=common, weights=weights)
    both = zip(transforms, sampled.blocks, strict=True)
    program = replace(sampled, blocks=tuple(t.T @ block @ t for t, block in both))
    clock.append(time.perf_counter())
    tell = part_of(progress, relaxation.EVALUATED, relaxation.SOLVED)
    tell(f"solving: {sampled.size}")
    outcome = relaxation.solve_penalised(
        program, _PENALTY, solver, gap=_GAP, accuracy=_ACCURACY, progress=tell
    )
    if outcome.multipliers is not None:
        refined = refined_multipliers(program, outcome.multipliers)
        # Multipliers of B, from those of TᵀBT.
        moved = tuple(t @ x @ t.T for x, t in zip(refined, transforms, strict=True))
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


def _concentrated_rotations(rng: np.random.Generator, count: int, joints: int) -> FloatArray:
    """Return rotations (count, joints, 3, 3): every fourth uniform, the others with small s.

    These follow −∇(½|s|² + bρ) for random numbers of steps, and turn at random then.
    """
    found = random_rotations(rng, count, joints)
    share = np.exp(rng.uniform(np.log(0.01), np.log(0.4), (count, 1, 1)))
    steps = np.exp(rng.uniform(0, np.log(_MOST_STEPS), count)).astype(int)
    steps[::4] = 0
    angles = np.exp(rng.uniform(np.log(0.005), np.log(0.15), (count, 1, 1)))
    angles[::4] = 0
    moving = found.copy()
    for number in range(1, int(steps.max()) + 1):
        left = np.flatnonzero(steps >= number)
        turns = -_STEP / (1 + 3 * share[left]) * _torques(moving[left], share[left])
        moving[left] = _turned(moving[left], turns)
    return _turned(moving, angles * rng.standard_normal((count, joints, 3)))


def _concentrating_weights(rotations: FloatArray) -> FloatArray:
    """Return weights of configurations (count, n, 3, 3) that fall where s or ρ are large."""
    total = jacobians_of(rotations).sum(axis=2)
    far = np.sum(total**2, axis=1) / _NEAR
    high = np.maximum(residual_values(rotations) - _LOW, 0) / _WIDTH
    return np.asarray(1 / (1 + (far + high) ** 1.5))


def _absolute(block: FloatArray) -> FloatArray:
    """Return |B|, which has the absolute values of the eigenvalues of B."""
    values, vectors = np.linalg.eigh(block)
    return np.asarray((vectors * np.abs(values)[:, None, :]) @ vectors.swapaxes(1, 2))


def _units(sizes: FloatArray, weights: FloatArray) -> FloatArray:
    """Return T with TᵀCT = I, C the weighted mean of |B|, without what vanishes."""
    mean = np.tensordot(weights / weights.sum(), sizes, axes=1)
    values, vectors = np.linalg.eigh(0.5 * (mean + mean.T))
    kept = values > _RELATIVE_RANK * values[-1]
    return np.asarray(vectors[:, kept] / np.sqrt(values[kept]))


def _torques(rotations: FloatArray, share: FloatArray) -> FloatArray:
    """Return the gradient of ½|s|² + bρ for turns of each joint, (count, n, 3)."""
    jacobians = jacobians_of(rotations)
    joints = jacobians.shape[2]
    defect = jacobians @ jacobians.swapaxes(1, 2) - joints / 3 * np.eye(6)
    slopes = jacobians.sum(axis=2, keepdims=True) + 2 * share * (defect @ jacobians)
    slopes = slopes.swapaxes(1, 2)
    linear = np.cross(rotations[..., 0], slopes[..., :3])
    return np.asarray(linear + np.cross(rotations[..., 1], slopes[..., 3:]))


def _turned(rotations: FloatArray, vectors: FloatArray) -> FloatArray:
    turns = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix()
    return np.asarray(turns.reshape(rotations.shape) @ rotations)
