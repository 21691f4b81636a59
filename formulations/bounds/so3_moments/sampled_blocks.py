"""Blocks of the moment matrix evaluated, averaged over all symmetries, at configurations.

The frame is averaged by summing over the components of the total spin, phase and signs by
keeping to a sector, conjugation by the real part, the order of the joints by choosing which
carry odd m and summing over tableaux.
"""

from __future__ import annotations

from itertools import combinations
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from formulations.bounds.so3_moments.adapted_rows import AdaptedRows, adapted_rows, sector_rows
from formulations.bounds.so3_moments.clebsch_gordan import Floats, coupling
from formulations.bounds.so3_moments.permuted_rows import Assignment, PermutedRows
from formulations.bounds.so3_moments.row_sectors import RowSector
from formulations.bounds.so3_moments.wigner import wigner_matrices

# Total spin to values of shape (ways, configurations, components).
Coupled: TypeAlias = dict[int, NDArray[np.complex128]]


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

    @property
    def sizes(self) -> list[int]:
        """Numbers of rows of the blocks."""
        return [block.size for block in self.blocks]

    @property
    def largest_spin(self) -> int:
        """Largest spin of one joint."""
        return max((spin for rows in self.rows for spin in rows.labels.spins), default=0)

    def evaluate(self, rotations: Floats) -> list[Floats]:
        """Return each block, shape (configurations, size, size), at (configurations, n, 3, 3).

        The mean over uniformly distributed configurations is the unit matrix.
        """
        wigner = wigner_matrices(rotations, self.largest_spin)
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
    `wigner` holds D^l of shape (configurations, n, 2l+1, 2l+1). Joints are coupled one after
    another, so assignments that begin alike share their first steps.
    """
    labels, components = rows.labels.labels, 2 * rows.spin + 1
    columns = [wigner[spin][:, :, :, spin + m].swapaxes(0, 1) for spin, m in labels]
    count = len(wigner[0])
    found = np.empty((len(rows.assignments), rows.ways, count, 2 * components))
    known: dict[Assignment, Coupled] = {(): {0: np.ones((1, count, 1), dtype=complex)}}
    for number, assignment in enumerate(rows.assignments):
        # Assignments are sorted: only beginnings of the present one are still of use.
        known = {
            begun: coupled
            for begun, coupled in known.items()
            if assignment[: len(begun)] == begun
        }
        for q in range(max(map(len, known)), len(labels)):
            left = sum(rows.labels.spins[q + 1 :])
            reachable = range(max(0, rows.spin - left), rows.spin + left + 1)
            factor = columns[q][assignment[q]]
            grown = coupled_with(known[assignment[:q]], factor, labels[q][0], reachable)
            known[assignment[: q + 1]] = grown
        values = known[assignment][rows.spin]
        found[number, :, :, :components] = values.real
        found[number, :, :, components:] = values.imag
    return found.reshape(rows.length, count, 2 * components)


def coupled_with(
    coupled: Coupled, factor: NDArray[np.complex128], spin: int, reachable: range
) -> Coupled:
    """Return what coupling one more joint gives, in the order of `coupled_tensors`.

    Parameters
    ----------
    coupled
        For each total spin l so far the values, (ways, configurations, 2l+1).
    factor
        Functions of the joint, (configurations, 2·spin+1).
    spin
        Spin of the joint.
    reachable
        Total spins that are still of use.
    """
    grown: dict[int, list[NDArray[np.complex128]]] = {}
    for before, values in coupled.items():
        products = (values[:, :, :, None] * factor[:, None, :]).reshape(*values.shape[:2], -1)
        for target in range(abs(before - spin), before + spin + 1):
            if target in reachable:
                table = coupling(before, spin, target).reshape(-1, 2 * target + 1)
                both = products.view(float).reshape(*products.shape, 2)
                part = np.empty((*products.shape[:2], 2 * target + 1), dtype=complex)
                part.real, part.imag = both[..., 0] @ table, both[..., 1] @ table
                grown.setdefault(target, []).append(part)
    return {target: np.concatenate(parts) for target, parts in grown.items()}


def adapted_values(block: AdaptedRows, plain: list[Floats]) -> Floats:
    """Return the values of a block's rows, (configurations, size, tableaux · components)."""
    _, count, components = plain[0].shape
    found = np.zeros((block.tableaux, block.size, count * components))
    for number, columns, coefficients in block.parts:
        values = plain[number].reshape(len(plain[number]), -1)
        found[:, columns.start : columns.stop] += coefficients.transpose(0, 2, 1) @ values
    shaped = found.reshape(block.tableaux, block.size, count, components)
    return shaped.transpose(2, 1, 0, 3).reshape(count, block.size, -1)
