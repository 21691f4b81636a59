"""The best worst case after one locked joint, in closed form: eq. (6) by blocks of rows.

Let M = JJᵀ and t = min_f λ_min(M − j_f j_fᵀ), the square of the measure (5). If t > 0, each of
the n conditions M − j_f j_fᵀ ⪰ tI says j_fᵀ(M − tI)⁻¹j_f ≤ 1, and their sum is

    t · tr((M − tI)⁻¹) ≤ n − m.

Only M occurs, so whatever is known of the trace of M, or of the traces of its diagonal blocks,
bounds t. By convexity the largest t is met where each block is a multiple of the identity.

Where only the trace is known the bound is `formulations.measures.eigenvalue_bound`, which has
it for several locked joints too: docs/several_failures.md derives that.
"""

import math
from collections.abc import Sequence

from nlp.arrays import whole_number
from nlp.errors import InputError


def block_trace_bound(joints: int, sizes: Sequence[int], traces: Sequence[float]) -> float:
    """Return the largest possible t when traces of the diagonal blocks of JJᵀ are limited.

    Parameters
    ----------
    joints
        Number n of columns of J.
    sizes
        Numbers of rows m_B of the blocks, adding up to m < n.
    traces
        Upper limit T_B of the trace of each block, in the squared units of its rows.

    Returns
    -------
    float
        The root t of Σ_B m_B/(T_B/m_B − t) = (n − m)/t below every T_B/m_B.

    Raises
    ------
    InputError
        Unless sizes are positive, as many as the traces, add up to less than n, and the traces
        are positive and finite.
    """
    if len(sizes) != len(traces) or not sizes or min(sizes) < 1:
        raise InputError("sizes", list(sizes), "one positive size for each trace")
    redundancy = whole_number("joints", joints, sum(sizes) + 1) - sum(sizes)
    means = [
        positive("traces", trace) / size for trace, size in zip(traces, sizes, strict=True)
    ]
    low, high = 0.0, min(means)
    # f(t) = t Σ m_B/(mean_B − t) rises from 0 to infinity, so bisection cannot miss the root.
    while low < (middle := 0.5 * (low + high)) < high:
        shares = (size / (mean - middle) for size, mean in zip(sizes, means, strict=True))
        spent = middle * sum(shares)
        low, high = (middle, high) if spent < redundancy else (low, middle)
    return high


def positive(argument: str, value: float) -> float:
    """Return a number as a float; raise InputError unless it is positive and finite."""
    if not (math.isfinite(value) and value > 0):
        raise InputError(argument, value, "a positive finite number")
    return float(value)
