"""Which joints may fail, how likely, and how many at once: a frozen value."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from nlp.arrays import whole_number
from nlp.errors import InputError


@dataclass(frozen=True)
class FailureModel:
    """Joints that fail independently, each with its own probability.

    Parameters
    ----------
    probabilities
        Of each joint's failure, at least 0 and below 1; 0 for a joint that never fails.
    locked
        How many joints lock at once, k.

    Raises
    ------
    InputError
        If a probability is out of range, or fewer than k joints may fail.
    """

    probabilities: tuple[float, ...]
    locked: int = 1

    def __post_init__(self) -> None:
        given = tuple(_probability(value) for value in self.probabilities)
        object.__setattr__(self, "probabilities", given)
        if whole_number("locked joints", self.locked, 1) > len(self.fallible):
            allowed = f"at most the number of joints that may fail, {len(self.fallible)}"
            raise InputError("locked joints", self.locked, allowed)

    @classmethod
    def equally_likely(
        cls,
        joints: int,
        locked: int = 1,
        never: Collection[int] = (),
        probability: float = 0.5,
    ) -> FailureModel:
        """Return the model of `joints` alike joints, less those that never fail.

        Parameters
        ----------
        joints
            Number of joints n.
        locked
            How many joints lock at once.
        never
            Joints that never fail, counted from 0.
        probability
            Of the others' failure; the shares of the failures do not depend on it.
        """
        count = whole_number("joints", joints, 1)
        return cls((probability,) * count, locked=1).sparing(never, locked)

    def sparing(self, never: Collection[int], locked: int | None = None) -> FailureModel:
        """Return this model with joints, counted from 0, that never fail."""
        n = len(self.probabilities)
        for joint in never:
            if whole_number("joint that never fails", joint, 0) >= n:
                raise InputError("joint that never fails", joint, f"at most {n - 1}")
        left = tuple(0.0 if i in never else p for i, p in enumerate(self.probabilities))
        return FailureModel(left, self.locked if locked is None else locked)

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
        sets = list(combinations(range(logs.size), self.locked))
        sums = np.array([math.fsum(logs[list(chosen)]) for chosen in sets])
        relative = np.exp(sums - sums.max())
        return {
            tuple(self.fallible[i] for i in chosen): float(weight)
            for chosen, weight in zip(sets, relative, strict=True)
        }


def _probability(value: float) -> float:
    number = isinstance(value, (int, float, np.number)) and not isinstance(value, bool)
    # The odds of a smaller positive number could underflow beside others.
    if not number or not (value == 0 or 1e-12 <= value <= 1 - 1e-12):
        raise InputError("failure probability", value, "0, or from 1e-12 to below 1")
    return float(value)
