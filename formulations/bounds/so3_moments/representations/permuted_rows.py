"""How permutations of the joints, and conjugation, act on the rows with one set of labels.

A row is an assignment of the labels to joints together with one way of coupling. The joints
fall into groups, each with its own labels; only permutations within a group are needed. Equal
labels are given to joints in ascending order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, permutations, product
from typing import TypeAlias

import numpy as np

from formulations.bounds.so3_moments.representations.row_sectors import Label
from formulations.bounds.so3_moments.representations.wigner import (
    axis_exchange,
    coupled_tensors,
)
from nlp.arrays import FloatArray

Assignment: TypeAlias = tuple[int, ...]


@dataclass(frozen=True)
class PermutedRows:
    """The rows with one set of labels, assignment by assignment, coupling by coupling.

    Parameters
    ----------
    parts
        The labels that occur in each group of joints, ascending; the other joints of the group
        contribute 1.
    places
        The groups: consecutive ranges of joints.
    spin
        Total spin L.
    """

    parts: tuple[tuple[Label, ...], ...]
    places: tuple[range, ...]
    spin: int

    @property
    def labels(self) -> tuple[Label, ...]:
        """All labels, in the order of coupling."""
        return tuple(label for part in self.parts for label in part)

    @property
    def spins(self) -> tuple[int, ...]:
        """The spins, in the order of coupling."""
        return tuple(label[0] for label in self.labels)

    @cached_property
    def assignments(self) -> tuple[Assignment, ...]:
        """Which joint carries each label, in the order of the labels; lexicographic."""
        choices = (
            _assignments(part, places)
            for part, places in zip(self.parts, self.places, strict=True)
        )
        return tuple(tuple(chain(*chosen)) for chosen in product(*choices))

    @property
    def ways(self) -> int:
        """Number of ways to couple the spins to L."""
        return len(coupled_tensors(self.spins, self.spin))

    @property
    def length(self) -> int:
        """Number of rows."""
        return len(self.assignments) * self.ways

    def exchange(self, joint: int) -> FloatArray:
        """Return the orthogonal matrix, (rows, rows), that exchanges a joint and the next.

        Both must be in the same group.
        """
        labels = self.labels
        swapped = {joint: joint + 1, joint + 1: joint}
        moves = []
        for assignment in self.assignments:
            image = [swapped.get(j, j) for j in assignment]
            order = list(range(len(image)))
            for q in range(len(image) - 1):
                if labels[q] == labels[q + 1] and image[q] > image[q + 1]:
                    order[q : q + 2] = q + 1, q
            moves.append((tuple(image[q] for q in order), order))
        return self._action(self, moves)

    @property
    def conjugate(self) -> PermutedRows:
        """The rows with all phases reversed."""
        parts = tuple(tuple(sorted(_reversed(part))) for part in self.parts)
        return PermutedRows(parts, self.places, self.spin)

    def conjugation(self) -> FloatArray:
        """Return the orthogonal matrix, (conjugate rows, rows), of (v, ω) → (v, −ω)."""
        order: list[int] = []
        for part in self.parts:
            image, start = _reversed(part), len(order)
            # Sorting is stable, so joints with equal labels stay in ascending order.
            order += [start + q for q in sorted(range(len(part)), key=image.__getitem__)]
        moves = [(tuple(chosen[q] for q in order), order) for chosen in self.assignments]
        return np.asarray((-1) ** sum(self.spins) * self._action(self.conjugate, moves))

    def _action(
        self, goal: PermutedRows, moves: Sequence[tuple[Assignment, Sequence[int]]]
    ) -> FloatArray:
        """Return the matrix, (goal rows, rows), that takes each assignment to another one.

        `moves` holds for each assignment its image, and the order of its labels there.
        """
        numbers = {assignment: a for a, assignment in enumerate(goal.assignments)}
        action = np.zeros((len(numbers), goal.ways, len(moves), self.ways))
        for a, (image, order) in enumerate(moves):
            action[numbers[image], :, a, :] = axis_exchange(self.spins, self.spin, order)
        return action.reshape(goal.length, self.length)


def _reversed(labels: Sequence[Label]) -> list[Label]:
    return [(spin, -m) for spin, m in labels]


def _assignments(labels: Sequence[Label], places: range) -> list[Assignment]:
    ties = [q for q in range(len(labels) - 1) if labels[q] == labels[q + 1]]
    return [
        chosen
        for chosen in permutations(places, len(labels))
        if all(chosen[q] < chosen[q + 1] for q in ties)
    ]
