"""Multipliers X ⪰ 0 of the blocks: made semidefinite, refined, and checked.

    objective(x) − bound = Σ ⟨X, B(x)⟩   for all configurations x, with every X ⪰ 0

proves objective ≥ bound. The largest difference of the two sides at fresh configurations is
subtracted from the bound. That is numerical evidence, no proof: between the configurations
nothing is known.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.linalg import qr

from formulations.bounds.so3_moments.blocks.sampled_blocks import BlockFamily
from formulations.bounds.so3_moments.programs.moment_program import MomentProgram
from nlp.arrays import FloatArray

_RELATIVE_RANK = 1e-13
_RELATIVE_STRENGTH = 1e-11
_ROWS_AT_ONCE = 4000


def semidefinite_root(matrix: FloatArray) -> FloatArray:
    """Return R with RRᵀ the nearest semidefinite matrix."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def nearest_semidefinite(matrix: FloatArray) -> FloatArray:
    """Return the nearest positive semidefinite matrix."""
    root = semidefinite_root(0.5 * (matrix + matrix.T))
    return np.asarray(root @ root.T)


def refined_multipliers(
    program: MomentProgram, multipliers: Sequence[FloatArray], passes: int = 3
) -> list[FloatArray]:
    """Return multipliers with smaller dual residuals, as semidefinite as before.

    The change Σ_j z_j X A_j X is small relative to X, so it cannot make X indefinite as long
    as the residual is small. A pass that does not reduce the residual is not taken.
    """
    current = [np.asarray(x) for x in multipliers]
    residual = program.dual_residual(current)
    for _ in range(passes):
        gram = np.zeros((len(residual), len(residual)))
        for x, block in zip(current, program.blocks, strict=True):
            root = semidefinite_root(x)
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


def refined_interior_multipliers(
    program: MomentProgram, multipliers: Sequence[FloatArray], passes: int = 3
) -> list[FloatArray]:
    """Return multipliers whose dual residual is mere rounding, if they are inside of the cone.

    The change is that of `refined_multipliers`. Its equations are solved from an orthogonal
    factorisation instead of the normal equations: twice as many digits.
    """
    current = [np.asarray(x) for x in multipliers]
    roots = [semidefinite_root(x) for x in current]
    factor = _triangular_factor(program, roots)
    lengths = np.linalg.norm(factor, axis=0)
    lengths[lengths == 0] = 1.0
    _, strengths, vectors = np.linalg.svd(factor / lengths)
    kept = strengths > _RELATIVE_STRENGTH * strengths[0]
    strengths, vectors = strengths[kept], vectors[: len(kept)][kept]
    residual = program.dual_residual(current)
    for _ in range(passes):
        z = vectors.T @ (vectors @ (residual / lengths) / strengths**2) / lengths
        trial = []
        for x, root, block in zip(current, roots, program.blocks, strict=True):
            change = root.T @ np.tensordot(z, block[1:], axes=1) @ root
            moved = x + root @ change @ root.T
            trial.append(0.5 * (moved + moved.T))
        after = program.dual_residual(trial)
        if np.abs(after).max() >= np.abs(residual).max():
            break
        current, residual = trial, after
    return current


def _triangular_factor(program: MomentProgram, roots: Sequence[FloatArray]) -> FloatArray:
    """Return R with RᵀR the matrix of all ⟨X A_i, A_j X⟩, from the roots of X."""
    unknowns = program.moments - 1
    factor = np.zeros((0, unknowns))
    waiting: list[FloatArray] = []
    for root, block in zip(roots, program.blocks, strict=True):
        first, second = np.triu_indices(len(root))
        scaled = (root.T @ block[1:] @ root)[:, first, second]
        # An entry beside the diagonal occurs twice.
        waiting.append((scaled * np.where(first == second, 1.0, np.sqrt(2.0))).T)
        if sum(map(len, waiting)) > _ROWS_AT_ONCE:
            factor = np.asarray(qr(np.vstack([factor, *waiting]), mode="r")[0])[:unknowns]
            waiting = []
    return np.asarray(qr(np.vstack([factor, *waiting]), mode="r")[0])[:unknowns]


def identity_leftover(
    families: Sequence[BlockFamily],
    multipliers: Sequence[FloatArray],
    bound: float,
    objective: Callable[[FloatArray], FloatArray],
    fresh: FloatArray,
) -> float:
    """Return the largest difference of the two sides of the identity.

    Parameters
    ----------
    families
        The blocks, family by family.
    multipliers
        X of each block, positive semidefinite, in the order of the families.
    bound
        The constant on the left.
    objective
        Its values at rotations (configurations, n, 3, 3).
    fresh
        Rotations of configurations that were not used to find the multipliers.
    """
    blocks = (block for family in families for block in family.evaluate(fresh))
    squares = np.zeros(len(fresh))
    for x, block in zip(multipliers, blocks, strict=True):
        squares += np.tensordot(block, x, axes=2)
    return float(np.abs(objective(fresh) - bound - squares).max())
