"""Rows of a sector, sorted by all symmetries into one small set for each block.

The joints of a group may be exchanged. So plain rows (`plain_rows`) are sorted by shapes and
tableaux (`tableaux`). Where the charge is 0, conjugation splits what belongs to a shape into an
even and an odd part. Conjugation is (v, ω) → (v, −ω); charge, spin and label sets are words of
`row_sectors`.

What comes in: the plain rows of each label set of a sector. What goes out: for each block the
coefficients of its rows, U_T for each tableau T, shape (plain rows, columns).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod, sqrt
from typing import NamedTuple, TypeAlias

import numpy as np

from lockedjoint.formulations.bounds.moments.plain_rows import PlainRows
from lockedjoint.formulations.bounds.moments.tableaux import (
    Shapes,
    adapted_bases,
    tableau_bases,
)
from lockedjoint.nlp.arrays import FloatArray


class BlockPart(NamedTuple):
    """What the plain rows of one label set contribute to a block.

    Attributes
    ----------
    label_set
        Number of the label set in the sector.
    columns
        Which rows of the block it contributes to.
    coefficients
        U_T of the plain rows of the label set, shape (tableaux, plain rows, columns).
    """

    label_set: int
    columns: range
    coefficients: FloatArray


@dataclass(frozen=True, eq=False)
class AdaptedRows:
    """The rows of one block, as combinations of the plain rows.

    Attributes
    ----------
    shapes
        Shapes of the permutations of the joints in each group.
    parts
        The contributions of the label sets.
    size
        Number of rows.
    tableaux
        Number of tableaux of the shapes.
    """

    shapes: Shapes
    parts: tuple[BlockPart, ...]
    size: int
    tableaux: int


# Numbers of label sets with their bases, (tableaux, plain rows, columns), to be added up.
_Contribution: TypeAlias = list[tuple[int, FloatArray]]


def adapted_rows(rows: Sequence[PlainRows], charge: int) -> list[AdaptedRows]:
    """Return the rows of all blocks of a sector, from the plain rows of its label sets.

    `charge` is that of the sector. Every row has mean square 1. For charge 0 the label sets
    must be closed under conjugation.
    """
    numbers = {some.group_labels: number for number, some in enumerate(rows)}
    contributions: dict[tuple[Shapes, str], list[_Contribution]] = {}
    for number, some in enumerate(rows):
        other = number if charge else numbers[some.conjugate.group_labels]
        # A label set and its conjugate are treated together, when the first of them comes.
        if other < number:
            continue
        # A product of Wigner functions has mean square 1/Π(2l + 1).
        scale = sqrt(prod(2 * spin + 1 for spin in some.spins))
        for shapes, first in adapted_bases(some.exchanges, some.groups, some.length).items():
            basis = scale * tableau_bases(first, some.exchanges, some.groups, shapes)
            if charge:
                kinds = {"mixed": [(number, basis)]}
            else:
                kinds = _even_and_odd(number, other, basis, some.conjugation())
            for kind, contribution in kinds.items():
                contributions.setdefault((shapes, kind), []).append(contribution)
    blocks = [
        _side_by_side(shapes, parts) for (shapes, _), parts in sorted(contributions.items())
    ]
    return [block for block in blocks if block.size]


def _even_and_odd(
    number: int, other: int, basis: FloatArray, conjugation: FloatArray
) -> dict[str, _Contribution]:
    """Split a basis of a label set by its behaviour under conjugation.

    `basis` has the shape (tableaux, plain rows, columns), `conjugation` (plain rows of `other`,
    plain rows). The label set `other` is the conjugate of `number`, perhaps the same one.
    Returned are contributions under the names ``even`` and ``odd``.
    """
    if other == number:
        # The first tableau decides for all: conjugation commutes with permutations. Its
        # eigenvalues are 1 and −1, times the square of the scale of the basis.
        values, vectors = np.linalg.eigh(basis[0].T @ conjugation @ basis[0])
        return {
            "even": [(number, basis @ vectors[:, values > 0])],
            "odd": [(number, basis @ vectors[:, values < 0])],
        }
    half, image = sqrt(0.5) * basis, sqrt(0.5) * (conjugation @ basis)
    return {
        "even": [(number, half), (other, image)],
        "odd": [(number, half), (other, -image)],
    }


def _side_by_side(shapes: Shapes, contributions: list[_Contribution]) -> AdaptedRows:
    """Return the block that has the columns of these contributions one after another."""
    parts: list[BlockPart] = []
    size = 0
    for contribution in contributions:
        _, first = contribution[0]
        columns = range(size, size + first.shape[2])
        size = columns.stop
        parts += [
            BlockPart(number, columns, basis) for number, basis in contribution if columns
        ]
    _, first = contributions[0][0]
    return AdaptedRows(shapes, tuple(parts), size, len(first))
