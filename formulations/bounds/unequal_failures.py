"""Bounds where some joints never fail, or fail less often than others.

Of n columns let s belong to joints that may fail (S), r = n − s to joints that never do. With
ρ = min(r, m), m' = m − ρ, T = ‖J‖_F², T_S = Σ_{f∈S} ‖j_f‖² and y the least averaged root of s
columns in m' dimensions, k locked joints leave at most

    t ≤ T/(ρ + m'/y),
    t ≤ (T − (k/s) T_S)/(ρ + (1 − k/s) m'/y),       t ≤ T_S y/m'  (if m' > 0).

docs/several_failures.md derives this, and from it the bounds for unequal probabilities.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations import measures
from lockedjoint.formulations.measures.unequal_failures import (
    FailureModel,
    covered_probability,
    expected_sigma,
    overall_expected_sigma,
    possible_worst_case_sigma,
    weighted_worst_case,
)
from lockedjoint.nlp.arrays import FloatArray, finite_vector
from lockedjoint.nlp.errors import InputError


def fallible_bound(
    task_dimension: int,
    joints: int,
    fallible: int,
    trace: float,
    failures: int = 1,
    fallible_trace: tuple[float, float] | None = None,
) -> float:
    """Bound t, the square of the measure, where s joints may fail and k ≤ s of them lock.

    `trace` is T, and `fallible_trace` has limits of T_S. 0 where fewer than m joints are left.
    """
    m, n, k, s = task_dimension, joints, failures, fallible
    if k > n - m:
        return 0.0
    spanned = min(n - s, m)
    rest = m - spanned
    least = float(measures.averaged_spectrum(np.ones(rest), s, k)[0]) if rest else 1.0
    spent = rest / least
    bounds = [trace / (spanned + spent)]
    if fallible_trace is not None:
        low, high = fallible_trace
        bounds.append((trace - k / s * low) / (spanned + (1 - k / s) * spent))
        if rest:
            bounds.append(high * least / rest)
    return min(bounds)


def weighted_worst_bound(
    task_dimension: int, norms_squared: Sequence[float], failures: FailureModel
) -> float:
    """Bound the weighted worst case min_F σ_F/w_F of all J with columns of these norms."""
    m, norms = task_dimension, _norms(norms_squared, failures)
    n, k, trace = norms.size, failures.failures, float(norms.sum())
    likeliest = sorted(failures.fallible, key=lambda f: -failures.odds[f])
    logs = np.log([failures.odds[f] for f in likeliest])
    levels = []
    for count in range(k, len(likeliest) + 1):
        weight = math.exp(float(logs[count - k : count].sum() - logs[:k].sum()))
        size = float(norms[likeliest[:count]].sum())
        level = fallible_bound(m, n, count, trace, k, (size, size))
        levels.append(math.sqrt(level) / weight)
    return min(levels)


def possible_worst_bound(
    task_dimension: int, norms_squared: Sequence[float], failures: FailureModel
) -> float:
    """Bound the worst case over possible failures of all J with columns of these norms."""
    norms = _norms(norms_squared, failures)
    size = float(norms[list(failures.fallible)].sum())
    count = len(failures.fallible)
    trace, k = float(norms.sum()), failures.failures
    level = fallible_bound(task_dimension, norms.size, count, trace, k, (size, size))
    return math.sqrt(level)


def expected_bound(
    task_dimension: int, norms_squared: Sequence[float], failures: FailureModel
) -> float:
    """Bound the expected dexterity Σ_F P(F | k) σ_F of all J with columns of these norms."""
    m, norms = task_dimension, _norms(norms_squared, failures)
    n, trace = norms.size, float(norms.sum())
    if failures.failures > n - m:
        return 0.0
    marginal = np.zeros(n)
    for joints, share in failures.shares().items():
        marginal[list(joints)] += share / failures.failures
    ascending = np.sort(norms[list(failures.fallible)])
    levels = []
    for count in range(1, ascending.size + 1):
        limits = float(ascending[:count].sum()), float(ascending[-count:].sum())
        levels.append(fallible_bound(m, n, count, trace, 1, limits))
    left = np.minimum.accumulate(np.sqrt(levels))
    return float(np.sort(marginal)[::-1][: left.size] @ left)


def _norms(norms_squared: Sequence[float], failures: FailureModel) -> FloatArray:
    norms = finite_vector("squared column norms", norms_squared, failures.joints)
    if np.any(norms < 0):
        raise InputError("squared column norms", float(norms.min()), "at least 0")
    return norms


def assess_failures(
    jacobian: npt.ArrayLike, failures: FailureModel, *, probabilities_known: bool = True
) -> dict[str, Any]:
    """Return the measures of unequal failures and their bounds, as plain values by name.

    Each has a ``…_bound`` for columns of J's norms (docs/several_failures.md).
    """
    matrix = measures.as_jacobian(jacobian)
    known = probabilities_known
    weighted, joints = weighted_worst_case(matrix, failures)
    m, norms = matrix.shape[0], np.sum(matrix**2, axis=0).tolist()
    return {
        "failure_probabilities": list(failures.probabilities) if known else None,
        "never_failing_joints": [i for i, p in enumerate(failures.probabilities) if p == 0],
        "possible_worst_sigma": possible_worst_case_sigma(matrix, failures),
        "possible_worst_bound": possible_worst_bound(m, norms, failures),
        "weighted_worst_sigma": weighted,
        "weighted_worst_joints": list(joints),
        "weighted_worst_bound": weighted_worst_bound(m, norms, failures),
        "expected_sigma": expected_sigma(matrix, failures),
        "expected_bound": expected_bound(m, norms, failures),
        "overall_expected_sigma": overall_expected_sigma(matrix, failures) if known else None,
        "covered_probability": covered_probability(failures) if known else None,
    }
