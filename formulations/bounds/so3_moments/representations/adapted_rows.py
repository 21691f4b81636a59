"""Rows of a sector sorted by all symmetries: one small set for each block.

Permutations of the joints with odd m and of the rest give shapes and tableaux; where the charge
is 0, conjugation splits what belongs to a shape into even and odd.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod
from typing import Literal, TypeAlias

import numpy as np

from formulations.bounds.so3_moments.representations.permuted_rows import PermutedRows
from formulations.bounds.so3_moments.representations.young_basis import Shapes, young_bases
from nlp.arrays import FloatArray

Parity: TypeAlias = Literal["even", "odd", "mixed"]


@dataclass(frozen=True, eq=False)
class AdaptedRows:
    """The rows of one block, as combinations of the plain rows.

    Parameters
    ----------
    shapes
        Shapes of the permutations of the joints in each group.
    parity
        Behaviour under conjugation; ``"mixed"`` if the charge is not 0.
    parts
        Number of a set of labels of the sector, columns of this block that it contributes to,
        and coefficients of shape (tableaux, plain rows, columns).
    size
        Number of rows of the block.
    tableaux
        Number of tableaux of the shapes.
    """

    shapes: Shapes
    parity: Parity
    parts: tuple[tuple[int, range, FloatArray], ...]
    size: int
    tableaux: int


def adapted_rows(rows: Sequence[PermutedRows], charge: int) -> list[AdaptedRows]:
    """Return the rows of all blocks of a sector.

    Parameters
    ----------
    rows
        The plain rows, one entry for each set of labels; all have the same groups of joints
        and total spin.
    charge
        Their charge; for 0 the rows must be closed under conjugation.

    Returns
    -------
    list of AdaptedRows
        Scaled so that every row has mean square 1 over all configurations.
    """
    numbers = {entry.parts: number for number, entry in enumerate(rows)}
    found: dict[tuple[Shapes, Parity], list[list[tuple[int, FloatArray]]]] = {}
    for number, entry in enumerate(rows):
        if charge:
            for shapes, basis in _bases(entry).items():
                found.setdefault((shapes, "mixed"), []).append([(number, basis)])
            continue
        other = numbers[entry.conjugate.parts]
        if other < number:
            continue
        conjugation = entry.conjugation()
        for shapes, basis in _bases(entry).items():
            if other == number:
                even, odd = _split(conjugation, basis)
                parts = {"even": [(number, even)], "odd": [(number, odd)]}
            else:
                half, image = np.sqrt(0.5) * basis, np.sqrt(0.5) * (conjugation @ basis)
                parts = {
                    "even": [(number, half), (other, image)],
                    "odd": [(number, half), (other, -image)],
                }
            found.setdefault((shapes, "even"), []).append(parts["even"])
            found.setdefault((shapes, "odd"), []).append(parts["odd"])
    blocks = [
        _collect(shapes, parity, parts, rows)
        for (shapes, parity), parts in sorted(found.items())
    ]
    return [block for block in blocks if block.size]


def _bases(entry: PermutedRows) -> dict[Shapes, FloatArray]:
    exchanges = {joint: entry.exchange(joint) for group in entry.places for joint in group[:-1]}
    return young_bases(exchanges, entry.places)


def _split(conjugation: FloatArray, basis: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the bases of the even and of the odd rows; the same split for every tableau."""
    values, vectors = np.linalg.eigh(basis[0].T @ conjugation @ basis[0])
    return basis @ vectors[:, values > 0], basis @ vectors[:, values < 0]


def _collect(
    shapes: Shapes,
    parity: Parity,
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
    return AdaptedRows(shapes, parity, tuple(parts), size, tableaux)


def _scale(entry: PermutedRows) -> float:
    """Return 1 over the root mean square of a plain row."""
    return float(np.sqrt(prod(2 * spin + 1 for spin in entry.spins)))
