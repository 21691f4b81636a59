"""Rows of a sector sorted by all symmetries: one small set for each block.

A row is an assignment of labels to joints together with one way of coupling. The joints fall
into groups, each with its own labels; only permutations within a group are needed. Equal labels
are given to joints in ascending order. Permutations of the joints with odd m and of the rest
give shapes and tableaux; where the charge is 0, conjugation splits what belongs to a shape into
even and odd.

Permutations act on the rows of a block as in Young's orthogonal form. For a shape λ with
standard tableaux T the columns of U_T are joint eigenvectors of the Jucys–Murphy elements
X_{i+1} = s_i X_i s_i + s_i, where s_i exchanges i and i + 1, and

    s_i U_T = U_T/r + √(1 − 1/r²) U_{T'},   r = content of i + 1 minus content of i,

T' being T with i and i + 1 exchanged. So averages over all permutations follow from U alone:
the average of |(U_T a)ᵀφ|² over permutations of the joints is that over all T.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import chain, permutations, product
from math import prod, sqrt
from typing import TypeAlias

import numpy as np

from formulations.bounds.so3_moments.wigner import (
    Label,
    LabelSet,
    axis_exchange,
    coupled_tensors,
)
from formulations.existence.tableaux import (
    Shape,
    partitions,
    row_reading_contents,
    standard_tableaux,
)
from nlp.arrays import FloatArray

Assignment: TypeAlias = tuple[int, ...]
# One shape for each of the groups of joints that are permuted among themselves.
Shapes: TypeAlias = tuple[Shape, ...]
Groups: TypeAlias = tuple[range, ...]
Contents: TypeAlias = tuple[int, ...]
# For each tableau the number of another one, and a distance, see `young_form`.
Images: TypeAlias = tuple[tuple[int, int], ...]


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


def young_bases(
    exchanges: Mapping[int, FloatArray], groups: Groups
) -> dict[Shapes, FloatArray]:
    """Return for each shape that occurs the bases U_T, (tableaux, rows, multiplicity).

    `exchanges` holds the orthogonal (rows, rows) that exchanges joints i and i + 1, for each i
    such that both are in one group. The tableaux are in the order of `tableau_contents`. All
    bases together are orthonormal.
    """
    rows = len(next(iter(exchanges.values()))) if exchanges else 1
    operator, weight = np.zeros((rows, rows)), 1
    weights: list[list[int]] = []
    for group in groups:
        # The eigenvalues of X_{i+1} are whole and of size at most the number of joints before:
        # with these weights, a mixed radix, those of the sum differ from tableau to tableau.
        element = np.zeros((rows, rows))
        weights.append([])
        for place, joint in enumerate(group[:-1], start=1):
            swap = exchanges[joint]
            element = swap @ element @ swap + swap
            operator += weight * element
            weights[-1].append(weight)
            weight *= 2 * place + 1
    values, vectors = np.linalg.eigh(0.5 * (operator + operator.T))
    found: dict[Shapes, FloatArray] = {}
    for shapes in product(*(tuple(partitions(len(group))) for group in groups)):
        contents = map(row_reading_contents, shapes)
        wanted = sum(np.dot(a, b) for a, b in zip(weights, contents, strict=True))
        first = vectors[:, np.abs(values - wanted) < 0.5]
        if first.shape[1]:
            found[shapes] = _all_tableaux(first, exchanges, groups, shapes)
    return found


def first_tableau(shapes: Shapes) -> int:
    """Return the number of the tableau that is filled row after row."""
    return tableau_contents(shapes).index(tuple(map(row_reading_contents, shapes)))


def projected_tableaux(
    rows: Sequence[int], exchanges: Mapping[int, FloatArray], groups: Groups, shapes: Shapes
) -> FloatArray:
    """Return the bases of all tableaux whose first is P e_i for some rows i.

    P projects on what belongs to the first tableau. No eigenvectors are needed for that, so
    other machines get the same to within rounding.
    """
    length = len(next(iter(exchanges.values()))) if exchanges else 1
    return _all_tableaux(np.eye(length)[:, list(rows)], exchanges, groups, shapes)


def _all_tableaux(
    first: FloatArray, exchanges: Mapping[int, FloatArray], groups: Groups, shapes: Shapes
) -> FloatArray:
    """Return the bases of all tableaux whose first is the projection of `first`.

    The mean over all permutations g of P_g U Y_gᵀ, where U is 0 but for the first tableau. All
    permutations of the first j + 1 joints of a group are those of the first j, followed by
    moving the last joint to any place.
    """
    tableaux = len(tableau_contents(shapes))
    bases = np.zeros((tableaux, *first.shape))
    bases[first_tableau(shapes)] = tableaux * first
    for group in groups:
        for end in range(1, len(group)):
            moved, total = bases, bases.copy()
            for joint in reversed(group[:end]):
                moved = young_image(exchanges[joint] @ moved, young_form(shapes, groups)[joint])
                total += moved
            bases = total / (end + 1)
    return bases


def young_image(bases: FloatArray, images: Images) -> FloatArray:
    """Return Σ_T' U_T' Y_{T'T} for the exchange of a joint and the next, (tableaux, …)."""
    found = np.empty_like(bases)
    for number, (goal, distance) in enumerate(images):
        found[number] = bases[number] / distance
        if abs(distance) > 1:
            found[number] += sqrt(1 - 1 / distance**2) * bases[goal]
    return found


@cache
def tableau_contents(shapes: Shapes) -> tuple[tuple[Contents, ...], ...]:
    """Return the standard tableaux of a shape in each group, as contents of 2, 3, …; sorted."""
    return tuple(product(*(sorted(standard_tableaux(shape)) for shape in shapes)))


@cache
def young_form(shapes: Shapes, groups: Groups) -> dict[int, Images]:
    """Return Young's orthogonal form of the exchange of each joint i and the next.

    For each tableau, in the order of `tableau_contents`: the number of the tableau with i and
    i + 1 exchanged, and the distance r. If |r| = 1 there is no such tableau, and the number is
    that of the tableau itself.
    """
    names = tableau_contents(shapes)
    numbers = {name: number for number, name in enumerate(names)}
    form: dict[int, Images] = {}
    for position, group in enumerate(groups):
        for place, joint in enumerate(group[:-1]):
            images = []
            for name in names:
                boxes = [0, *name[position]]
                distance = boxes[place + 1] - boxes[place]
                boxes[place : place + 2] = boxes[place + 1], boxes[place]
                goal = (*name[:position], tuple(boxes[1:]), *name[position + 1 :])
                images.append((numbers.get(goal, numbers[name]), distance))
            form[joint] = tuple(images)
    return form
