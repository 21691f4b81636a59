"""How permutations of the joints, and conjugation, act on the rows with one set of labels.

A row is an assignment of the labels to joints together with one way of coupling. The joints
with odd m are 0 … k−1 here; only permutations within these and within the rest are needed.
Equal labels are given to joints in ascending order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations
from typing import TypeAlias

import numpy as np

from formulations.bounds.so3_moments.clebsch_gordan import (
    Floats,
    axis_exchange,
    coupled_tensors,
)
from formulations.bounds.so3_moments.row_sectors import Label, LabelSet

Assignment: TypeAlias = tuple[int, ...]


@dataclass(frozen=True)
class PermutedRows:
    """The rows with one set of labels, assignment by assignment, coupling by coupling.

    Parameters
    ----------
    labels
        The labels.
    spin
        Total spin L.
    joints
        Number n of joints.
    """

    labels: LabelSet
    spin: int
    joints: int

    @cached_property
    def assignments(self) -> tuple[Assignment, ...]:
        """Which joint carries each label, in the order of the labels; lexicographic."""
        k = len(self.labels.odd)
        odd = _assignments(self.labels.odd, range(k))
        even = _assignments(self.labels.even, range(k, self.joints))
        return tuple(first + second for first in odd for second in even)

    @property
    def ways(self) -> int:
        """Number of ways to couple the spins to L."""
        return len(coupled_tensors(self.labels.spins, self.spin))

    @property
    def length(self) -> int:
        """Number of rows."""
        return len(self.assignments) * self.ways

    def exchange(self, joint: int) -> Floats:
        """Return the orthogonal matrix, (rows, rows), that exchanges a joint and the next.

        Both must carry odd m or both even m.
        """
        numbers = {assignment: a for a, assignment in enumerate(self.assignments)}
        labels, spins, ways = self.labels.labels, self.labels.spins, self.ways
        swapped = {joint: joint + 1, joint + 1: joint}
        action = np.zeros((len(numbers), ways, len(numbers), ways))
        for assignment, a in numbers.items():
            image = [swapped.get(j, j) for j in assignment]
            order = list(range(len(image)))
            for q in range(len(image) - 1):
                if labels[q] == labels[q + 1] and image[q] > image[q + 1]:
                    image[q : q + 2] = image[q + 1], image[q]
                    order[q : q + 2] = order[q + 1], order[q]
            mixing = axis_exchange(spins, self.spin, order)
            action[numbers[tuple(image)], :, a, :] = mixing
        return action.reshape(self.length, self.length)

    @property
    def conjugate(self) -> PermutedRows:
        """The rows with all phases reversed."""
        return PermutedRows(self.labels.conjugate, self.spin, self.joints)

    def conjugation(self) -> Floats:
        """Return the orthogonal matrix, (conjugate rows, rows), of (v, ω) → (v, −ω)."""
        goal = self.conjugate
        reversed_labels = [(spin, -m) for spin, m in self.labels.labels]
        k = len(self.labels.odd)
        # Sorting is stable, so joints with equal labels stay in ascending order.
        order = sorted(range(k), key=lambda q: reversed_labels[q])
        order += sorted(range(k, len(reversed_labels)), key=lambda q: reversed_labels[q])
        mixing = axis_exchange(self.labels.spins, self.spin, order)
        numbers = {assignment: a for a, assignment in enumerate(goal.assignments)}
        action = np.zeros((len(numbers), goal.ways, len(self.assignments), self.ways))
        for a, assignment in enumerate(self.assignments):
            image = tuple(assignment[q] for q in order)
            action[numbers[image], :, a, :] = mixing
        sign = (-1) ** sum(self.labels.spins)
        return np.asarray(sign * action.reshape(goal.length, self.length))


def _assignments(labels: Sequence[Label], places: range) -> list[Assignment]:
    ties = [q for q in range(len(labels) - 1) if labels[q] == labels[q + 1]]
    return [
        chosen
        for chosen in permutations(places, len(labels))
        if all(chosen[q] < chosen[q + 1] for q in ties)
    ]
