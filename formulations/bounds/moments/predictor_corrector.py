"""A dense primal–dual predictor–corrector for few unknowns and many small blocks.

    minimise  bᵀy  subject to  S = C + Σ y_j A_j ⪰ 0     (blocks together)
    maximise  −⟨C, X⟩  subject to  ⟨A_j, X⟩ = b_j,  X ⪰ 0

Newton's method on XS = μI in the HKM direction (Helmberg, Rendl, Vanderbei and Wolkowicz,
1996):

    M dy = ⟨A_i, μS⁻¹ − K⟩ − b_i,   dX = μS⁻¹ − X − K − sym(X dS S⁻¹),

M_ij = ⟨A_i, X A_j S⁻¹⟩ and K = sym(dX dS S⁻¹) of the predictor (Mehrotra, 1992).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import blas, cho_factor, cho_solve, solve_triangular

from lockedjoint.formulations.bounds.moments.moment_program import (
    ConicOutcome,
    MomentProgram,
)
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.progress import Step

_STEP = 0.95  # fraction of the way to the boundary
_START = 1.0  # multiple of the unit matrix to start X from
_MOST_ITERATIONS = 100
_STALLED = 1e-4
_SHIFTS = (0.0, 1e-15, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9)


@dataclass(eq=False)
class _Block:
    """A block S = C + Σ y_j A_j with its multiplier X, and the Cholesky factors of both."""

    constant: FloatArray
    #: The unknowns that occur, ascending, and their A_j.
    unknowns: NDArray[np.intp]
    slopes: FloatArray
    x: FloatArray
    slack: FloatArray
    x_root: FloatArray
    s_root: FloatArray
    s_inverse: FloatArray

    @classmethod
    def of(cls, block: FloatArray) -> _Block:
        occurs = np.any(block[1:], axis=(1, 2))
        slopes = block[1:] if occurs.all() else block[1:][occurs]
        x = _START * np.eye(block.shape[1])
        return cls(block[0], np.flatnonzero(occurs), slopes, x, *[block[0]] * 4)

    def combined(self, y: FloatArray) -> FloatArray:
        """Return Σ y_j A_j."""
        return np.asarray(np.tensordot(y[self.unknowns], self.slopes, axes=1))

    def factor(self, y: FloatArray) -> None:
        """Factor X, and S at y; LinAlgError unless both are positive definite."""
        self.slack = self.constant + self.combined(y)
        self.x_root = np.asarray(np.linalg.cholesky(self.x), dtype=float)
        self.s_root = np.asarray(np.linalg.cholesky(self.slack), dtype=float)
        unit = np.eye(len(self.x))
        self.s_inverse = np.asarray(cho_solve((self.s_root, True), unit, check_finite=False))


def solve_with_predictor_corrector(
    program: MomentProgram,
    *,
    gap: float = 1e-9,
    accuracy: float = 1e-8,
    progress: Callable[[str], None] | None = None,
) -> ConicOutcome:
    """Return positive definite multipliers, and the status, of a program with C ≻ 0.

    `gap` is for ⟨X, S⟩ and `accuracy` for the dual equations, relative to the objective or 1.
    """
    y = np.zeros(program.moments - 1)
    blocks = [_Block.of(block) for block in program.blocks]
    order = sum(program.sizes)
    scale = max(1.0, float(np.abs(program.objective).max()))
    status = "iteration_limit"
    iterations, first_gap = 0, 0.0
    for iterations in range(_MOST_ITERATIONS + 1):
        try:
            for block in blocks:
                block.factor(y)
        except np.linalg.LinAlgError:
            status = "no_interior_start" if iterations == 0 else "stalled: factorisation failed"
            break
        x = [block.x for block in blocks]
        mu = _inner(x, [block.slack for block in blocks]) / order
        residual = float(np.abs(program.dual_residual(x)).max(initial=0.0))
        first_gap = first_gap or order * mu
        if progress is not None:
            words = f"iteration {iterations}: gap {order * mu:.1e}, residual {residual:.1e}"
            progress(Step(words, _share(first_gap, order * mu, gap * scale)))
        if order * mu < gap * scale and residual < accuracy * scale:
            status = "optimal"
            break
        if iterations == _MOST_ITERATIONS:
            break
        schur = _factored(_schur_complement(blocks, program.moments - 1))
        if schur is None:
            status = "stalled: Schur complement not positive definite"
            break
        dy, dx, primal, dual = _step(program, blocks, schur, mu)
        if max(primal, dual) < _STALLED:
            status = "stalled: steps too short"
            break
        y = y + primal * dy
        for block, change in zip(blocks, dx, strict=True):
            block.x = block.x + dual * change
    return ConicOutcome(tuple(block.x for block in blocks), status, iterations)


def _share(first: float, now: float, last: float) -> float:
    """Return which share of the orders of magnitude between two gaps is done."""
    if not first > last:
        return 0.0
    return float(np.clip(np.log(first / max(now, last)) / np.log(first / last), 0.0, 1.0))


def _step(
    program: MomentProgram, blocks: list[_Block], schur: tuple[FloatArray, bool], mu: float
) -> tuple[FloatArray, list[FloatArray], float, float]:
    """Return dy, dX and the lengths of the steps in y and X, from ⟨X, S⟩ = order · μ."""

    def direction(mu: float, correction: list[FloatArray]) -> Any:
        """Return dy, dX, dS and the lengths of the steps."""
        inverses = [one.s_inverse for one in blocks]
        goals = [mu * one - extra for one, extra in zip(inverses, correction, strict=True)]
        dy = cho_solve(schur, -program.dual_residual(goals), check_finite=False)
        ds = [one.combined(dy) for one in blocks]
        dx = [
            goal - one.x - _symmetric(one.x @ slope @ one.s_inverse)
            for goal, one, slope in zip(goals, blocks, ds, strict=True)
        ]
        primal = _longest([one.s_root for one in blocks], ds)
        return dy, dx, ds, primal, _longest([one.x_root for one in blocks], dx)

    _, dx, ds, primal, dual = direction(0.0, [np.zeros_like(one.x) for one in blocks])
    after = _inner(
        [one.x + dual * change for one, change in zip(blocks, dx, strict=True)],
        [one.slack + primal * change for one, change in zip(blocks, ds, strict=True)],
    )
    centring = min(1.0, max(after / (sum(program.sizes) * mu), 0.0)) ** 3
    correction = [
        _symmetric(a @ b @ one.s_inverse) for a, b, one in zip(dx, ds, blocks, strict=True)
    ]
    dy, dx, _, primal, dual = direction(max(centring, 1e-3) * mu, correction)
    return dy, dx, primal, dual


def _schur_complement(blocks: list[_Block], unknowns: int) -> FloatArray:
    """Return M_ij = ⟨G_i, G_j⟩ with G_j = (root of X)ᵀ A_j (root of S)⁻ᵀ; lower triangle."""
    found = np.zeros((unknowns, unknowns), order="F")
    for one in blocks:
        size, count = len(one.x), len(one.unknowns)
        right = solve_triangular(one.s_root, np.eye(size), lower=True, check_finite=False).T
        scaled = one.x_root.T @ (one.slopes.reshape(-1, size) @ right).reshape(-1, size, size)
        flat = scaled.reshape(count, -1).T
        if count == unknowns:
            found = blas.dsyrk(1.0, flat, beta=1.0, c=found, trans=1, lower=1, overwrite_c=1)
        else:
            found[np.ix_(one.unknowns, one.unknowns)] += blas.dsyrk(1.0, flat, trans=1, lower=1)
    return np.asarray(found)


def _factored(schur: FloatArray) -> tuple[FloatArray, bool] | None:
    """Return a Cholesky factor, of a slightly larger matrix if rounding needs that."""
    diagonal = np.diag(schur).copy()
    for shift in _SHIFTS:
        np.fill_diagonal(schur, (1 + shift) * diagonal)
        try:
            root, lower = cho_factor(schur, lower=True, check_finite=False)
        except np.linalg.LinAlgError:
            continue
        return np.asarray(root), bool(lower)
    return None


def _longest(roots: Sequence[FloatArray], changes: Sequence[FloatArray]) -> float:
    """Return the step, at most 1, that stays inside of the cone."""
    lowest = 0.0
    for root, change in zip(roots, changes, strict=True):
        half = solve_triangular(root, change, lower=True, check_finite=False)
        scaled = solve_triangular(root, half.T, lower=True, check_finite=False)
        lowest = min(lowest, float(np.linalg.eigvalsh(_symmetric(scaled))[0]))
    return 1.0 if lowest > -_STEP else -_STEP / lowest


def _inner(first: Sequence[FloatArray], second: Sequence[FloatArray]) -> float:
    return float(sum(np.vdot(a, b) for a, b in zip(first, second, strict=True)))


def _symmetric(matrix: FloatArray) -> FloatArray:
    return np.asarray(0.5 * (matrix + matrix.T))
