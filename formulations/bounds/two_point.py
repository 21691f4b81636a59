"""Bounds for two locked joints from what pairs of columns allow: a two-point bound.

A sum of kernels K(d, e, x) = Σ_l φ(d)ᵀ F_l φ(e) P_l(x), F_l ⪰ 0, with zonal polynomials P_l of
even degree 2l sums to at least 0 over all pairs of columns of (M − tI)^(-1/2)J. If
K(d, e, x) ≤ h(d) + h(e) wherever x² ≤ c² = (1 − d)(1 − e)/(de), and K(d, d, 1) + 2(n − 1)h(d) +
d ≤ A, then tr G ≤ nA (docs/several_failures.md). The least A is found on a sample of (d, e, x);
what is violated on a finer grid is paid for in A, and then all is proved (`two_point_proof`).
"""

from collections.abc import Callable

import cvxpy as cp
import numpy as np
from numpy.polynomial import chebyshev

from lockedjoint.formulations.bounds.two_point_proof import TwoPointBound
from lockedjoint.formulations.conic import SOLVER, run
from lockedjoint.nlp.arrays import FloatArray, nearest_semidefinite, whole_number
from lockedjoint.nlp.progress import Step

_DEGREE = 3  # of φ, as Chebyshev polynomials of 2d − 1; h has twice the degree
_ZONAL = 4  # l = 0 … this
ROUNDS = 5
# Off the grid conditions are violated by so much more; the least that can be proved counts.
_MORE = tuple(2e-6 * 2**k for k in range(9))
_DEFINITE = 1e-12  # added to F_l


def two_point_bound(
    task_dimension: int, joints: int, *, progress: Callable[[str], None] | None = None
) -> TwoPointBound:
    """Bound the worst case after two of n ≥ m + 2 joints lock, of any J with free columns.

    It is proved; `progress` is told of each round. InputError if a number is out of range.
    """
    m = whole_number("task dimension", task_dimension, 2, 12)
    n = whole_number("joints", joints, m + 2, 60)
    sample = _grid(_levels(m, n, 12, 6), 6)
    trial = _grid(_levels(m, n, 72, 24), 32)
    judge = _grid(_levels(m, n, 121, 41), 49)
    found: list[TwoPointBound] = []
    for number in range(ROUNDS):
        blocks, lift, status = _solve(m, n, sample)
        if not blocks:
            break
        found += [_checked(m, n, blocks, lift, judge, more) for more in _MORE]
        if progress:
            words = f"round {number + 1} of {ROUNDS}: tr G ≤ {found[-1].trace_limit:.6f}"
            progress(Step(words, (number + 1) / ROUNDS))
        excess = _excess(m, trial, blocks, lift)
        worst = np.argsort(-excess)[: len(sample)]
        worst = worst[excess[worst] > 1e-9]
        if not worst.size:
            break
        sample = np.concatenate([sample, trial[worst]])
    for one in sorted(found, key=lambda one: one.trace_limit):
        if one.is_proved():
            return one
    raise ArithmeticError(f"{SOLVER} found no multipliers for {m}×{n}: {status}")


def _levels(m: int, n: int, many: int, near: int) -> FloatArray:
    """Return values of d from 0 to 1, denser about the mean, which is a little above m/n."""
    whole = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, many))
    close = np.linspace(max(m / n - 0.1, 0.0), min(m / n + 0.25, 1.0), near)
    return np.unique(np.concatenate([whole, close]))


def _grid(levels: FloatArray, steps: int) -> FloatArray:
    """Return triples (d, e, x) with d ≤ e and 0 ≤ x ≤ c(d, e), shape (points, 3)."""
    first, second = (levels[index] for index in np.triu_indices(levels.size))
    product = np.maximum(first * second, 1e-300)
    largest = np.sqrt(np.minimum((1 - first) * (1 - second) / product, 1.0))
    share = np.sin(np.linspace(0.0, np.pi / 2, steps))
    pairs = np.repeat(first, steps), np.repeat(second, steps)
    return np.stack([*pairs, np.outer(largest, share).ravel()], axis=1)


def _zonal(m: int, x: FloatArray) -> FloatArray:
    """Return P_l(x), l = 0 … `_ZONAL`: Gegenbauer polynomials of degree 2l with P_l(1) = 1."""
    values = [np.ones_like(x), x]
    for degree in range(1, 2 * _ZONAL):
        step = (2 * degree + m - 2) * x * values[-1] - degree * values[-2]
        values.append(step / (degree + m - 2))
    return np.stack(values[::2], axis=1)


def _basis(d: FloatArray, degree: int) -> FloatArray:
    return np.asarray(chebyshev.chebvander(2.0 * d - 1.0, degree))


def _products(m: int, points: FloatArray) -> FloatArray:
    """Return the coefficients of all F_l in K, (points, (_ZONAL + 1) · (_DEGREE + 1)²)."""
    first, second = _basis(points[:, 0], _DEGREE), _basis(points[:, 1], _DEGREE)
    outer = first[:, :, None] * second[:, None, :]
    outer = 0.5 * (outer + outer.transpose(0, 2, 1))
    parts = _zonal(m, points[:, 2])[:, :, None] * outer.reshape(len(points), 1, -1)
    return np.asarray(parts.reshape(len(points), -1))


def _kernel(m: int, points: FloatArray, blocks: list[FloatArray]) -> FloatArray:
    first, second = _basis(points[:, 0], _DEGREE), _basis(points[:, 1], _DEGREE)
    terms = np.stack([np.sum((first @ block) * second, axis=1) for block in blocks], axis=1)
    return np.asarray(np.sum(_zonal(m, points[:, 2]) * terms, axis=1))


def _excess(
    m: int, points: FloatArray, blocks: list[FloatArray], lift: FloatArray
) -> FloatArray:
    return _kernel(m, points, blocks) - _heights(points) @ lift


def _heights(points: FloatArray) -> FloatArray:
    """Return the basis of h(d) + h(e)."""
    return _basis(points[:, 0], 2 * _DEGREE) + _basis(points[:, 1], 2 * _DEGREE)


def _solve(m: int, n: int, points: FloatArray) -> tuple[list[FloatArray], FloatArray, str]:
    """Return F_l, the coefficients of h, and the solver's status; no F_l if it failed."""
    size = _DEGREE + 1
    variables = [cp.Variable((size, size), PSD=True) for _ in range(_ZONAL + 1)]
    lift, limit = cp.Variable(2 * _DEGREE + 1), cp.Variable()
    flat = cp.hstack([cp.vec(one, order="C") for one in variables])

    d = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 160))
    same = np.stack([d, d, np.ones_like(d)], axis=1)
    # h is scaled by n, which leaves coefficients of one size.
    conditions = [
        _products(m, points) @ flat <= _heights(points) @ lift / n,
        _products(m, same) @ flat + (2 * (n - 1) / n) * (_basis(d, 2 * _DEGREE) @ lift) + d
        <= limit,
    ]
    problem = cp.Problem(cp.Minimize(limit), conditions)
    status = run(problem)
    if lift.value is None or any(one.value is None for one in variables):
        return [], np.zeros(0), status
    return [np.asarray(one.value) for one in variables], np.asarray(lift.value) / n, status


def _checked(
    m: int, n: int, blocks: list[FloatArray], lift: FloatArray, judge: FloatArray, more: float
) -> TwoPointBound:
    """Return what is proved if no condition is violated by `more` than on a grid."""
    size = _DEGREE + 1
    projected = [nearest_semidefinite(block) + _DEFINITE * np.eye(size) for block in blocks]
    projected = [0.5 * (block + block.T) for block in projected]
    violation = max(float(_excess(m, judge, projected, lift).max()), 0.0) + more
    d = np.linspace(0.0, 1.0, 20001)
    same = np.stack([d, d, np.ones_like(d)], axis=1)
    height = 2 * (n - 1) * (_basis(d, 2 * _DEGREE) @ lift)
    limit = float((_kernel(m, same, projected) + height + d).max()) + (n - 1) * violation
    kept = [block.tolist() for block in projected]
    return TwoPointBound(m, n, n * limit + 1e-8, violation, kept, lift.tolist())
