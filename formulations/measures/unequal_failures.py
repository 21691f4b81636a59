"""What unequal failures leave of a Jacobian, from the matrix alone (NumPy only).

With σ_F the smallest singular value after the joints in F lock, and the failure model's share
P(F | exactly k joints fail) and weight w_F, that share over the largest:

- *expected worst-direction dexterity*: Σ_F P(F | k) σ_F;
- *probability-weighted worst case*: min_F σ_F/w_F, where a failure half as likely as the
  likeliest may leave half as much; what cannot fail does not count.

With equal probabilities the second is eq. (5).
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import numpy.typing as npt

from formulations import measures
from formulations.measures.failure_model import FailureModel
from nlp.arrays import FloatArray
from nlp.errors import InputError


def expected_sigma(jacobian: npt.ArrayLike, failures: FailureModel) -> float:
    """Mean of σ_F over the sets F of k joints, given that exactly k joints fail."""
    sigmas = possible_sigmas(jacobian, failures)
    return float(np.dot(list(failures.shares().values()), list(sigmas.values())))


def weighted_worst_case(
    jacobian: npt.ArrayLike, failures: FailureModel
) -> tuple[float, tuple[int, ...]]:
    """Least σ_F/w_F and the joints, counted from 0, that realise it."""
    sigmas, weights = possible_sigmas(jacobian, failures), failures.weights()
    worst = min(sigmas, key=lambda joints: sigmas[joints] / weights[joints])
    return sigmas[worst] / weights[worst], worst


def possible_worst_case_sigma(jacobian: npt.ArrayLike, failures: FailureModel) -> float:
    """Least σ_F over the failures that can happen, however unlikely (eq. 5 for those)."""
    return min(possible_sigmas(jacobian, failures).values())


def overall_expected_sigma(jacobian: npt.ArrayLike, failures: FailureModel) -> float:
    """Mean of σ when any number of joints may fail, none included.

    More than k failures count as nothing left, so this is a lower limit of the mean over all
    numbers of failures, and the mean itself for k = n − m.
    """
    matrix = _matching(jacobian, failures)
    total = _probability_of((), failures) * float(measures.singular_values(matrix)[-1])
    for count in range(1, failures.locked + 1):
        sigmas = possible_sigmas(matrix, FailureModel(failures.probabilities, count))
        total += sum(_probability_of(joints, failures) * s for joints, s in sigmas.items())
    return float(total)


def covered_probability(failures: FailureModel) -> float:
    """Probability that at most k joints fail."""
    return float(
        sum(
            _probability_of(joints, failures)
            for count in range(failures.locked + 1)
            for joints in combinations(failures.fallible, count)
        )
    )


def possible_sigmas(
    jacobian: npt.ArrayLike, failures: FailureModel
) -> dict[tuple[int, ...], float]:
    """σ_F of each set F that can fail, in lexicographic order.

    Raises
    ------
    InputError
        If J has another number of joints than the model.
    """
    matrix = _matching(jacobian, failures)
    m, n = matrix.shape
    if n - failures.locked < m:
        return dict.fromkeys(combinations(failures.fallible, failures.locked), 0.0)
    return {
        joints: float(np.linalg.svd(np.delete(matrix, joints, axis=1), compute_uv=False)[-1])
        for joints in combinations(failures.fallible, failures.locked)
    }


def _matching(jacobian: npt.ArrayLike, failures: FailureModel) -> FloatArray:
    matrix = measures.as_jacobian(jacobian)
    if matrix.shape[1] != failures.joints:
        allowed = f"{matrix.shape[1]} of them, one for each joint"
        raise InputError("failure probabilities", f"{failures.joints} numbers", allowed)
    return matrix


def _probability_of(joints: tuple[int, ...], failures: FailureModel) -> float:
    """Probability that exactly these joints fail."""
    factors = [p if i in joints else 1 - p for i, p in enumerate(failures.probabilities)]
    return float(np.prod(factors))
