"""Rows of a sector sorted by all symmetries: one small set for each block.

Permutations of the joints with odd m and of the rest give shapes and tableaux; where the charge
is 0, conjugation splits what belongs to a shape into even and odd.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import Literal, TypeAlias

import numpy as np

from formulations.bounds.so3_moments.clebsch_gordan import Floats
from formulations.bounds.so3_moments.permuted_rows import PermutedRows
from formulations.bounds.so3_moments.row_sectors import RowSector
from formulations.bounds.so3_moments.young_basis import Shapes, young_bases

Parity: TypeAlias = Literal["even", "odd", "mixed"]


@dataclass(frozen=True, eq=False)
class AdaptedRows:
    """The rows of one block, as combinations of the plain rows.

    Parameters
    ----------
    sector
        The sector that they belong to.
    shapes
        Shapes of the permutations of the joints with odd m and of the rest.
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

    sector: RowSector
    shapes: Shapes
    parity: Parity
    parts: tuple[tuple[int, range, Floats], ...]
    size: int
    tableaux: int


def sector_rows(sector: RowSector, joints: int) -> list[PermutedRows]:
    """Return the plain rows of a sector, one entry for each set of labels."""
    rows = [PermutedRows(labels, sector.spin, joints) for labels in sector.label_sets(joints)]
    return [entry for entry in rows if entry.length]


def adapted_rows(sector: RowSector, joints: int) -> list[AdaptedRows]:
    """Return the rows of all blocks of a sector.

    Plain rows are scaled so that every row has mean square 1 over all configurations.
    """
    rows = sector_rows(sector, joints)
    numbers = {entry.labels: number for number, entry in enumerate(rows)}
    groups = (range(sector.odd), range(sector.odd, joints))
    found: dict[tuple[Shapes, Parity], list[list[tuple[int, Floats]]]] = {}
    for number, entry in enumerate(rows):
        if sector.charge:
            for shapes, basis in _bases(entry, groups).items():
                found.setdefault((shapes, "mixed"), []).append([(number, basis)])
            continue
        other = numbers[entry.labels.conjugate]
        if other < number:
            continue
        conjugation = entry.conjugation()
        for shapes, basis in _bases(entry, groups).items():
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
        _collect(sector, shapes, parity, parts, rows)
        for (shapes, parity), parts in sorted(found.items())
    ]
    return [block for block in blocks if block.size]


def _bases(entry: PermutedRows, groups: tuple[range, range]) -> dict[Shapes, Floats]:
    exchanges = {joint: entry.exchange(joint) for group in groups for joint in group[:-1]}
    return young_bases(exchanges, groups)


def _split(conjugation: Floats, basis: Floats) -> tuple[Floats, Floats]:
    """Return the bases of the even and of the odd rows; the same split for every tableau."""
    values, vectors = np.linalg.eigh(basis[0].T @ conjugation @ basis[0])
    return basis @ vectors[:, values > 0], basis @ vectors[:, values < 0]


def _collect(
    sector: RowSector,
    shapes: Shapes,
    parity: Parity,
    contributions: list[list[tuple[int, Floats]]],
    rows: list[PermutedRows],
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
    return AdaptedRows(sector, shapes, parity, tuple(parts), size, tableaux)


def _scale(entry: PermutedRows) -> float:
    """Return 1 over the root mean square of a plain row."""
    return float(np.sqrt(prod(2 * spin + 1 for spin in entry.labels.spins)))
