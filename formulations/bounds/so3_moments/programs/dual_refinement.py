"""Make multipliers satisfy the dual equations to the last digits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from formulations.bounds.so3_moments.programs.moment_program import MomentProgram
from formulations.bounds.so3_moments.representations.clebsch_gordan import Floats

_RELATIVE_RANK = 1e-13


def refined_multipliers(
    program: MomentProgram, multipliers: Sequence[Floats], passes: int = 3
) -> list[Floats]:
    """Return multipliers with smaller dual residuals, as semidefinite as before.

    The change Σ_j z_j X A_j X is small relative to X, so it cannot make X indefinite as long
    as the residual is small. A pass that does not reduce the residual is not taken.
    """
    current = [np.asarray(x) for x in multipliers]
    residual = program.dual_residual(current)
    for _ in range(passes):
        gram = np.zeros((len(residual), len(residual)))
        for x, block in zip(current, program.blocks, strict=True):
            values, vectors = np.linalg.eigh(x)
            root = vectors * np.sqrt(np.maximum(values, 0.0))
            scaled = (root.T @ (block[1:] @ root)).reshape(len(residual), -1)
            gram += scaled @ scaled.T
        z = np.linalg.lstsq(gram, residual, rcond=_RELATIVE_RANK)[0]
        trial = [
            x + x @ np.tensordot(z, block[1:], axes=1) @ x
            for x, block in zip(current, program.blocks, strict=True)
        ]
        after = program.dual_residual(trial)
        if np.abs(after).max() >= np.abs(residual).max():
            break
        current, residual = trial, after
    return [0.5 * (x + x.T) for x in current]
