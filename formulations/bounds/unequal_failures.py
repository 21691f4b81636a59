"""Bounds where some joints never fail, or fail less often than others.

J has m rows and n columns j_f, k joints lock, and t is the square of the worst case: the least
eigenvalue that JJᵀ keeps whichever k joints lock. S are the s joints that may fail, r = n − s
joints never do:

- T = ‖J‖_F², and T_S = Σ_{f∈S} ‖j_f‖², both in the unit of t;
- ρ = min(r, m), `spanned` in the code: dimensions that the other joints can span;
- m' = m − ρ, `rest` in the code: dimensions in which only S counts;
- y, `least` in the code: s columns in m' dimensions with k locked keep at most y times the mean
  eigenvalue of JJᵀ. It is the least of `measures.averaged_spectrum` of the unit matrix.

Then

    t ≤ T/(ρ + m'/y),
    t ≤ (T − (k/s) T_S)/(ρ + (1 − k/s) m'/y),
    t ≤ T_S y/m'  (if m' > 0).

docs/several_failures.md derives this, and from it the bounds for unequal probabilities. There F
is a set of k joints, σ_F the smallest singular value of J without them, and w_F the weight of
F: its probability over that of the likeliest set (`FailureModel`).
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
    """Bound t, the square of the worst case, where s joints may fail and k ≤ s of them lock.

    Parameters
    ----------
    task_dimension
        m.
    joints
        n.
    fallible
        s.
    trace
        T.
    failures
        k.
    fallible_trace
        Numbers between which T_S is: the lower, then the upper one; None if nothing is known.

    Returns
    -------
    float
        The bound; 0 where fewer than m joints are left.
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
    """Bound the weighted worst case min_F σ_F/w_F of all J with columns of these norms.

    `norms_squared` has the shape (n,). A bound for each number of joints is
    one where only that many likeliest joints may fail: any k of these have at least the weight
    of the least likely k, `weight`, so that σ_F/w_F is at most the bound on σ over it.
    """
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
    """Bound the worst case over possible failures of all J with columns of these norms.

    `norms_squared` has the shape (n,). A failure is possible if its probability is not 0.
    """
    norms = _norms(norms_squared, failures)
    size = float(norms[list(failures.fallible)].sum())
    count = len(failures.fallible)
    trace, k = float(norms.sum()), failures.failures
    level = fallible_bound(task_dimension, norms.size, count, trace, k, (size, size))
    return math.sqrt(level)


def expected_bound(
    task_dimension: int, norms_squared: Sequence[float], failures: FailureModel
) -> float:
    """Bound the expected dexterity Σ_F P(F | k) σ_F of all J with columns of these norms.

    `norms_squared` has the shape (n,), and P(F | k) is the probability of F if k joints lock. A
    joint f gets the share of P(F | k)/k of each F in which it is: these add up to 1. The i
    joints whose failures leave most leave at most the bound for i joints that may fail, one of
    which locks; sorted shares are multiplied with sorted bounds.
    """
    m, norms = task_dimension, _norms(norms_squared, failures)
    n, trace = norms.size, float(norms.sum())
    if failures.failures > n - m:
        return 0.0
    shares_of_joints = np.zeros(n)
    for joints, probability in failures.shares().items():
        shares_of_joints[list(joints)] += probability / failures.failures
    ascending = np.sort(norms[list(failures.fallible)])
    levels = []
    for count in range(1, ascending.size + 1):
        limits = float(ascending[:count].sum()), float(ascending[-count:].sum())
        levels.append(fallible_bound(m, n, count, trace, 1, limits))
    # What holds for fewer joints that may fail holds for more.
    left = np.minimum.accumulate(np.sqrt(levels))
    return float(np.sort(shares_of_joints)[::-1][: left.size] @ left)


def _norms(norms_squared: Sequence[float], failures: FailureModel) -> FloatArray:
    """Return squared norms, (n,); InputError unless each joint has one that is at least 0."""
    norms = finite_vector("squared column norms", norms_squared, failures.joints)
    if np.any(norms < 0):
        raise InputError("squared column norms", float(norms.min()), "at least 0")
    return norms


def assess_failures(
    jacobian: npt.ArrayLike, failures: FailureModel, *, probabilities_known: bool = True
) -> dict[str, Any]:
    """Return the measures of unequal failures and their bounds, as plain values by name.

    Parameters
    ----------
    jacobian
        J, shape (m, n).
    failures
        Which joints lock how often.
    probabilities_known
        Whether the probabilities are the user's own. If not, what follows from their absolute
        values is None: ``failure_probabilities``, ``overall_expected_sigma`` and
        ``covered_probability``.

    Returns
    -------
    dict
        Three measures ``possible_worst_sigma``, ``weighted_worst_sigma`` and
        ``expected_sigma``, each with a ``…_bound`` for columns of J's norms
        (docs/several_failures.md), and numbers of joints from 0.
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
