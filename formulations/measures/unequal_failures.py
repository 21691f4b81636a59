"""Unequal failures: how likely each is, and what it leaves of J alone (NumPy only).

J is a Jacobian, shape (m, n), one column for each of n joints, counted from 0. F is a set of k
joints that lock, σ_F the smallest singular value that is left of J, in its units. The failure
model gives each F a *share* P(F | exactly k joints fail), the shares add up to 1, and a
*weight* w_F, its share over the largest one:

- *expected worst-direction dexterity*: Σ_F P(F | k) σ_F;
- *probability-weighted worst case*: min_F σ_F/w_F, where a failure half as likely as the
  likeliest may leave half as much; what cannot fail does not count.

With equal probabilities the second is eq. (5).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from lockedjoint.formulations import measures
from lockedjoint.formulations.io.objects import Brief
from lockedjoint.formulations.measures.jacobian import MOST_SETS, check_sets
from lockedjoint.nlp.arrays import FloatArray, whole_number
from lockedjoint.nlp.errors import InputError, entries_of, of_kind

# The least probability of a failure that can happen: the odds of a smaller one could underflow
# beside others.
_LEAST_PROBABILITY = 1e-12
# The probability by which joints that are alike fail: any other gives the same shares.
_ANY_PROBABILITY = 0.5
# Weights that differ by at most this share count as equal: rounding of the products.
_SAME_WEIGHT = 1e-9


@dataclass(frozen=True, repr=False)
class FailureModel(Brief):
    """Joints that fail independently, each with its own probability.

    Parameters
    ----------
    probabilities
        Of each joint's failure, from 1e-12 to 1 - 1e-12; or 0 for a joint that never fails.
    failures
        How many joints lock at once, k.

    Raises
    ------
    InputError
        If a probability is out of range, fewer than k joints may fail, or there are more than
        `MOST_SETS` sets of k joints.

    Examples
    --------
    >>> import lockedjoint as lj
    >>> never_the_first = lj.FailureModel((0.0, 0.1, 0.1, 0.2))
    >>> never_the_first
    <FailureModel: probabilities (0, 0.1, 0.1, 0.2), failures 1>
    """

    probabilities: tuple[float, ...]
    failures: int = 1

    def __post_init__(self) -> None:
        each = entries_of("probabilities", self.probabilities, "one for each joint")
        given = tuple(_probability(value) for value in each)
        object.__setattr__(self, "probabilities", given)
        if whole_number("failures", self.failures, 1) > len(self.fallible):
            allowed = f"at most the number of joints that may fail, {len(self.fallible)}"
            raise InputError("failures", self.failures, allowed)
        check_sets(len(self.fallible), self.failures)

    @classmethod
    def equally_likely(
        cls, joints: int, failures: int = 1, never: Collection[int] = ()
    ) -> FailureModel:
        """Return the model of `joints` alike joints, less those that never fail.

        Each of the others fails with probability ½; the shares do not depend on it.

        Parameters
        ----------
        joints
            Number of joints n.
        failures
            How many joints lock at once.
        never
            Joints that never fail, counted from 0.
        """
        count = whole_number("joints", joints, 1, MOST_SETS)
        return cls((_ANY_PROBABILITY,) * count).sparing(never, failures)

    def sparing(self, never: Collection[int], failures: int | None = None) -> FailureModel:
        """Return this model with joints, counted from 0, that never fail."""
        n = len(self.probabilities)
        never = entries_of("never", never, "joints, counted from 0")
        for joint in never:
            if whole_number("joint that never fails", joint, 0) >= n:
                raise InputError("joint that never fails", joint, f"at most {n - 1}")
        probabilities = tuple(
            0.0 if i in never else p for i, p in enumerate(self.probabilities)
        )
        return FailureModel(probabilities, self.failures if failures is None else failures)

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return len(self.probabilities)

    @property
    def fallible(self) -> tuple[int, ...]:
        """Joints that may fail, counted from 0."""
        return tuple(i for i, p in enumerate(self.probabilities) if p > 0)

    @property
    def odds(self) -> tuple[float, ...]:
        """p/(1 − p) of each joint."""
        return tuple(p / (1 - p) for p in self.probabilities)

    def shares(self) -> Mapping[tuple[int, ...], float]:
        """Return the probability of each set of k joints, given that exactly k fail.

        Π_{f∈F} p_f Π_{g∉F} (1 − p_g), divided by the sum over all sets: proportional to the
        product of the odds. Sets are in lexicographic order; impossible ones are left out.
        """
        weights = self.weights()
        total = math.fsum(weights.values())
        return {joints: weight / total for joints, weight in weights.items()}

    def weights(self) -> Mapping[tuple[int, ...], float]:
        """Return each possible set's share over that of the likeliest set: above 0, up to 1."""
        logs = np.log([self.odds[f] for f in self.fallible])
        sets = list(combinations(range(logs.size), self.failures))
        sums = np.array([math.fsum(logs[list(chosen)]) for chosen in sets])
        relative = np.exp(sums - sums.max())
        return {
            tuple(self.fallible[i] for i in chosen): float(weight)
            for chosen, weight in zip(sets, relative, strict=True)
        }


def sets_by_weight(failures: FailureModel) -> Mapping[float, tuple[tuple[int, ...], ...]]:
    """Return sets by weight, the largest first; weights that differ by rounding are one."""
    groups: dict[float, list[tuple[int, ...]]] = {}
    for joints, weight in failures.weights().items():
        near = [known for known in groups if abs(known - weight) <= _SAME_WEIGHT * weight]
        groups.setdefault(near[0] if near else weight, []).append(joints)
    return {weight: tuple(groups[weight]) for weight in sorted(groups, reverse=True)}


def _probability(value: float) -> float:
    """Return a probability as a float; InputError if it is out of range."""
    number = isinstance(value, (int, float, np.number)) and not isinstance(value, bool)
    least, most = _LEAST_PROBABILITY, 1 - _LEAST_PROBABILITY
    if not number or not (value == 0 or least <= value <= most):
        raise InputError("failure probability", value, "0, or from 1e-12 to 1 - 1e-12")
    return float(value)


def expected_sigma(jacobian: npt.ArrayLike, failures: FailureModel) -> float:
    """Return the mean of σ_F over the sets F of k joints, given that exactly k joints fail."""
    sigmas = list(_possible_sigmas(jacobian, failures).values())
    return float(np.dot(list(failures.shares().values()), sigmas))


def weighted_worst_case(
    jacobian: npt.ArrayLike, failures: FailureModel
) -> tuple[float, tuple[int, ...]]:
    """Return the least σ_F/w_F, and the joints F, counted from 0, that realise it."""
    sigmas, weights = _possible_sigmas(jacobian, failures), failures.weights()
    worst = min(sigmas, key=lambda joints: sigmas[joints] / weights[joints])
    return sigmas[worst] / weights[worst], worst


def possible_worst_case_sigma(jacobian: npt.ArrayLike, failures: FailureModel) -> float:
    """Return the least σ_F over the failures that can happen, however unlikely (eq. 5)."""
    return min(_possible_sigmas(jacobian, failures).values())


def overall_expected_sigma(jacobian: npt.ArrayLike, failures: FailureModel) -> float:
    """Return the mean of σ when any number of joints may fail, none included.

    More than k failures count as nothing left, so this is a lower limit of the mean over all
    numbers of failures, and the mean itself for k = n − m.
    """
    matrix = _matching(jacobian, failures)
    total = _probability_of((), failures) * float(measures.singular_values(matrix)[-1])
    for count in range(1, failures.failures + 1):
        sigmas = _possible_sigmas(matrix, FailureModel(failures.probabilities, count))
        total += sum(_probability_of(joints, failures) * s for joints, s in sigmas.items())
    return float(total)


def covered_probability(failures: FailureModel) -> float:
    """Return the probability that at most k joints fail."""
    return sum(
        _probability_of(joints, failures)
        for count in range(failures.failures + 1)
        for joints in combinations(failures.fallible, count)
    )


def _possible_sigmas(
    jacobian: npt.ArrayLike, failures: FailureModel
) -> dict[tuple[int, ...], float]:
    """Return σ_F of each set F that can fail, in lexicographic order."""
    matrix = _matching(jacobian, failures)
    m, n = matrix.shape
    sets = list(combinations(failures.fallible, failures.failures))
    if n - failures.failures < m:
        return dict.fromkeys(sets, 0.0)
    sigmas = measures.remaining_singular_values(matrix, sets)[:, -1]
    return dict(zip(sets, sigmas.tolist(), strict=True))


def _matching(jacobian: npt.ArrayLike, failures: FailureModel) -> FloatArray:
    """Return a Jacobian, checked; InputError unless it has a probability for each joint."""
    matrix = measures.as_jacobian(jacobian)
    of_kind("failures", failures, FailureModel, "a FailureModel")
    if matrix.shape[1] != failures.joints:
        allowed = f"{matrix.shape[1]} of them, one for each joint"
        raise InputError("failure probabilities", f"{failures.joints} numbers", allowed)
    return matrix


def _probability_of(joints: tuple[int, ...], failures: FailureModel) -> float:
    """Return the probability that exactly these joints fail."""
    factors = [p if i in joints else 1 - p for i, p in enumerate(failures.probabilities)]
    return float(np.prod(factors))
