"""What the relaxation knows of a joint: linear conditions on jjᵀ, j the joint's column of J.

j has m entries, jjᵀ the shape (m, m). With six rows j = (v; ω), the linear part above the
rotational one. ⟨A, X⟩ = tr(AᵀX) is the inner product of matrices. X is the mean of jjᵀ over
joints that are alike, or a matrix that stands for it (`lockedjoint.formulations.relaxation`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import log2

import numpy as np

from lockedjoint.nlp.arrays import as_floats, real_number
from lockedjoint.nlp.errors import InputError, of_kind

#: Number of rows of a spatial column (v; ω).
SPATIAL = 6
#: The rows of v.
LINEAR = slice(0, 3)
#: The rows of ω.
ROTATIONAL = slice(3, 6)


@dataclass(frozen=True)
class GramCondition:
    """A linear condition on jjᵀ, the matrix of products of a column's entries.

    ⟨A, jjᵀ⟩ = b or ⟨A, jjᵀ⟩ ≤ b, of every column of a kind of joint, or of their mean.

    Attributes
    ----------
    name
        What it says, in a few words.
    matrix
        Rows of A, symmetric, shape (m, m).
    limit
        b, correct to a rounding.
    equal
        Whether it is an equation.
    shared
        Whether it is on the mean over the joints of the kind.
    """

    name: str
    matrix: tuple[tuple[float, ...], ...]
    limit: float
    equal: bool = True
    shared: bool = False


def trace_condition(
    name: str,
    dimension: int,
    rows: slice,
    limit: float,
    equal: bool = True,
    shared: bool = False,
) -> GramCondition:
    """Return a condition on the sum of the squares of a column's entries in some rows.

    Parameters
    ----------
    name
        What the condition says, in a few words.
    dimension
        Number of task dimensions m.
    rows
        The rows of the column.
    limit
        The value of the sum, in the squared unit of the entries.
    equal
        Whether the sum equals `limit`, or is at most `limit`.
    shared
        Whether the condition is on the mean over all joints of the kind.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> along_z = lj.trace_condition("axis along z", 6, slice(3, 5), 0.0)  # rows of ωx and ωy
    >>> along_z.name
    'axis along z'
    """
    chosen = range(*rows.indices(dimension))
    matrix = tuple(
        tuple(float(i == k and i in chosen) for k in range(dimension)) for i in range(dimension)
    )
    return GramCondition(name, matrix, limit, equal, shared)


def checked_conditions(conditions: object, dimension: int) -> tuple[GramCondition, ...]:
    """Return what a joint says of its column; InputError if these are no conditions on it."""
    allowed = f"one GramCondition or more, each with a symmetric matrix of {dimension} rows"
    if not isinstance(conditions, tuple) or not conditions:
        raise InputError("gram_conditions", conditions, allowed)
    for one in conditions:
        of_kind("gram_conditions", one, GramCondition, allowed)
        try:
            matrix = as_floats("matrix", one.matrix)
            real_number("limit", one.limit, "a finite number")
        except InputError as error:
            raise InputError("gram_conditions", one, allowed) from error
        square = matrix.shape == (dimension, dimension) and np.array_equal(matrix, matrix.T)
        if not (square and np.any(matrix) and np.all(np.isfinite(matrix))):
            raise InputError("gram_conditions", one, f"{allowed}, finite and not 0")
    return conditions


def is_sum_of_squares(condition: GramCondition) -> bool:
    """Whether the condition is on a sum of squares of entries, with weights of at least 0."""
    weights = np.diag(condition.matrix)
    return np.array_equal(np.diag(weights), condition.matrix) and bool(np.all(weights >= 0))


def with_mean_limits(
    stated: Sequence[tuple[GramCondition, ...]],
) -> list[tuple[GramCondition, ...]]:
    """Return conditions of each joint that hold for the mean of X over joints like it.

    `stated` has the conditions of each joint. Joints are alike if only their limits differ, and
    the limits of the mean are the means of the limits.
    """
    forms = [tuple(replace(one, limit=0.0, shared=False) for one in each) for each in stated]
    means: dict[tuple[GramCondition, ...], tuple[GramCondition, ...]] = {}
    for form in set(forms):
        limits = [
            [Fraction(one.limit) for one in each]
            for each, of_joint in zip(stated, forms, strict=True)
            if of_joint == form
        ]
        mean = [float(sum(column) / len(column)) for column in zip(*limits, strict=True)]
        means[form] = tuple(
            replace(one, limit=value) for one, value in zip(form, mean, strict=True)
        )
    return [means[form] for form in forms]


def row_traces(
    stated: Sequence[tuple[GramCondition, ...]], dimension: int
) -> tuple[float, float] | None:
    """Return the largest traces of the linear and of the rotational rows of JJᵀ, in this order.

    `stated` has the conditions of each joint, `dimension` is m. None where the joints'
    conditions do not say it in so many words.
    """
    if dimension != SPATIAL:
        return None
    totals = []
    for rows in (LINEAR, ROTATIONAL):
        form = trace_condition("", dimension, rows, 0.0).matrix
        limits = [[one.limit for one in each if one.matrix == form] for each in stated]
        if not all(limits):
            return None
        totals.append(sum(map(min, limits)))
    return (totals[0], totals[1]) if min(totals) > 0 else None


def units_of_rows(
    stated: Sequence[tuple[GramCondition, ...]], dimension: int
) -> tuple[float, ...]:
    """Return units of the m rows in which v and ω are about equally large; the least is 1.

    Units are powers of 2, so that no number is rounded. Where `row_traces` knows nothing all
    are 1.
    """
    traces = row_traces(stated, dimension)
    if traces is None:
        return (1.0,) * dimension
    exponent = round(0.5 * (log2(traces[0]) - log2(traces[1])))
    linear, rotational = 2.0 ** max(exponent, 0), 2.0 ** max(-exponent, 0)
    return (linear,) * 3 + (rotational,) * 3


def in_units(condition: GramCondition, units: tuple[float, ...]) -> GramCondition:
    """Return the same condition on a column in other units, one for each row.

    An entry of the column in a row of unit u is 1/u of what it was. All factors are powers of
    2; A and b are also scaled such that the largest entry of A stays about the same.
    """
    matrix = np.array(condition.matrix)
    scaled = matrix * np.outer(units, units)
    factor = 2.0 ** -round(log2(np.abs(scaled).max() / np.abs(matrix).max()))
    rows = tuple(map(tuple, (factor * scaled).tolist()))
    return replace(condition, matrix=rows, limit=factor * condition.limit)
