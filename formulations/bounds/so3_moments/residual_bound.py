"""A lower bound on the residual of every unit revolute Jacobian.

ρ(x) = ½‖JJᵀ − (n/3)I‖_F² is a function of n rotations. Averaged over the frame, the phase,
conjugation, the order and the signs of the columns it stays as it is, so a bound may be sought
among averaged sums of squares: a moment relaxation (Lasserre, 2001) reduced by symmetry.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from formulations.bounds.certified import best_known
from formulations.bounds.so3_moments.blocks.sampled_blocks import sector_families
from formulations.bounds.so3_moments.global_bound import GlobalBound
from formulations.bounds.so3_moments.relaxation import (
    FRESH,
    PREDICTOR_CORRECTOR,
    Progress,
    check_joints,
    residual_values,
    silent,
    solve_relaxation,
)
from formulations.bounds.so3_moments.representations.row_sectors import (
    RowSector,
    degree_sectors,
    without_repetition,
)
from formulations.bounds.so3_moments.representations.wigner import random_rotations
from nlp.arrays import Rng, one_blas_thread
from nlp.errors import InputError

_HOW_CHECKED = (
    "sum-of-squares identity at fresh random configurations, multipliers made positive "
    "semidefinite, largest difference subtracted"
)


def _with_degree_4(*sectors: RowSector) -> tuple[RowSector, ...]:
    return without_repetition([*degree_sectors(4, range(3)), *sectors])


# Rows of degree below 6 give no more than 0 for seven joints; total spin 1 is needed.
RESIDUAL_PRESETS: Mapping[str, tuple[RowSector, ...]] = {
    "low": _with_degree_4(),
    "fast": _with_degree_4(
        *(RowSector(k, c, 0, 6) for k in (0, 4, 6) for c in (0, 2)),
        *(RowSector(k, c, 1, 6) for k in (0, 6) for c in (0, 2)),
    ),
    "compact": _with_degree_4(
        RowSector(2, 0, 0, 6), RowSector(6, 0, 0, 6), RowSector(2, 0, 1, 6)
    ),
    "tight": _with_degree_4(*degree_sectors(6, range(2))),
}


def residual_preset(name: str) -> tuple[RowSector, ...]:
    """Return the rows of a preset of the residual bound.

    Raises
    ------
    InputError
        If there is no such preset.
    """
    if name not in RESIDUAL_PRESETS:
        raise InputError("preset", name, ", ".join(RESIDUAL_PRESETS))
    return RESIDUAL_PRESETS[name]


@one_blas_thread()
def residual_bound(
    preset: str = "fast",
    joints: int = 7,
    *,
    solver: str | None = None,
    options: Mapping[str, Any] | None = None,
    rng: Rng = 0,
    progress: Progress = silent,
) -> GlobalBound:
    """Bound ½‖JJᵀ − (n/3)I‖_F² of all unit revolute Jacobians from below.

    Parameters
    ----------
    preset
        ``"low"`` (rows of degree 4), ``"fast"``, ``"compact"`` or ``"tight"``.
    joints
        Number n of joints, 6 to 9.
    solver
        ``"predictor-corrector"`` or a conic solver known to cvxpy; by default
        ``"CLARABEL"`` for ``"low"`` and the predictor–corrector method for larger presets.
    options
        The conic solver's own options.
    rng
        Seed of the sampled and of the fresh configurations, or a generator.
    progress
        Receives a short message at each step.

    Returns
    -------
    GlobalBound
        Of kind ``"numerical"``; also if the solver fails: then the bound is 0, which needs no
        proof, and `status` gives the reason.

    Raises
    ------
    InputError
        If the preset, the number of joints or the solver is not allowed.

    Notes
    -----
    The residual is that of Maciejewski and Roberts (1995), Section 4, in a form that does not
    depend on the frame.
    """
    sectors = residual_preset(preset)
    check_joints(joints)
    generator = np.random.default_rng(rng)
    families = sector_families(sectors, joints)
    solved = solve_relaxation(
        families,
        joints,
        generator,
        solver=solver or ("CLARABEL" if preset == "low" else PREDICTOR_CORRECTOR),
        options=options,
        progress=progress,
    )
    if solved.outcome.multipliers is None:
        bound, evidence = 0.0, solved.evidence("nothing to check: ρ ≥ 0")
    else:
        progress("checking the identity at fresh configurations")
        fresh = random_rotations(generator, FRESH, joints)
        bound, evidence = solved.checked(solved.sampled, residual_values, fresh, _HOW_CHECKED)
        bound = max(0.0, bound)
    best = best_known("residual", "unit-revolute", joints)
    return GlobalBound("residual", joints, preset, "numerical", bound, best, **vars(evidence))
