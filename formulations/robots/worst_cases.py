"""The worst case of an arm and its gradient at many configurations, or fast at one.

J and the gradient of uᵀJ(q)v are CasADi's; the worst failure and its singular vectors u and v
are those of `measures`.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, cast

import casadi as ca
import numpy as np

from formulations import measures
from formulations.joints.joint import ColumnModel
from formulations.measures.jacobian import LARGEST_ENTRY
from formulations.measures.worst_failure import worst_case_of_one
from nlp.arrays import FloatArray
from nlp.problem import Evaluation

# Configurations that are evaluated at once, a power of two.
_AT_ONCE = 256


def worst_case_at(arm: ColumnModel, point: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return σ (eq. 5) and its gradient at one point, shape (n,), in the time of a tick."""
    matrix, slope = _single_functions(arm)
    jacobian = matrix(point)[0]
    if not np.all(np.abs(jacobian) <= LARGEST_ENTRY):  # NaN, too
        measures.worst_case_sigma_batch(jacobian[None])  # says what is wrong
    sigma, left, right = worst_case_of_one(jacobian)
    return np.asarray(sigma), slope(np.concatenate([point, left, right]))[0][:, 0]


def worst_cases(arm: ColumnModel, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return σ and its gradient at many points, shape (N, n)."""
    rows = np.ascontiguousarray(points)
    sigma, gradient = np.empty(len(rows)), np.empty(rows.shape)
    done = 0
    while done < len(rows):
        # Powers of two: functions of few sizes are built, whatever the size of a batch.
        part = slice(done, done + min(_AT_ONCE, 1 << (len(rows) - done).bit_length() - 1))
        sigma[part], gradient[part] = _at_once(arm, rows[part])
        done = part.stop
    return sigma, gradient


@lru_cache(maxsize=64)
def statement(arm: ColumnModel) -> tuple[tuple[ca.SX, ...], ca.SX, ca.SX]:
    """Return symbols (q, u, v), J(q), and the gradient of uᵀJ(q)v."""
    q, u, v = arm.symbols(), ca.SX.sym("u", arm.shape[0]), ca.SX.sym("v", arm.shape[1])
    matrix = ca.densify(arm.matrix(q))  # what follows has room for all entries
    return (q, u, v), matrix, ca.densify(ca.gradient(ca.bilin(matrix, u, v), q))


@lru_cache(maxsize=64)
def _single_functions(arm: ColumnModel) -> tuple[Evaluation, Evaluation]:
    symbols, matrix, slope = statement(arm)
    return Evaluation(symbols[0], [matrix]), Evaluation(ca.vertcat(*symbols), [slope])


@lru_cache(maxsize=64)
def _batch_functions(arm: ColumnModel, count: int) -> tuple[ca.Function, ca.Function]:
    symbols, matrix, slope = statement(arm)
    matrices = ca.Function("matrices", [symbols[0]], [matrix])
    return matrices.map(count), ca.Function("slope", [*symbols], [slope]).map(count)


def _at_once(arm: ColumnModel, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    count, (m, n) = len(rows), arm.shape
    matrices, slope = _batch_functions(arm, count)
    stack, gradient = np.empty((count, n, m)), np.empty((count, n))
    _call(matrices, stack, rows)
    worst = measures.worst_case_sigma_batch(stack.transpose(0, 2, 1))
    _call(slope, gradient, rows, worst.left, worst.right)
    return worst.sigma, gradient


def _call(function: ca.Function, result: FloatArray, *arguments: FloatArray) -> None:
    """Evaluate on the memory of arrays: a row here is a column of CasADi, nothing is copied."""
    buffer, evaluate = cast("Any", function).buffer()
    for k, argument in enumerate(arguments):
        buffer.set_arg(k, argument.data)
    buffer.set_res(0, result.data)
    evaluate()
