"""Bounds for two locked joints from what pairs of columns allow: a two-point bound.

J has m rows, the task dimension, and n columns, one a joint. Every column has, after scaling, a
squared length d from 0 to 1. A pair of columns is a point (d, e, x): both squared lengths, and
the cosine x of the angle between their lines, which satisfies

    x ≤ c(d, e),   c² = min(1, (1 − d)(1 − e)/(de)).

The unknowns are symmetric matrices F_l ⪰ 0 (`blocks`), the coefficients of a polynomial h
(`lift`) and a number A (`limit`)::

    K(d, e, x) = Σ_l φ(d)ᵀ F_l φ(e) P_l(x),
    minimise    A
    subject to  K(d, e, x) ≤ h(d) + h(e)         for all pairs,
                K(d, d, 1) + 2(n − 1)h(d) + d ≤ A  for all d.

Then tr G ≤ nA, which bounds the worst case. φ(d) are the Chebyshev polynomials of 2d − 1 up to
the degree `_DEGREE`; h has twice this degree. P_l is the zonal polynomial of degree 2l,
l = 0, …, `_LAST_ZONAL`. The header of `two_point_proof` defines G, K, A and h precisely,
docs/several_failures.md derives the bound.

The program is solved for the pairs of a sample, to which the worst pairs of a trial grid are
added, some rounds long. What multipliers violate on a judging grid, and a little more, is paid
for in A. Nothing is claimed but what `two_point_proof` proves of these multipliers, so the
numbers below decide how good the bound is and how long it takes, and not whether it holds.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import cvxpy as cp
import numpy as np
from numpy.polynomial import chebyshev

from lockedjoint.formulations.bounds.two_point_proof import TwoPointBound
from lockedjoint.formulations.conic import SOLVER, run
from lockedjoint.nlp.arrays import FloatArray, nearest_semidefinite, whole_number
from lockedjoint.nlp.progress import Step


@dataclass(frozen=True)
class _Fineness:
    """How many values a grid of pairs (d, e, x) has along each axis."""

    #: Values of d, and of e, between 0 and 1.
    levels: int
    #: Values of d, and of e, about the mean of d, in addition.
    levels_near_mean: int
    #: Values of x between 0 and the largest.
    cosines: int


# Degree of φ. A larger one gives slightly better bounds at several times the time.
_DEGREE = 3
# The last l of the zonal polynomials P_l. A larger one costs time, as above.
_LAST_ZONAL = 4
#: Number of programs that are solved, each on a larger sample; fewer if nothing is violated.
ROUNDS = 5
# The pairs of the first program. A finer sample makes every program larger.
_SAMPLE = _Fineness(levels=12, levels_near_mean=6, cosines=6)
# The pairs from which the worst are added to the sample.
_TRIAL = _Fineness(levels=72, levels_near_mean=24, cosines=32)
# The pairs at which the violation v is measured: finer than those of the trial.
_JUDGE = _Fineness(levels=121, levels_near_mean=41, cosines=49)
# Number of values of d for the condition with A in the program.
_DIAGONAL_LEVELS = 160
# Number of values of d at which A is measured.
_DIAGONAL_JUDGE_LEVELS = 20_001
# Distance below m/n at which the denser values of d begin.
_BELOW_MEAN = 0.1
# Distance above m/n at which the denser values of d end. It is larger, as the mean tr G/n is
# a little above m/n.
_ABOVE_MEAN = 0.25
# K − h(d) − h(e) up to which a pair counts as satisfied, and is not added to the sample.
_SATISFIED = 1e-9
# What is tried in addition to the violation v, for the pairs between those of the judging grid.
# A smaller one gives a better bound, and a larger one is easier to prove: the best that is
# proved counts.
_EXTRA_VIOLATIONS = tuple(2e-6 * 2**k for k in range(9))
# Multiple of the unit matrix that is added to F_l, so that it stays definite when rounded.
_DEFINITE = 1e-12
# What is added to the limit of tr G, for the d between those at which A is measured.
_EXTRA_TRACE = 1e-8
# Least divisor of c², as de can be 0. Its value does not matter: c is at most 1.
_TINY = 1e-300


class _Multipliers(NamedTuple):
    """The answer of one program."""

    #: F_0, F_1, …, shape (`_DEGREE` + 1, `_DEGREE` + 1) each; empty if the solver failed.
    blocks: list[FloatArray]
    #: The coefficients of h, shape (2 · `_DEGREE` + 1,).
    lift: FloatArray
    #: What the solver says.
    status: str


def two_point_bound(
    task_dimension: int, joints: int, *, progress: Callable[[str], None] | None = None
) -> TwoPointBound:
    """Bound the worst case after two of n ≥ m + 2 joints lock, of any J with free columns.

    It is proved; `progress` is told of each round.

    Parameters
    ----------
    task_dimension
        m, from 2 to 12.
    joints
        n, from m + 2 to 60.
    progress
        Is called with a `Step` after each round.

    Raises
    ------
    InputError
        If a number is out of range.
    ArithmeticError
        If the multipliers of no round prove a bound.
    """
    m = whole_number("task dimension", task_dimension, 2, 12)
    n = whole_number("joints", joints, m + 2, 60)
    sample, trial, judge = (_grid(m, n, one) for one in (_SAMPLE, _TRIAL, _JUDGE))
    found: list[TwoPointBound] = []
    for number in range(ROUNDS):
        blocks, lift, status = _solve(m, n, sample)
        if not blocks:
            break
        found += _judged(m, n, blocks, lift, judge)
        if progress:
            words = f"round {number + 1} of {ROUNDS}: tr G ≤ {found[-1].trace_limit:.6f}"
            progress(Step(words, (number + 1) / ROUNDS))
        excess = _excess(m, trial, blocks, lift)
        worst = np.argsort(-excess)[: len(sample)]
        worst = worst[excess[worst] > _SATISFIED]
        if not worst.size:
            break
        sample = np.concatenate([sample, trial[worst]])
    for one in sorted(found, key=lambda one: one.trace_limit):
        if one.is_proved():
            return one
    raise ArithmeticError(f"{SOLVER} found no multipliers for {m}×{n}: {status}")


def _levels(m: int, n: int, fineness: _Fineness) -> FloatArray:
    """Return ascending values of d from 0 to 1, denser about the mean, shape (levels,)."""
    # Chebyshev points are denser at both ends, where polynomials change most.
    whole = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, fineness.levels))
    first, last = max(m / n - _BELOW_MEAN, 0.0), min(m / n + _ABOVE_MEAN, 1.0)
    return np.unique(
        np.concatenate([whole, np.linspace(first, last, fineness.levels_near_mean)])
    )


def _grid(m: int, n: int, fineness: _Fineness) -> FloatArray:
    """Return pairs (d, e, x) with d ≤ e and 0 ≤ x ≤ c(d, e), shape (points, 3)."""
    levels = _levels(m, n, fineness)
    first, second = (levels[index] for index in np.triu_indices(levels.size))
    product = np.maximum(first * second, _TINY)
    largest = np.sqrt(np.minimum((1 - first) * (1 - second) / product, 1.0))
    # The sine makes values of x denser near the largest.
    relative = np.sin(np.linspace(0.0, np.pi / 2, fineness.cosines))
    pairs = np.repeat(first, relative.size), np.repeat(second, relative.size)
    return np.stack([*pairs, np.outer(largest, relative).ravel()], axis=1)


def _zonal(m: int, x: FloatArray) -> FloatArray:
    """Return P_l(x), l = 0, …, `_LAST_ZONAL`, shape (points, `_LAST_ZONAL` + 1).

    They are the Gegenbauer polynomials of degree 2l in m dimensions with P_l(1) = 1. The
    recurrence is (k + m − 2) C_{k+1} = (2k + m − 2) x C_k − k C_{k−1}.
    """
    values = [np.ones_like(x), x]
    for degree in range(1, 2 * _LAST_ZONAL):
        step = (2 * degree + m - 2) * x * values[-1] - degree * values[-2]
        values.append(step / (degree + m - 2))
    return np.stack(values[::2], axis=1)


def _chebyshev(d: FloatArray, degree: int) -> FloatArray:
    """Return the Chebyshev polynomials of 2d − 1, low degrees first, (points, degree + 1)."""
    return np.asarray(chebyshev.chebvander(2.0 * d - 1.0, degree))


def _kernel_coefficients(m: int, points: FloatArray) -> FloatArray:
    """Return what K is in the entries of all F_l at pairs (d, e, x), shape (points, 3).

    The shape is (points, (`_LAST_ZONAL` + 1) · (`_DEGREE` + 1)²): F_0 row after row, F_1, ….
    """
    first, second = _chebyshev(points[:, 0], _DEGREE), _chebyshev(points[:, 1], _DEGREE)
    outer = first[:, :, None] * second[:, None, :]
    outer = 0.5 * (outer + outer.transpose(0, 2, 1))
    parts = _zonal(m, points[:, 2])[:, :, None] * outer.reshape(len(points), 1, -1)
    return np.asarray(parts.reshape(len(points), -1))


def _kernel(m: int, points: FloatArray, blocks: list[FloatArray]) -> FloatArray:
    """Return K(d, e, x) at pairs, shape (points, 3), for given F_l; shape (points,)."""
    first, second = _chebyshev(points[:, 0], _DEGREE), _chebyshev(points[:, 1], _DEGREE)
    terms = np.stack([np.sum((first @ block) * second, axis=1) for block in blocks], axis=1)
    return np.asarray(np.sum(_zonal(m, points[:, 2]) * terms, axis=1))


def _excess(
    m: int, points: FloatArray, blocks: list[FloatArray], lift: FloatArray
) -> FloatArray:
    """Return K(d, e, x) − h(d) − h(e) at pairs, shape (points,): what should not be above 0."""
    return _kernel(m, points, blocks) - _lift_coefficients(points) @ lift


def _lift_coefficients(points: FloatArray) -> FloatArray:
    """Return what h(d) + h(e) is in the coefficients of h, (points, 2 · `_DEGREE` + 1)."""
    first, second = points[:, 0], points[:, 1]
    return _chebyshev(first, 2 * _DEGREE) + _chebyshev(second, 2 * _DEGREE)


def _equal_pairs(d: FloatArray) -> FloatArray:
    """Return the pairs (d, d, 1) of a column with itself, shape (points, 3)."""
    return np.stack([d, d, np.ones_like(d)], axis=1)


def _solve(m: int, n: int, points: FloatArray) -> _Multipliers:
    """Solve the program of the header for pairs of shape (points, 3)."""
    size = _DEGREE + 1
    variables = [cp.Variable((size, size), PSD=True) for _ in range(_LAST_ZONAL + 1)]
    # This variable is n times the coefficients of h: so all unknowns are of one size.
    scaled_lift, limit = cp.Variable(2 * _DEGREE + 1), cp.Variable()
    flat = cp.hstack([cp.vec(one, order="C") for one in variables])

    d = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, _DIAGONAL_LEVELS))
    own = _kernel_coefficients(m, _equal_pairs(d)) @ flat
    lifted = (2 * (n - 1) / n) * (_chebyshev(d, 2 * _DEGREE) @ scaled_lift)
    conditions = [
        _kernel_coefficients(m, points) @ flat <= _lift_coefficients(points) @ scaled_lift / n,
        own + lifted + d <= limit,
    ]
    problem = cp.Problem(cp.Minimize(limit), conditions)
    status = run(problem)
    if scaled_lift.value is None or any(one.value is None for one in variables):
        return _Multipliers([], np.zeros(0), status)
    blocks = [np.asarray(one.value) for one in variables]
    return _Multipliers(blocks, np.asarray(scaled_lift.value) / n, status)


def _judged(
    m: int, n: int, blocks: list[FloatArray], lift: FloatArray, judge: FloatArray
) -> list[TwoPointBound]:
    """Return what holds if K − h(d) − h(e) is nowhere above v, for each of some v.

    v is its largest value on the judging grid, shape (points, 3), and one of the
    `_EXTRA_VIOLATIONS`. The F_l of the results are positive definite, and
    tr G ≤ n(A + (n − 1)v).
    """
    unit = np.eye(_DEGREE + 1)
    projected = [nearest_semidefinite(block) + _DEFINITE * unit for block in blocks]
    projected = [0.5 * (block + block.T) for block in projected]
    largest = max(float(_excess(m, judge, projected, lift).max()), 0.0)
    d = np.linspace(0.0, 1.0, _DIAGONAL_JUDGE_LEVELS)
    lifted = 2 * (n - 1) * (_chebyshev(d, 2 * _DEGREE) @ lift)
    own = float((_kernel(m, _equal_pairs(d), projected) + lifted + d).max())
    kept = [block.tolist() for block in projected]
    found = []
    for violation in (largest + extra for extra in _EXTRA_VIOLATIONS):
        limit = n * (own + (n - 1) * violation) + _EXTRA_TRACE
        found.append(TwoPointBound(m, n, limit, violation, kept, lift.tolist()))
    return found
