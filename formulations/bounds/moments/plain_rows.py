"""Plain rows: labels that joints carry, whose Wigner functions are coupled to a total spin.

A plain row assigns labels to joints, and couples their Wigner functions to the total spin in
one of several ways. The joints fall into groups, each with labels of its own: the locked joint,
those with odd m, the others. Labels that are equal go to joints in ascending order.

- label (l, m), label set, groups of joints, spin L: see `row_sectors`;
- joint: its number is its place in the order of the joints, which `plain_values` gets;
- factor q: the Wigner function of label q, in the order of `PlainRows.labels`;
- assignment: the joint of each factor; coupling: one of the ways to couple the spins to L, see
  `coupled_tensors`;
- row: a pair of an assignment and a coupling. Row number: assignment · couplings + coupling.

Symmetries act on plain rows by matrices: the exchange of two joints, and conjugation
(v, ω) → (v, −ω), which reverses the sign of every m.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, permutations, product
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy.sparse import csr_array

from lockedjoint.formulations.bounds.moments.row_sectors import Label, LabelSet
from lockedjoint.formulations.bounds.moments.wigner import (
    axis_exchange,
    coupled_tensors,
    extended_exchange,
)
from lockedjoint.nlp.arrays import FloatArray

#: The joint that carries each label, in the order of the labels.
Assignment: TypeAlias = tuple[int, ...]


class _Image(NamedTuple):
    """Where a symmetry takes an assignment, both by their numbers."""

    #: Number of the assignment that it becomes.
    goal: int
    #: Number of the assignment before.
    assignment: int
    #: Factor q of the image is factor order[q] of the assignment.
    order: tuple[int, ...]


@dataclass(frozen=True)
class PlainRows:
    """The plain rows with one set of labels: assignment by assignment, coupling by coupling.

    Attributes
    ----------
    group_labels
        The labels in each group of joints, ascending; its other joints contribute 1.
    groups
        The groups: consecutive ranges of joints.
    spin
        Total spin L.
    """

    group_labels: LabelSet
    groups: tuple[range, ...]
    spin: int

    @cached_property
    def labels(self) -> tuple[Label, ...]:
        """All labels, in the order in which they are coupled."""
        return tuple(chain(*self.group_labels))

    @cached_property
    def spins(self) -> tuple[int, ...]:
        """The spins of the labels."""
        return tuple(spin for spin, _ in self.labels)

    @cached_property
    def assignments(self) -> tuple[Assignment, ...]:
        """All assignments of the labels to joints, in lexicographic order."""
        choices = (
            _group_assignments(labels, group)
            for labels, group in zip(self.group_labels, self.groups, strict=True)
        )
        return tuple(tuple(chain(*chosen)) for chosen in product(*choices))

    @property
    def couplings(self) -> int:
        """Number of ways to couple the spins to L."""
        return len(coupled_tensors(self.spins, self.spin))

    @property
    def length(self) -> int:
        """Number of plain rows."""
        return len(self.assignments) * self.couplings

    @cached_property
    def exchanges(self) -> dict[int, csr_array]:
        """The action of each exchange of neighbours, an orthogonal matrix (rows, rows).

        Joint i has an exchange with i + 1 if both are in one group.
        """
        return {
            joint: csr_array(self._action(self, images))
            for joint, images in self._exchange_images.items()
        }

    @cached_property
    def _exchange_images(self) -> dict[int, list[_Image]]:
        """The images under each exchange of neighbours."""
        return {
            joint: [*self._images(self, self.labels, {joint: joint + 1, joint + 1: joint})]
            for group in self.groups
            for joint in group[:-1]
        }

    def exchanged(self, joint: int, columns: FloatArray) -> FloatArray:
        """Return the exchange of `joint` and the next, times columns, in extended precision.

        `columns` and the result have the shape (…, rows, k).
        """
        shape = (*columns.shape[:-2], len(self.assignments), self.couplings, -1)
        before = columns.astype(np.longdouble).reshape(shape)
        after = before.copy()
        images = self._exchange_images[joint]
        for order in {image.order for image in images}:
            same = [image for image in images if image.order == order]
            goals = [image.goal for image in same]
            sources = [image.assignment for image in same]
            matrix = extended_exchange(self.spins, self.spin, order)
            after[..., goals, :, :] = matrix @ before[..., sources, :, :]
        return np.asarray(after.reshape(columns.shape))

    @property
    def conjugate(self) -> PlainRows:
        """The plain rows with the opposite m."""
        reversed_labels = tuple(
            tuple(sorted((spin, -m) for spin, m in labels)) for labels in self.group_labels
        )
        return PlainRows(reversed_labels, self.groups, self.spin)

    def conjugation(self) -> FloatArray:
        """Return the action of (v, ω) → (v, −ω), orthogonal, (conjugate rows, rows)."""
        goal = self.conjugate
        reversed_labels = [(spin, -m) for spin, m in self.labels]
        action = self._action(goal, self._images(goal, reversed_labels, {}))
        return np.asarray((-1) ** sum(self.spins) * action)

    def _action(self, goal: PlainRows, images: Iterable[_Image]) -> FloatArray:
        """Return the matrix, (goal rows, rows), of a symmetry with these images."""
        shape = (len(goal.assignments), goal.couplings, len(self.assignments), self.couplings)
        action = np.zeros(shape)
        for image in images:
            exchange = axis_exchange(self.spins, self.spin, image.order)
            action[image.goal, :, image.assignment, :] = exchange
        return action.reshape(goal.length, self.length)

    def _images(
        self, goal: PlainRows, labels: Sequence[Label], renamed: Mapping[int, int]
    ) -> Iterator[_Image]:
        """Yield the image of each assignment when labels change and joints are renamed.

        Factor q gets the label `labels`[q] and the joint `renamed`[joint]. Then factors are
        sorted by group, label and joint, as `goal` has them.
        """
        goals = {assignment: number for number, assignment in enumerate(goal.assignments)}
        group_of = [group for group, some in enumerate(self.group_labels) for _ in some]
        for number, assignment in enumerate(self.assignments):
            joints = [renamed.get(joint, joint) for joint in assignment]
            factors = sorted(zip(group_of, labels, joints, range(len(joints)), strict=True))
            image = tuple(joint for _, _, joint, _ in factors)
            order = tuple(q for *_, q in factors)
            yield _Image(goals[image], number, order)


def _group_assignments(labels: Sequence[Label], group: range) -> list[Assignment]:
    """Return all ways to give labels to joints of a group, equal labels in ascending order."""
    equal = [q for q in range(len(labels) - 1) if labels[q] == labels[q + 1]]
    return [
        joints
        for joints in permutations(group, len(labels))
        if all(joints[q] < joints[q + 1] for q in equal)
    ]
