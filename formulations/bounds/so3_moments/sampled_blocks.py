"""Blocks of the moment matrix evaluated, averaged over all symmetries, at configurations.

The frame is averaged by summing over the components of the total spin, phase and signs by
keeping to a sector, conjugation by the real part, the order of the joints by choosing which
carry odd m and summing over tableaux.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from formulations.bounds.so3_moments.adapted_rows import AdaptedRows, adapted_rows, sector_rows
from formulations.bounds.so3_moments.clebsch_gordan import Floats, coupled_tensors
from formulations.bounds.so3_moments.permuted_rows import PermutedRows
from formulations.bounds.so3_moments.row_sectors import RowSector
from formulations.bounds.so3_moments.wigner import wigner_matrices

_CHUNK = 4_000_000  # numbers in one product of Wigner functions


class SectorBlocks:
    """The blocks of one sector, ready to be evaluated.

    Parameters
    ----------
    sector
        The sector.
    joints
        Number n of joints.
    """

    def __init__(self, sector: RowSector, joints: int) -> None:
        self.sector = sector
        self.joints = joints
        self.rows = sector_rows(sector, joints)
        self.blocks: list[AdaptedRows] = adapted_rows(sector, joints)

    def evaluate(self, rotations: Floats) -> list[Floats]:
        """Return each block, shape (configurations, size, size), at (configurations, n, 3, 3).

        The mean over uniformly distributed configurations is the unit matrix.
        """
        largest = max((max(rows.labels.spins, default=0) for rows in self.rows), default=0)
        wigner = wigner_matrices(rotations, max(largest, 1))
        orders = [
            (*chosen, *(j for j in range(self.joints) if j not in chosen))
            for chosen in combinations(range(self.joints), self.sector.odd)
        ]
        found = [np.zeros((len(rotations), block.size, block.size)) for block in self.blocks]
        for order in orders:
            arranged = [matrix[:, list(order)] for matrix in wigner]
            plain = [plain_rows(rows, arranged) for rows in self.rows]
            for total, block in zip(found, self.blocks, strict=True):
                values = adapted_values(block, plain)
                total += values @ values.transpose(0, 2, 1)
        spin = 2 * self.sector.spin + 1
        for total, block in zip(found, self.blocks, strict=True):
            total /= len(orders) * spin * block.tableaux
        return found


def plain_rows(rows: PermutedRows, wigner: list[NDArray[np.complex128]]) -> Floats:
    """Return the values of plain rows, shape (rows, configurations, 2(2L+1)).

    The last axis holds the components of the total spin, real parts before imaginary parts.
    `wigner` holds D^l of shape (configurations, n, 2l+1, 2l+1).
    """
    labels = rows.labels.labels
    count = len(wigner[0])
    components = 2 * rows.spin + 1
    tensors = coupled_tensors(rows.labels.spins, rows.spin)
    flat = np.moveaxis(tensors, 0, -2).reshape(-1, rows.ways * components)
    columns = [wigner[spin][:, :, :, spin + m] for spin, m in labels]
    found = np.empty((len(rows.assignments), rows.ways, count, 2 * components))
    step = max(1, _CHUNK // max(1, count * len(flat)))
    for start in range(0, len(rows.assignments), step):
        chosen = np.array(rows.assignments[start : start + step], dtype=int)
        products = np.ones((len(chosen) * count, 1), dtype=complex)
        for q, column in enumerate(columns):
            factor = column[:, chosen[:, q]].swapaxes(0, 1).reshape(len(products), -1)
            products = (products[:, :, None] * factor[:, None, :]).reshape(len(products), -1)
        shape = (len(chosen), count, rows.ways, components)
        part = found[start : start + step].transpose(0, 2, 1, 3)
        part[..., :components] = (products.real @ flat).reshape(shape)
        part[..., components:] = (products.imag @ flat).reshape(shape)
    return found.reshape(rows.length, count, 2 * components)


def adapted_values(block: AdaptedRows, plain: list[Floats]) -> Floats:
    """Return the values of a block's rows, (configurations, size, tableaux · components)."""
    _, count, components = plain[0].shape
    found = np.zeros((block.tableaux, block.size, count * components))
    for number, columns, coefficients in block.parts:
        values = plain[number].reshape(len(plain[number]), -1)
        found[:, columns.start : columns.stop] += coefficients.transpose(0, 2, 1) @ values
    shaped = found.reshape(block.tableaux, block.size, count, components)
    return shaped.transpose(2, 1, 0, 3).reshape(count, block.size, -1)
