"""Rows of a sector sorted by all symmetries: one small set for each block.

A row is an assignment of labels to joints together with one way of coupling. The joints fall
into groups, each with its own labels; only permutations within a group are needed. Equal labels
are given to joints in ascending order. Permutations of the joints with odd m and of the rest
give shapes and tableaux; where the charge is 0, conjugation splits what belongs to a shape into
even and odd.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, permutations, product
from math import prod, sqrt
from typing import TypeAlias

import numpy as np
from scipy.sparse import csr_array

from lockedjoint.formulations.bounds.moments.tableaux import (
    Shapes,
    adapted_bases,
    tableau_bases,
)
from lockedjoint.formulations.bounds.moments.wigner import (
    Label,
    LabelSet,
    axis_exchange,
    coupled_tensors,
    extended_exchange,
)
from lockedjoint.nlp.arrays import FloatArray

Assignment: TypeAlias = tuple[int, ...]
# Numbers of an assignment of the goal and of these rows, and how factors move.
Image: TypeAlias = tuple[int, int, tuple[int, ...]]


@dataclass(frozen=True)
class PermutedRows:
    """The rows with one set of labels, assignment by assignment, coupling by coupling."""

    #: The labels in each group of joints, ascending; its other joints contribute 1.
    parts: LabelSet
    #: The groups: consecutive ranges of joints.
    places: tuple[range, ...]
    #: Total spin L.
    spin: int

    @cached_property
    def labels(self) -> tuple[Label, ...]:
        """All labels, in the order of coupling."""
        return tuple(label for part in self.parts for label in part)

    @cached_property
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

    @cached_property
    def exchanges(self) -> dict[int, csr_array]:
        """For each joint and the next in its group the orthogonal (rows, rows)."""
        return {
            joint: csr_array(self._action(self, images))
            for joint, images in self._neighbours.items()
        }

    @cached_property
    def _neighbours(self) -> dict[int, list[Image]]:
        """`_images` of the exchange of each joint and the next in its group."""
        return {
            joint: [*self._images(self, self.labels, {joint: joint + 1, joint + 1: joint})]
            for group in self.places
            for joint in group[:-1]
        }

    def exchanged(self, joint: int, columns: FloatArray) -> FloatArray:
        """Return one of `exchanges` times columns, (…, rows, k), in extended precision."""
        found = columns.astype(np.longdouble).reshape(
            *columns.shape[:-2], len(self.assignments), self.ways, -1
        )
        images = self._neighbours[joint]
        given = found.copy()
        for order in {order for *_, order in images}:
            numbers, places = zip(*(pair for *pair, own in images if own == order), strict=True)
            matrix = extended_exchange(self.spins, self.spin, order)
            found[..., numbers, :, :] = matrix @ given[..., places, :, :]
        return np.asarray(found.reshape(columns.shape))

    @property
    def conjugate(self) -> PermutedRows:
        """The rows with all phases reversed."""
        parts = tuple(tuple(sorted((spin, -m) for spin, m in part)) for part in self.parts)
        return PermutedRows(parts, self.places, self.spin)

    def conjugation(self) -> FloatArray:
        """Return the orthogonal matrix, (conjugate rows, rows), of (v, ω) → (v, −ω)."""
        reversed_labels = [(spin, -m) for spin, m in self.labels]
        images = self._images(self.conjugate, reversed_labels, {})
        return np.asarray((-1) ** sum(self.spins) * self._action(self.conjugate, images))

    def _action(self, goal: PermutedRows, images: Iterable[Image]) -> FloatArray:
        """Return the matrix, (goal rows, rows), of `_images`."""
        count = len(self.assignments)
        action = np.zeros((len(goal.assignments), goal.ways, count, self.ways))
        for number, a, order in images:
            action[number, :, a, :] = axis_exchange(self.spins, self.spin, order)
        return action.reshape(goal.length, self.length)

    def _images(
        self, goal: PermutedRows, labels: Sequence[Label], joints: Mapping[int, int]
    ) -> Iterator[Image]:
        """Give where other labels and other names of joints take each assignment."""
        numbers = {assignment: a for a, assignment in enumerate(goal.assignments)}
        group = [number for number, part in enumerate(self.parts) for _ in part]
        for a, assignment in enumerate(self.assignments):
            image = [joints.get(joint, joint) for joint in assignment]
            factors = sorted(zip(group, labels, image, range(len(image)), strict=True))
            order = tuple(q for *_, q in factors)
            yield numbers[tuple(joint for _, _, joint, _ in factors)], a, order


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

    For charge 0 the rows must be closed under conjugation. Every row has mean square 1.
    """
    numbers = {entry.parts: number for number, entry in enumerate(rows)}
    # Behaviour under conjugation is even, odd, or mixed if the charge is not 0.
    found: dict[tuple[Shapes, str], list[list[tuple[int, FloatArray]]]] = {}
    for number, entry in enumerate(rows):
        other = number if charge else numbers[entry.conjugate.parts]
        if other < number:
            continue
        conjugation = None if charge else entry.conjugation()
        exchanges, scale = entry.exchanges, sqrt(prod(2 * spin + 1 for spin in entry.spins))
        for shapes, first in adapted_bases(exchanges, entry.places).items():
            basis = scale * tableau_bases(first, exchanges, entry.places, shapes)
            if conjugation is None:
                kinds = {"mixed": [(number, basis)]}
            elif other == number:
                # The same split for every tableau.
                values, vectors = np.linalg.eigh(basis[0].T @ conjugation @ basis[0])
                kinds = {
                    "even": [(number, basis @ vectors[:, values > 0])],
                    "odd": [(number, basis @ vectors[:, values < 0])],
                }
            else:
                half, image = sqrt(0.5) * basis, sqrt(0.5) * (conjugation @ basis)
                kinds = {
                    "even": [(number, half), (other, image)],
                    "odd": [(number, half), (other, -image)],
                }
            for kind, together in kinds.items():
                found.setdefault((shapes, kind), []).append(together)
    blocks = [_collected(shapes, parts) for (shapes, _), parts in sorted(found.items())]
    return [block for block in blocks if block.size]


def _collected(
    shapes: Shapes, contributions: list[list[tuple[int, FloatArray]]]
) -> AdaptedRows:
    """Return a block of these bases, one after another; those of a list share columns."""
    parts, size = [], 0
    for together in contributions:
        columns = range(size, size + together[0][1].shape[2])
        size = columns.stop
        parts += [(number, columns, basis) for number, basis in together if columns]
    return AdaptedRows(shapes, tuple(parts), size, len(contributions[0][0][1]))
