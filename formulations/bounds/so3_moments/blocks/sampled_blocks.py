"""Blocks of the moment matrix evaluated, averaged over all symmetries, at configurations.

The frame is averaged by summing over the components of the total spin, phase and signs by
keeping to a sector, conjugation by the real part, the order of the joints by choosing which
carry odd m and summing over tableaux.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from formulations.bounds.so3_moments.representations.adapted_rows import (
    AdaptedRows,
    adapted_rows,
)
from formulations.bounds.so3_moments.representations.clebsch_gordan import Floats, coupling
from formulations.bounds.so3_moments.representations.permuted_rows import (
    Assignment,
    PermutedRows,
)
from formulations.bounds.so3_moments.representations.row_sectors import Label, RowSector
from formulations.bounds.so3_moments.representations.wigner import wigner_matrices

Complex: TypeAlias = NDArray[np.complex128]
# Functions of one joint: label and place to values of shape (configurations, 2l+1).
Factors: TypeAlias = Callable[[Label, int], Complex]
# Total spin to values of shape (ways, configurations, components).
Coupled: TypeAlias = dict[int, Complex]


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
        places = (range(sector.odd), range(sector.odd, joints))
        entries = [
            PermutedRows(parts, places, sector.spin) for parts in sector.label_sets(joints)
        ]
        self.rows = [entry for entry in entries if entry.length]
        self.blocks: list[AdaptedRows] = adapted_rows(self.rows, sector.charge)

    @property
    def sizes(self) -> list[int]:
        """Numbers of rows of the blocks."""
        return [block.size for block in self.blocks]

    @property
    def largest_spin(self) -> int:
        """Largest spin of one joint."""
        return max((spin for rows in self.rows for spin in rows.spins), default=0)

    @property
    def orders(self) -> list[tuple[int, ...]]:
        """Orders of the joints that put each choice of k joints first."""
        return [
            (*chosen, *(j for j in range(self.joints) if j not in chosen))
            for chosen in combinations(range(self.joints), self.sector.odd)
        ]

    def evaluate(self, rotations: Floats) -> list[Floats]:
        """Return each block, shape (configurations, size, size), at (configurations, n, 3, 3).

        The mean over uniformly distributed configurations is the unit matrix.
        """
        wigner = wigner_matrices(rotations, self.largest_spin)
        orders = self.orders
        found = [np.zeros((len(rotations), block.size, block.size)) for block in self.blocks]
        for order in orders:
            factors = joint_factors(wigner, order)
            plain = [plain_rows(rows, factors) for rows in self.rows]
            for total, block in zip(found, self.blocks, strict=True):
                values = adapted_values(block, plain)
                total += values @ values.transpose(0, 2, 1)
        spin = 2 * self.sector.spin + 1
        for total, block in zip(found, self.blocks, strict=True):
            total /= len(orders) * spin * block.tableaux
        return found


def joint_factors(wigner: Sequence[Complex], order: Sequence[int]) -> Factors:
    """Return the functions of the joints in an order, from D^l of all configurations."""

    def factors(label: Label, place: int) -> Complex:
        spin, m = label
        return wigner[spin][:, order[place], :, spin + m]

    return factors


def plain_rows(rows: PermutedRows, factors: Factors) -> Floats:
    """Return the values of plain rows, shape (rows, configurations, 2(2L+1)).

    The last axis holds the components of the total spin, real parts before imaginary parts.
    `factors` gives the functions D^l_{·m} of the joint at a place, (configurations, 2l+1); the
    last label may come with several values for each configuration. Joints are coupled one
    after another, so assignments that begin alike share their first steps.
    """
    labels, components = rows.labels, 2 * rows.spin + 1
    found: list[Floats] = []
    known: dict[Assignment, Coupled] = {(): {0: np.ones((1, 1, 1), dtype=complex)}}
    for assignment in rows.assignments:
        # Assignments are sorted: only beginnings of the present one are still of use.
        known = {
            begun: coupled
            for begun, coupled in known.items()
            if assignment[: len(begun)] == begun
        }
        for q in range(max(map(len, known)), len(labels)):
            left = sum(rows.spins[q + 1 :])
            reachable = range(max(0, rows.spin - left), rows.spin + left + 1)
            factor = factors(labels[q], assignment[q])
            grown = coupled_with(known[assignment[:q]], factor, labels[q][0], reachable)
            known[assignment[: q + 1]] = grown
        values = known[assignment][rows.spin]
        found.append(np.concatenate([values.real, values.imag], axis=-1))
    stacked = np.concatenate(found)
    return stacked.reshape(rows.length, -1, 2 * components)


def coupled_with(coupled: Coupled, factor: Complex, spin: int, reachable: range) -> Coupled:
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
    grown: dict[int, list[Complex]] = {}
    for before, begun in coupled.items():
        values = begun
        if len(factor) != values.shape[1]:
            values = np.tile(values, (1, len(factor) // values.shape[1], 1))
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
    # Rows without any joint are the same at all configurations.
    count = max(values.shape[1] for values in plain)
    components = plain[0].shape[2]
    found = np.zeros((block.tableaux, block.size, count * components))
    for number, columns, coefficients in block.parts:
        values = plain[number]
        if values.shape[1] != count:
            values = np.tile(values, (1, count // values.shape[1], 1))
        values = values.reshape(len(values), -1)
        found[:, columns.start : columns.stop] += coefficients.transpose(0, 2, 1) @ values
    shaped = found.reshape(block.tableaux, block.size, count, components)
    return shaped.transpose(2, 1, 0, 3).reshape(count, block.size, -1)
