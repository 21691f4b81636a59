"""Rows of a sector sorted by all symmetries: one small set for each block.

A row is an assignment of labels to joints together with one way of coupling. The joints fall
into groups, each with its own labels; only permutations within a group are needed. Equal labels
are given to joints in ascending order. Permutations of the joints with odd m and of the rest
give shapes and tableaux; where the charge is 0, conjugation splits what belongs to a shape into
even and odd.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, permutations, product
from math import prod
from typing import TypeAlias

import numpy as np

from formulations.bounds.so3_moments.wigner import (
    Label,
    LabelSet,
    axis_exchange,
    coupled_tensors,
)
from formulations.bounds.so3_moments.young_basis import Shapes, young_bases
from nlp.arrays import FloatArray

Assignment: TypeAlias = tuple[int, ...]


@dataclass(frozen=True)
class PermutedRows:
    """The rows with one set of labels, assignment by assignment, coupling by coupling."""

    #: The labels in each group of joints, ascending; its other joints contribute 1.
    parts: LabelSet
    #: The groups: consecutive ranges of joints.
    places: tuple[range, ...]
    #: Total spin L.
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
        """How many ways there are to couple the spins to L."""
        return len(coupled_tensors(self.spins, self.spin))

    @property
    def length(self) -> int:
        """Number of rows."""
        return len(self.assignments) * self.ways

    @property
    def exchanges(self) -> dict[int, FloatArray]:
        """`exchange` of each joint and the next in its group."""
        return {joint: self.exchange(joint) for group in self.places for joint in group[:-1]}

    def exchange(self, joint: int) -> FloatArray:
        """Return the orthogonal (rows, rows) that exchanges a joint and the next."""
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


@dataclass(frozen=True, eq=False)
class AdaptedRows:
    """The rows of one block, as combinations of the plain rows."""

    #: Shapes of the permutations of the joints in each group.
    shapes: Shapes
    #: Number of a set of labels of the sector, columns of this block that it contributes to,
    #: and coefficients of shape (tableaux, plain rows, columns).
    parts: tuple[tuple[int, range, FloatArray], ...]
    #: Number of rows of the block, and of tableaux of the shapes.
    size: int
    tableaux: int


def adapted_rows(rows: Sequence[PermutedRows], charge: int) -> list[AdaptedRows]:
    """Return the rows of all blocks of a sector, from its plain rows, one entry a label set.

    For charge 0 the rows must be closed under conjugation. They are scaled so that every row
    has mean square 1 over all configurations.
    """
    numbers = {entry.parts: number for number, entry in enumerate(rows)}
    # Behaviour under conjugation is even, odd, or mixed if the charge is not 0.
    found: dict[tuple[Shapes, str], list[list[tuple[int, FloatArray]]]] = {}
    for number, entry in enumerate(rows):
        if charge:
            for shapes, basis in young_bases(entry.exchanges, entry.places).items():
                found.setdefault((shapes, "mixed"), []).append([(number, basis)])
            continue
        other = numbers[entry.conjugate.parts]
        if other < number:
            continue
        conjugation = entry.conjugation()
        for shapes, basis in young_bases(entry.exchanges, entry.places).items():
            if other == number:
                even_rows, odd_rows = _split(conjugation, basis)
                even, odd = [(number, even_rows)], [(number, odd_rows)]
            else:
                half, image = np.sqrt(0.5) * basis, np.sqrt(0.5) * (conjugation @ basis)
                even, odd = [(number, half), (other, image)], [(number, half), (other, -image)]
            found.setdefault((shapes, "even"), []).append(even)
            found.setdefault((shapes, "odd"), []).append(odd)
    blocks = [_collect(key[0], parts, rows) for key, parts in sorted(found.items())]
    return [block for block in blocks if block.size]


def _split(conjugation: FloatArray, basis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the bases of the even and of the odd rows; the same split for every tableau."""
    values, vectors = np.linalg.eigh(basis[0].T @ conjugation @ basis[0])
    return basis @ vectors[:, values > 0], basis @ vectors[:, values < 0]


def _collect(
    shapes: Shapes,
    contributions: list[list[tuple[int, FloatArray]]],
    rows: Sequence[PermutedRows],
) -> AdaptedRows:
    parts = []
    size = 0
    for together in contributions:
        columns = range(size, size + together[0][1].shape[2])
        size = columns.stop
        if columns:
            parts += [
                (number, columns, _scale(rows[number]) * basis) for number, basis in together
            ]
    tableaux = contributions[0][0][1].shape[0]
    return AdaptedRows(shapes, tuple(parts), size, tableaux)


def _scale(entry: PermutedRows) -> float:
    """Return 1 over the root mean square of a plain row."""
    return float(np.sqrt(prod(2 * spin + 1 for spin in entry.spins)))
