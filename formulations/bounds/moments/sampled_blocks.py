"""Blocks of the moment matrix evaluated, averaged over all symmetries, at configurations.

The frame is averaged by summing over the components of the total spin, phase and signs by
keeping to a sector, conjugation by the real part, the order of the joints by choosing which
carry odd m and summing over tableaux. Blocks of a `WorstCaseCondition` state Σ ⟨H, r rᵀ⟩ ≥ 0 of
rows r (docs/bounds.md, sections 2 and 4).
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from itertools import combinations
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from lockedjoint.formulations.bounds.moments.conditions import (
    Conditions,
    WorstCaseCondition,
)
from lockedjoint.formulations.bounds.moments.enclosed_matrix import EnclosedMatrix
from lockedjoint.formulations.bounds.moments.symmetric_rows import (
    AdaptedRows,
    Assignment,
    PermutedRows,
    adapted_rows,
)
from lockedjoint.formulations.bounds.moments.wigner import (
    ComplexArray,
    Label,
    RowSector,
    coupling,
    label_degree,
    wigner_matrices,
)
from lockedjoint.nlp.arrays import FloatArray

# Total spin to values of shape (ways, components, configurations).
Coupled: TypeAlias = dict[int, ComplexArray]
# Columns of a block, and a vector w_a for each.
Selection: TypeAlias = tuple[NDArray[np.intp], NDArray[np.intp]]


class RowBlocks:
    """The rows of one sector for n joints, sorted into blocks, alone or of a condition.

    With a condition the rows are the polynomials r_a, of a degree that is lower by
    `WorstCaseCondition.lowered`. Without, the mean of the blocks is the unit matrix.
    """

    def __init__(
        self, sector: RowSector, joints: int, condition: WorstCaseCondition | None = None
    ) -> None:
        self.sector, self.joints, self.condition = sector, joints, condition
        self.lowered = (0,) if condition is None else condition.lowered
        places, sets = sector.places(joints), sector.label_sets(joints)
        rows = [PermutedRows(labels, places, sector.spin) for labels in sets]
        self.rows = [entry for entry in rows if entry.length]

    @property
    def name(self) -> str:
        """The condition; of squares that of their space of functions."""
        if self.condition is not None:
            return self.condition.name
        return "sectors" if self.sector.odd is not None else "unsigned"

    @cached_property
    def blocks(self) -> list[AdaptedRows]:
        """The rows of each block."""
        return adapted_rows(self.rows, self.sector.charge)

    @cached_property
    def selections(self) -> list[Selection]:
        """Of each block, see `selection`."""
        return [self.selection(block) for block in self.blocks]

    @property
    def sizes(self) -> list[int]:
        """Numbers of rows of the blocks."""
        return [len(chosen) for chosen, _ in self.selections]

    def selection(self, block: AdaptedRows) -> Selection:
        """Return which scalar row, and which vector w_a, makes each row of a block."""
        columns = ((place, self.rows[number].labels) for number, place, _ in block.parts)
        return selection(columns, block.size, self.sector.degree, self.lowered)

    @property
    def largest_spin(self) -> int:
        """Largest spin of one joint."""
        return max((spin for rows in self.rows for spin in rows.spins), default=0)

    @property
    def cases(self) -> list[tuple[int | None, list[tuple[int, ...]]]]:
        """The joint that is locked, if any, and orders of the joints that put it first.

        Next is each choice of the joints with odd m.
        """
        found: list[tuple[int | None, list[tuple[int, ...]]]] = []
        for locked in [None] if self.sector.locked is None else range(self.joints):
            first = () if locked is None else (locked,)
            others = [joint for joint in range(self.joints) if joint != locked]
            orders = [
                (*first, *chosen, *(joint for joint in others if joint not in chosen))
                for chosen in combinations(others, self.sector.odd or 0)
            ]
            found.append((locked, orders))
        return found

    def evaluate(self, rotations: FloatArray) -> list[FloatArray]:
        """Return each block, (configurations, size, size), at (configurations, n, 3, 3)."""
        wigner = wigner_matrices(rotations, self.largest_spin)
        jacobian = EnclosedMatrix.jacobian(rotations)
        total = [np.zeros((len(rotations), size, size)) for size in self.sizes]
        for locked, orders in self.cases:
            squares = self._mean_squares(wigner, orders, share=len(self.cases))
            if self.condition is None:
                return squares
            values = self.condition.values(jacobian, locked).values
            for block, square, (chosen, a) in zip(total, squares, self.selections, strict=True):
                block += square[:, chosen[:, None], chosen] * values[:, a[:, None], a]
        return total

    def _mean_squares(
        self, wigner: Sequence[ComplexArray], orders: Sequence[Sequence[int]], share: int
    ) -> list[FloatArray]:
        """Return the mean of rows · rowsᵀ of each block over orders, components and tableaux.

        It is divided by `share`: the caller adds up so many means.
        """
        count = len(wigner[0])
        found = [np.zeros((count, block.size, block.size)) for block in self.blocks]
        for order in orders:
            plain = self.plain_values(wigner, order)
            for total, block in zip(found, self.blocks, strict=True):
                values = _adapted_values(block, plain)
                total += values @ values.transpose(0, 2, 1)
        for total, block in zip(found, self.blocks, strict=True):
            total /= share * len(orders) * (2 * self.sector.spin + 1) * block.tableaux
        return found

    def plain_values(
        self, wigner: Sequence[ComplexArray], order: Sequence[int]
    ) -> list[FloatArray]:
        """Return the values of all plain rows, see `_plain_rows`, joints in the given order."""
        return [_plain_rows(rows, wigner, order) for rows in self.rows]


def sector_families(
    sectors: Sequence[RowSector], joints: int, condition: WorstCaseCondition | None = None
) -> list[RowBlocks]:
    """Return the blocks of all sectors that have rows for `joints` joints."""
    families = (RowBlocks(sector, joints, condition) for sector in sectors)
    return [family for family in families if family.blocks]


def condition_families(
    sectors: Mapping[str, Sequence[RowSector]], joints: int, conditions: Conditions
) -> list[RowBlocks]:
    """Return the blocks of conditions by their names; of squares where there is none."""
    return [
        family
        for name, own in sectors.items()
        for family in sector_families(own, joints, conditions.get(name))
    ]


def selection(
    columns: Iterable[tuple[range, Sequence[Label]]],
    size: int,
    degree: int,
    lowered: tuple[int, ...],
) -> Selection:
    """Return which column of a block, and which vector w_a, makes each row of a localiser.

    What multiplies w_a has at most the `degree` less what it is `lowered` by.
    """
    degrees = np.zeros(size, dtype=int)
    for place, labels in columns:
        here = slice(place.start, place.stop)
        degrees[here] = np.maximum(degrees[here], sum(map(label_degree, labels)))
    allowed = [np.flatnonzero(degrees <= degree - less) for less in lowered]
    vectors = [np.full(len(chosen), a) for a, chosen in enumerate(allowed)]
    return np.concatenate(allowed), np.concatenate(vectors)


def _plain_rows(
    rows: PermutedRows, wigner: Sequence[ComplexArray], order: Sequence[int]
) -> FloatArray:
    """Return the values of plain rows, shape (rows, 2(2L+1), configurations), real parts first.

    order[q] is the joint at place q. Assignments with the same beginning share their first
    steps.
    """
    labels = rows.labels
    found: list[FloatArray] = []
    known: dict[Assignment, Coupled] = {(): {0: np.ones((1, 1, 1), dtype=wigner[0].dtype)}}
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
            spin, m = labels[q]
            factor = np.ascontiguousarray(wigner[spin][:, order[assignment[q]], :, spin + m].T)
            products = {
                before: values[:, :, None] * factor
                for before, values in known[assignment[:q]].items()
            }
            known[assignment[: q + 1]] = recoupled(products, spin, reachable)
        values = known[assignment][rows.spin]
        found.append(np.concatenate([values.real, values.imag], axis=1).astype(float))
    return np.concatenate(found)


def recoupled(products: Coupled, spin: int, reachable: range) -> Coupled:
    """Return products of spins l and `spin`, (ways, 2l+1, 2·spin+1, configurations), coupled.

    One array for each total spin that is `reachable`, in the order of `coupled_tensors`.
    """
    grown: dict[int, list[ComplexArray]] = {}
    for before, values in products.items():
        for target in range(abs(before - spin), before + spin + 1):
            if target in reachable:
                grown.setdefault(target, []).append(_coupled(values, target))
    return {target: np.concatenate(parts) for target, parts in grown.items()}


def _coupled(values: ComplexArray, target: int) -> ComplexArray:
    """Return the part of one spin of products, (ways, 2·target+1, configurations)."""
    ways, first, second, count = values.shape
    extended = values.dtype != complex
    table = coupling(first // 2, second // 2, target, extended=extended)
    if not extended:
        flat = np.ascontiguousarray(values.reshape(ways, -1, count)).view(float)
        return np.asarray((table.reshape(-1, 2 * target + 1).T @ flat).view(complex))
    found = np.zeros((ways, 2 * target + 1, count), dtype=values.dtype)
    for a, b, total in zip(*np.nonzero(table), strict=True):  # no fast product of matrices
        found[:, total] += table[a, b, total] * values[:, a, b]
    return found


def _adapted_values(block: AdaptedRows, plain: Sequence[FloatArray]) -> FloatArray:
    """Return the values of a block's rows, (configurations, size, tableaux · components)."""
    # Rows without any joint are the same at all configurations.
    count = max(values.shape[2] for values in plain)
    components = plain[0].shape[1]
    found = np.zeros((block.tableaux, block.size, components * count))
    for number, columns, coefficients in block.parts:
        values = np.tile(plain[number], (1, 1, count // plain[number].shape[2]))
        values = values.reshape(len(values), -1)
        found[:, columns.start : columns.stop] += coefficients.transpose(0, 2, 1) @ values
    shaped = found.reshape(block.tableaux, block.size, components, count)
    return shaped.transpose(3, 1, 0, 2).reshape(count, block.size, -1)
