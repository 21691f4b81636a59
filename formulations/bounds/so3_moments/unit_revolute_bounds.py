"""The two bounds for every unit revolute Jacobian: residual from below, worst case from above.

ρ(x) = ½‖JJᵀ − (n/3)I‖_F² is a function of n rotations. Averaged over the symmetries it stays as
it is, so a bound is sought among averaged sums of squares: a moment relaxation (Lasserre, 2001)
reduced by symmetry. Of the worst case one value σ² ≥ t is excluded: see `null_vector_bound`.
Both are what the verifier proves from a certificate.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np

from formulations import measures
from formulations.bounds.certified import best_known
from formulations.bounds.so3_moments.null_vector_bound import exclude_with_signs
from formulations.bounds.so3_moments.relaxation import (
    Progress,
    prepare_proof,
    silent,
    solve_relaxation,
)
from formulations.bounds.so3_moments.sampled_blocks import sector_families
from formulations.bounds.so3_moments.wigner import (
    DEGREE_4,
    RowSector,
    degree_sectors,
    unsigned_sectors,
    without_repetition,
)
from nlp.arrays import Rng, one_blas_thread, whole_number
from nlp.starts import seed_of

# With rows of degree 6; total spin 1 is needed.
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
#: The squared worst case that is excluded.
EXCLUDED = 0.3275


@one_blas_thread()
def residual_bound(
    joints: int = 7,
    *,
    seed: Rng | None = None,
    rng: Rng | None = None,
    progress: Progress = silent,
    out: Path | None = None,
    executor: Executor | None = None,
) -> dict[str, Any]:
    """Bound ½‖JJᵀ − (n/3)I‖_F² of all unit revolute Jacobians of 6 to 9 joints from below.

    The certificate goes to `out`; the executor is where it is verified, by default here. What
    is returned are plain values for JSON, the bound and the evidence.
    """
    whole_number("joints", joints, 6, 9)
    generator = np.random.default_rng(seed_of(seed, rng))
    prepare_proof(out)
    families = sector_families(RESIDUAL, joints)
    solved = solve_relaxation(families, joints, generator, progress=progress)
    bound, evidence = solved.refined().proved(joints, progress, out, executor)
    return _plain("residual", joints, "tight", max(0.0, bound), evidence)


@one_blas_thread()
def max_min_bound(
    *,
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
    bound, evidence = exclude_with_signs(
        *(EXCLUDED, MAX_MIN),
        rng=seed_of(seed, rng),
        progress=progress,
        out=out,
        executor=executor,
    )
    return _plain("max-min", 7, "null-vector", bound, evidence)


def _plain(
    quantity: str, joints: int, preset: str, bound: float, evidence: Mapping[str, Any]
) -> dict[str, Any]:
    """Return a bound, its distance from the best value known, and what it rests on."""
    best = best_known(quantity, "unit-revolute", joints)
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
