"""A lower bound on the residual of every unit revolute Jacobian.

ρ(x) = ½‖JJᵀ − (n/3)I‖_F² is a function of n rotations. Averaged over the frame, the phase,
conjugation, the order and the signs of the columns it stays as it is, so a bound may be sought
among averaged sums of squares: a moment relaxation (Lasserre, 2001) reduced by symmetry.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from formulations.bounds.best_known import best_known
from formulations.bounds.so3_moments.blocks.block_family import BlockFamily
from formulations.bounds.so3_moments.blocks.plain_average import averaged_sum_of_squares
from formulations.bounds.so3_moments.blocks.sampled_blocks import SectorBlocks
from formulations.bounds.so3_moments.global_bound import GlobalBound, ProgramSize
from formulations.bounds.so3_moments.presets import residual_preset
from formulations.bounds.so3_moments.programs.identity_check import check_identity
from formulations.bounds.so3_moments.programs.moment_program import (
    MomentProgram,
    TooFewSamplesError,
    moment_program,
)
from formulations.bounds.so3_moments.programs.multipliers import (
    ConicOutcome,
    nearest_semidefinite,
)
from formulations.bounds.so3_moments.programs.predictor_corrector import (
    solve_with_predictor_corrector,
)
from formulations.bounds.so3_moments.representations.clebsch_gordan import Floats
from formulations.bounds.so3_moments.representations.row_sectors import RowSector
from formulations.bounds.so3_moments.representations.wigner import (
    jacobians_of,
    random_rotations,
)
from nlp.errors import InputError
from nlp.threads import one_blas_thread

Progress = Callable[[str], None]
LARGEST_JOINTS = 9
_FEW_SAMPLES, _MANY_SAMPLES = 160, 520
_FRESH = 40
_HOW_CHECKED = (
    "sum-of-squares identity at fresh random configurations, multipliers made positive "
    "semidefinite, largest difference subtracted"
)


def residual_values(rotations: Floats) -> Floats:
    """Return ½‖JJᵀ − (n/3)I‖_F² at rotations (configurations, n, 3, 3)."""
    jacobians = jacobians_of(rotations)
    gram = jacobians @ jacobians.swapaxes(-1, -2)
    defect = gram - jacobians.shape[-1] / 3 * np.eye(6)
    return np.asarray(0.5 * np.sum(defect**2, axis=(-1, -2)))


@one_blas_thread
def residual_bound(
    preset: str = "fast",
    joints: int = 7,
    *,
    solver: str | None = None,
    options: Mapping[str, Any] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> GlobalBound:
    """Bound ½‖JJᵀ − (n/3)I‖_F² of all unit revolute Jacobians from below.

    Parameters
    ----------
    preset
        ``"low"`` (rows of degree 4), ``"fast"``, ``"compact"`` or ``"tight"``.
    joints
        Number n of joints, 6 to 9.
    solver
        ``"predictor-corrector"`` or a conic solver known to cvxpy; by default as the preset
        says.
    options
        The conic solver's own options.
    seed
        Of the sampled and of the fresh configurations.
    progress
        Told in words what is being done.

    Returns
    -------
    GlobalBound
        Of kind ``"numerical"``; also if the solver fails: then the bound is 0, which needs no
        proof, and `status` says why.

    Raises
    ------
    InputError
        If the preset, the number of joints or the solver is not allowed.

    Notes
    -----
    The residual is that of Maciejewski and Roberts (1995), Section 4, in a form that does not
    depend on the frame.
    """
    choice = residual_preset(preset)
    check_joints(joints)
    tell = progress or (lambda _: None)
    rng = np.random.default_rng(seed)
    clock = [time.perf_counter()]
    families = sector_families(choice.sectors, joints)
    program = sampled_program(families, residual_values, joints, rng, tell)
    clock.append(time.perf_counter())
    name = solver or choice.solver
    outcome = solve(program, name, options, tell)
    clock.append(time.perf_counter())
    seconds = {"blocks": clock[1] - clock[0], "solver": clock[2] - clock[1]}
    size = program_size(program)
    best = best_known("residual", "unit-revolute", joints)
    if outcome.multipliers is None:
        return GlobalBound(
            "residual", joints, preset, "numerical", 0.0, best, size, name, outcome.status,
            outcome.iterations, how_checked="nothing to check: ρ ≥ 0", seconds=seconds,
        )  # fmt: skip
    tell("checking the identity at fresh configurations")
    cleaned = [nearest_semidefinite(x) for x in outcome.multipliers]
    multipliers = [x for x, _ in cleaned]
    check = check_identity(
        families,
        multipliers,
        program.dual_value(multipliers),
        residual_values,
        random_rotations(rng, _FRESH, joints),
        random_rotations(rng, 1, joints) if joints <= 7 else None,
        plain_sum,
    )
    seconds["check"] = time.perf_counter() - clock[2]
    return GlobalBound(
        quantity="residual",
        joints=joints,
        preset=preset,
        kind="numerical",
        bound=max(0.0, check.checked_bound),
        best_known=best,
        size=size,
        solver=name,
        status=outcome.status,
        iterations=outcome.iterations,
        dual_residual=float(np.abs(program.dual_residual(outcome.multipliers)).max()),
        smallest_eigenvalue=min(lowest for _, lowest in cleaned),
        how_checked=_HOW_CHECKED,
        check=check.to_dict(),
        seconds=seconds,
    )


def check_joints(joints: int) -> None:
    """Raise InputError unless 6 ≤ n ≤ 9."""
    if joints not in range(6, LARGEST_JOINTS + 1):
        raise InputError("joints", joints, f"an integer from 6 to {LARGEST_JOINTS}")


def sector_families(sectors: Sequence[RowSector], joints: int) -> list[SectorBlocks]:
    """Return the blocks of all sectors that occur."""
    families = [SectorBlocks(sector, joints) for sector in sectors]
    return [family for family in families if family.blocks]


def sampled_program(
    families: Sequence[BlockFamily],
    objective: Callable[[Floats], Floats],
    joints: int,
    rng: np.random.Generator,
    tell: Progress,
) -> MomentProgram:
    """Return the moment program; draw more samples until they tell all functions apart."""
    entries = sum(size * (size + 1) // 2 for family in families for size in family.sizes)
    count = _FEW_SAMPLES if entries < 1500 else _MANY_SAMPLES
    while True:
        rotations = random_rotations(rng, count, joints)
        blocks: list[Floats] = []
        for number, family in enumerate(families, start=1):
            tell(f"evaluating blocks at {count} configurations: {number} of {len(families)}")
            blocks += family.evaluate(rotations)
        try:
            return moment_program(objective(rotations), blocks)
        except TooFewSamplesError:
            count *= 2


def solve(
    program: MomentProgram, solver: str, options: Mapping[str, Any] | None, tell: Progress
) -> ConicOutcome:
    """Return the solver's answer; cvxpy is imported only if it is asked for."""
    size = program_size(program)
    tell(
        f"solving with {solver}: {size.moments} moments, {size.blocks} blocks, the largest "
        f"{size.largest_block}"
    )
    if solver == "predictor-corrector":
        return solve_with_predictor_corrector(program, progress=tell)
    from formulations.bounds.so3_moments.programs.cvxpy_solver import solve_with_cvxpy

    return solve_with_cvxpy(program, solver, options)


def program_size(program: MomentProgram) -> ProgramSize:
    """Return how large a program is."""
    return ProgramSize(
        program.moments, len(program.blocks), max(program.sizes, default=0), program.svec
    )


def plain_sum(family: BlockFamily, rotations: Floats, multipliers: Sequence[Floats]) -> Floats:
    """Return the sum of squares of a family of plain rows by summing over all orders."""
    if not isinstance(family, SectorBlocks):
        raise TypeError("only families of plain rows are averaged plainly")
    return averaged_sum_of_squares(family, rotations, multipliers)
