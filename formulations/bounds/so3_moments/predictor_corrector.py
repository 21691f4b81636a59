"""A dense primal–dual predictor–corrector for few unknowns and many small blocks.

    minimise  bᵀy  subject to  S = C + Σ y_j A_j ⪰ 0     (blocks together)
    maximise  −⟨C, X⟩  subject to  ⟨A_j, X⟩ = b_j,  X ⪰ 0

y = 0 must satisfy C ≻ 0. Newton's method on XS = μI in the HKM direction: with the Schur
complement M_ij = ⟨A_i, X A_j S⁻¹⟩,

    M dy = ⟨A_i, μS⁻¹ − K⟩ − b_i,   dX = μS⁻¹ − X − K − sym(X dS S⁻¹),

where K = sym(dX dS S⁻¹) of the predictor (μ = 0, K = 0) corrects for the product dX dS
(Helmberg, Rendl, Vanderbei and Wolkowicz, 1996; Kojima, Shindoh and Hara, 1997; Monteiro,
1997; Mehrotra, 1992).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import blas, cho_factor, cho_solve, solve_triangular

from formulations.bounds.so3_moments.moment_program import ConicOutcome, MomentProgram
from nlp.arrays import FloatArray

_STEP = 0.95  # fraction of the way to the boundary
_START = 1.0  # multiple of the unit matrix to start X from
_MOST_ITERATIONS = 100
_STALLED = 1e-4
_SHIFTS = (0.0, 1e-15, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9)


@dataclass(frozen=True, eq=False)
class _Terms:
    """The unknowns that occur in a block, ascending, and their A_j."""

    unknowns: NDArray[np.intp]
    slopes: FloatArray

    @classmethod
    def of(cls, block: FloatArray) -> _Terms:
        occurs = np.any(block[1:], axis=(1, 2))
        slopes = block[1:] if occurs.all() else block[1:][occurs]
        return cls(np.flatnonzero(occurs), slopes)

    def combined(self, y: FloatArray) -> FloatArray:
        """Return Σ y_j A_j."""
        return np.asarray(np.tensordot(y[self.unknowns], self.slopes, axes=1))


@dataclass(frozen=True, eq=False)
class _Point:
    """X and S of each block, their Cholesky factors, and the inverse of S."""

    x: list[FloatArray]
    slacks: list[FloatArray]
    x_root: list[FloatArray]
    s_root: list[FloatArray]
    s_inverse: list[FloatArray]


def solve_with_predictor_corrector(
    program: MomentProgram,
    *,
    gap: float = 1e-9,
    accuracy: float = 1e-8,
    stop: Callable[[Sequence[FloatArray]], bool] | None = None,
    progress: Callable[[str], None] | None = None,
) -> ConicOutcome:
    """Return pseudo-moments and positive definite multipliers.

    Ends where ⟨X, S⟩ is below `gap` and no dual equation is off by more than `accuracy`, both
    relative to the largest coefficient of the objective, at least 1; or where `stop` is true
    for the multipliers. The status is ``"optimal"``, ``"enough"``, ``"stalled: …"``,
    ``"iteration_limit"`` or ``"no_interior_start"``.
    """
    y = np.zeros(program.moments - 1)
    x = [_START * np.eye(size) for size in program.sizes]
    order = sum(program.sizes)
    scale = max(1.0, float(np.abs(program.objective).max()))
    terms = [_Terms.of(block) for block in program.blocks]
    status = "iteration_limit"
    iterations = 0
    for iterations in range(_MOST_ITERATIONS + 1):
        slacks = [
            block[0] + one.combined(y) for block, one in zip(program.blocks, terms, strict=True)
        ]
        point = _factor(x, slacks)
        if point is None:
            status = "no_interior_start" if iterations == 0 else "stalled: factorisation failed"
            break
        mu = _inner(x, slacks) / order
        residual = float(np.abs(program.dual_residual(x)).max(initial=0.0))
        if progress is not None and iterations % 5 == 0:
            progress(
                f"iteration {iterations}: bound {program.dual_value(x):.7f}, "
                f"gap {order * mu:.1e}, residual {residual:.1e}"
            )
        if order * mu < gap * scale and residual < accuracy * scale:
            status = "optimal"
            break
        if stop is not None and stop(x):
            status = "enough"
            break
        if iterations == _MOST_ITERATIONS:
            break
        schur = _factored(_schur_complement(terms, point, program.moments - 1))
        if schur is None:
            status = "stalled: Schur complement not positive definite"
            break
        dy, dx, primal, dual = _step(program, terms, point, schur, mu)
        if max(primal, dual) < _STALLED:
            status = "stalled: steps too short"
            break
        y = y + primal * dy
        x = [a + dual * b for a, b in zip(x, dx, strict=True)]
    return ConicOutcome(y, tuple(x), status, iterations)


def _step(
    program: MomentProgram,
    terms: list[_Terms],
    point: _Point,
    schur: tuple[FloatArray, bool],
    mu: float,
) -> tuple[FloatArray, list[FloatArray], float, float]:
    """Return dy, dX and the lengths of the steps in y and X, from ⟨X, S⟩ = order · μ."""
    nothing = [np.zeros_like(block) for block in point.x]
    dy, dx, ds = _direction(program, terms, point, schur, 0.0, nothing)
    primal, dual = _longest(point.s_root, ds), _longest(point.x_root, dx)
    after = _inner(
        [a + dual * b for a, b in zip(point.x, dx, strict=True)],
        [a + primal * b for a, b in zip(point.slacks, ds, strict=True)],
    )
    centring = min(1.0, max(after / (sum(program.sizes) * mu), 0.0)) ** 3
    correction = [
        _symmetric(a @ b @ inverse)
        for a, b, inverse in zip(dx, ds, point.s_inverse, strict=True)
    ]
    dy, dx, ds = _direction(program, terms, point, schur, max(centring, 1e-3) * mu, correction)
    return dy, dx, _longest(point.s_root, ds), _longest(point.x_root, dx)


def _direction(
    program: MomentProgram,
    terms: list[_Terms],
    point: _Point,
    schur: tuple[FloatArray, bool],
    mu: float,
    correction: list[FloatArray],
) -> tuple[FloatArray, list[FloatArray], list[FloatArray]]:
    goals = [
        mu * inverse - extra for inverse, extra in zip(point.s_inverse, correction, strict=True)
    ]
    dy = cho_solve(schur, -program.dual_residual(goals), check_finite=False)
    ds = [one.combined(dy) for one in terms]
    dx = [
        goal - x - _symmetric(x @ slope @ inverse)
        for goal, x, slope, inverse in zip(goals, point.x, ds, point.s_inverse, strict=True)
    ]
    return dy, dx, ds


def _schur_complement(terms: list[_Terms], point: _Point, unknowns: int) -> FloatArray:
    """Return M_ij = ⟨G_i, G_j⟩ with G_j = (root of X)ᵀ A_j (root of S)⁻ᵀ; lower triangle."""
    found = np.zeros((unknowns, unknowns), order="F")
    for one, x_root, s_root in zip(terms, point.x_root, point.s_root, strict=True):
        size, count = len(x_root), len(one.unknowns)
        right = solve_triangular(s_root, np.eye(size), lower=True, check_finite=False).T
        scaled = x_root.T @ (one.slopes.reshape(-1, size) @ right).reshape(-1, size, size)
        flat = scaled.reshape(count, -1).T
        if count == unknowns:
            found = blas.dsyrk(1.0, flat, beta=1.0, c=found, trans=1, lower=1, overwrite_c=1)
        else:
            found[np.ix_(one.unknowns, one.unknowns)] += blas.dsyrk(1.0, flat, trans=1, lower=1)
    return np.asarray(found)


def _factored(schur: FloatArray) -> tuple[FloatArray, bool] | None:
    """Return a Cholesky factor, of a slightly larger matrix if rounding makes that necessary.

    The larger matrix only shortens steps along directions that are hardly determined.
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


def _factor(x: Sequence[FloatArray], slacks: Sequence[FloatArray]) -> _Point | None:
    try:
        x_root = [np.asarray(np.linalg.cholesky(block), dtype=float) for block in x]
        s_root = [np.asarray(np.linalg.cholesky(block), dtype=float) for block in slacks]
    except np.linalg.LinAlgError:
        return None
    inverse = [
        np.asarray(cho_solve((root, True), np.eye(len(root)), check_finite=False))
        for root in s_root
    ]
    return _Point(list(x), list(slacks), x_root, s_root, inverse)


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
