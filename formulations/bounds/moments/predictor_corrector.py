"""A dense primal–dual predictor–corrector for few unknowns and many small blocks.

    minimise  bᵀy  subject to  S = C + Σ y_j A_j ⪰ 0     (blocks together)
    maximise  −⟨C, X⟩  subject to  ⟨A_j, X⟩ = b_j,  X ⪰ 0

Newton's method on XS = μI in the HKM direction (Helmberg, Rendl, Vanderbei and Wolkowicz,
1996):

    M dy = ⟨A_i, μS⁻¹ − K⟩ − b_i,   dX = μS⁻¹ − X − K − sym(X dS S⁻¹),

M_ij = ⟨A_i, X A_j S⁻¹⟩ and K = sym(dX dS S⁻¹) of the predictor (Mehrotra, 1992).

- y: the unknowns, shape (unknowns,): the moments but for the constant 1;
- C, A_j, S and X: symmetric matrices (s, s) of a block: constant, slope in y_j, slack and
  multiplier. `_Block` has them under these words;
- b: the objective, shape (unknowns,). The equations of X are `MomentProgram.dual_residual`;
- μ: ⟨X, S⟩ divided by the order, which is the number of rows of all blocks. It is 0 at the
  optimum, and order · μ is the gap between both objectives;
- dy, dX, dS: one step. M: the Schur complement, shape (unknowns, unknowns);
- sym: the symmetric part of a matrix; ⟨·, ·⟩: the sum of products of entries.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import blas, cho_factor, cho_solve, solve_triangular

from lockedjoint.formulations.bounds.moments.moment_program import (
    ConicOutcome,
    MomentProgram,
)
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.progress import Step

# Fraction of the way to the boundary of the cone that a step goes. Nearer to 1 takes fewer
# steps and fails more often.
_STEP = 0.95
# Multiple of the unit matrix from which X starts.
_START = 1.0
# Number of iterations after which the method gives up.
_MOST_ITERATIONS = 100
# Length of both steps, as a fraction of Newton's, below which rounding prevents progress.
_STALLED = 1e-4
# Smallest factor by which a step reduces μ: smaller ones lead to the boundary too early.
_LEAST_CENTRING = 1e-3
# Relative increases of the diagonal of M that are tried until rounding leaves it definite.
_SHIFTS = (0.0, 1e-15, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9)


def _unset() -> FloatArray:
    """Return the value of a matrix that is not computed yet."""
    return np.zeros((0, 0))


@dataclass(eq=False)
class _Block:
    """A block S = C + Σ y_j A_j of size s with its multiplier X, and Cholesky factors of both.

    `slack` and everything after it are those at the last call of `factor`; before the first
    call they are empty.
    """

    #: C, shape (s, s).
    constant: FloatArray
    #: The numbers j of the unknowns that occur, ascending.
    unknowns: NDArray[np.intp]
    #: Their A_j, shape (unknowns that occur, s, s).
    slopes: FloatArray
    #: X, shape (s, s), as are all that follow.
    x: FloatArray
    #: S.
    slack: FloatArray = field(default_factory=_unset)
    #: The lower Cholesky factor of X.
    x_root: FloatArray = field(default_factory=_unset)
    #: The lower Cholesky factor of S.
    s_root: FloatArray = field(default_factory=_unset)
    #: S⁻¹.
    s_inverse: FloatArray = field(default_factory=_unset)

    @classmethod
    def of(cls, block: FloatArray) -> _Block:
        """Return a block of a program, C and all A_j, shape (1 + unknowns, s, s)."""
        constant, all_slopes = block[0], block[1:]
        occurs = np.any(all_slopes, axis=(1, 2))
        slopes = all_slopes if occurs.all() else all_slopes[occurs]
        x = _START * np.eye(block.shape[1])
        return cls(constant, unknowns=np.flatnonzero(occurs), slopes=slopes, x=x)

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

    Parameters
    ----------
    program
        The program. It starts at y = 0, where S = C.
    gap
        ⟨X, S⟩ at which it ends, relative to the largest |b_j| or 1.
    accuracy
        Largest error of the equations of X at which it ends, relative to the same.
    progress
        Is told of each iteration.

    Returns
    -------
    ConicOutcome
        X of each block, and the status: ``optimal``; ``iteration_limit``;
        ``no_interior_start`` if some C is not positive definite; ``stalled: …`` if rounding
        ends it.
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
        step = _step(program, blocks, schur, mu)
        if max(step.primal_length, step.dual_length) < _STALLED:
            status = "stalled: steps too short"
            break
        y = y + step.primal_length * step.dy
        for block, change in zip(blocks, step.dx, strict=True):
            block.x = block.x + step.dual_length * change
    return ConicOutcome(tuple(block.x for block in blocks), status, iterations)


def _share(first: float, now: float, last: float) -> float:
    """Return which share of the orders of magnitude from the first gap to the last is done."""
    if not first > last:
        return 0.0
    return float(np.clip(np.log(first / max(now, last)) / np.log(first / last), 0.0, 1.0))


class _Direction(NamedTuple):
    """A step dy, dX, dS, of which y and S go one length, and X another."""

    #: Shape (unknowns,).
    dy: FloatArray
    #: dX of each block, shape (s, s).
    dx: list[FloatArray]
    #: dS of each block, shape (s, s).
    ds: list[FloatArray]
    #: The length in y and S, at most 1.
    primal_length: float
    #: The length in X, at most 1.
    dual_length: float


def _step(
    program: MomentProgram, blocks: list[_Block], schur: tuple[FloatArray, bool], mu: float
) -> _Direction:
    """Return the corrected step from ⟨X, S⟩ = order · μ: first to μ = 0, then a safer one.

    The second aims at μ times r³, where r is the gap after the first step over that before it.
    """
    nothing = [np.zeros_like(one.x) for one in blocks]
    predictor = _direction(program, blocks, schur, 0.0, nothing)
    dual, primal = predictor.dual_length, predictor.primal_length
    after = _inner(
        [one.x + dual * change for one, change in zip(blocks, predictor.dx, strict=True)],
        [one.slack + primal * change for one, change in zip(blocks, predictor.ds, strict=True)],
    )
    centring = min(1.0, max(after / (sum(program.sizes) * mu), 0.0)) ** 3
    correction = [
        _symmetric(dx @ ds @ one.s_inverse)
        for dx, ds, one in zip(predictor.dx, predictor.ds, blocks, strict=True)
    ]
    target = max(centring, _LEAST_CENTRING) * mu
    return _direction(program, blocks, schur, target, correction)


def _direction(
    program: MomentProgram,
    blocks: list[_Block],
    schur: tuple[FloatArray, bool],
    target: float,
    correction: list[FloatArray],
) -> _Direction:
    """Return Newton's step to XS = `target`·I, with K = `correction` of each block.

    `schur` is the Cholesky factor of M, as `cho_solve` takes it.
    """
    inverses = [one.s_inverse for one in blocks]
    goals = [target * one - extra for one, extra in zip(inverses, correction, strict=True)]
    dy = cho_solve(schur, -program.dual_residual(goals), check_finite=False)
    ds = [one.combined(dy) for one in blocks]
    dx = [
        goal - one.x - _symmetric(one.x @ slope @ one.s_inverse)
        for goal, one, slope in zip(goals, blocks, ds, strict=True)
    ]
    return _Direction(
        dy=dy,
        dx=dx,
        ds=ds,
        primal_length=_longest([one.s_root for one in blocks], ds),
        dual_length=_longest([one.x_root for one in blocks], dx),
    )


def _schur_complement(blocks: list[_Block], unknowns: int) -> FloatArray:
    """Return M_ij = ⟨G_i, G_j⟩ with G_j = (root of X)ᵀ A_j (root of S)⁻ᵀ; lower triangle.

    G_j is summed over blocks, and 0 where y_j does not occur in a block.
    """
    found = np.zeros((unknowns, unknowns), order="F")
    for one in blocks:
        size, count = len(one.x), len(one.unknowns)
        right = solve_triangular(one.s_root, np.eye(size), lower=True, check_finite=False).T
        scaled = one.x_root.T @ (one.slopes.reshape(-1, size) @ right).reshape(-1, size, size)
        # Its columns are the G_j, shape (size², count).
        flat = scaled.reshape(count, -1).T
        if count == unknowns:
            found = blas.dsyrk(1.0, flat, beta=1.0, c=found, trans=1, lower=1, overwrite_c=1)
        else:
            found[np.ix_(one.unknowns, one.unknowns)] += blas.dsyrk(1.0, flat, trans=1, lower=1)
    return np.asarray(found)


def _factored(schur: FloatArray) -> tuple[FloatArray, bool] | None:
    """Return a Cholesky factor, of a slightly larger matrix if rounding needs that.

    It is a pair for `cho_solve`: the factor, and whether it is the lower one. None if no shift
    is enough. The diagonal of `schur` is overwritten.
    """
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
    """Return the step, at most 1, that stays inside of the cone in all blocks.

    With the root R of a block's X or S, R⁻¹(change)R⁻ᵀ says what the change is relative to it:
    the boundary is where its least eigenvalue times the step is −1.
    """
    lowest = 0.0
    for root, change in zip(roots, changes, strict=True):
        half = solve_triangular(root, change, lower=True, check_finite=False)
        scaled = solve_triangular(root, half.T, lower=True, check_finite=False)
        lowest = min(lowest, float(np.linalg.eigvalsh(_symmetric(scaled))[0]))
    return 1.0 if lowest > -_STEP else -_STEP / lowest


def _inner(first: Sequence[FloatArray], second: Sequence[FloatArray]) -> float:
    """Return Σ ⟨·, ·⟩ over the blocks."""
    return float(sum(np.vdot(a, b) for a, b in zip(first, second, strict=True)))


def _symmetric(matrix: FloatArray) -> FloatArray:
    """Return the symmetric part of a square matrix."""
    return np.asarray(0.5 * (matrix + matrix.T))
