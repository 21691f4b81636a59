"""Blocks of the moment matrix, averaged over all symmetries, at configurations.

A row φ is a function of n rotations: a product of Wigner functions, coupled to a total spin. A
block of squares is the average of φφᵀ over all symmetries:

- rotations of the frame: a sum over the components of the total spin;
- the phase and the signs of the columns: rows of different sectors are not mixed;
- conjugation: the real part, and two blocks, even and odd, where the charge is 0;
- the order of the joints: a sum over which joints have an odd m, and over tableaux.

A block of a condition H (`conditions`) has the rows φw_a, with the vectors w_a on which H acts.
Its entries are averages of φ_i φ_j H_ab. So it is positive semidefinite where H is.
docs/bounds.md, sections 2 and 4.

Each word is defined in the module that is named here:

- charge, spin, odd, m, label set: `row_sectors`;
- plain rows: `plain_rows`, and their values `plain_values`;
- tableaux: `tableaux`.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from itertools import combinations
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from lockedjoint.formulations.bounds.moments.conditions import (
    Conditions,
    WorstCaseCondition,
)
from lockedjoint.formulations.bounds.moments.enclosed_matrix import EnclosedMatrix
from lockedjoint.formulations.bounds.moments.plain_rows import PlainRows
from lockedjoint.formulations.bounds.moments.plain_values import plain_values
from lockedjoint.formulations.bounds.moments.row_sectors import Label, RowSector, label_degree
from lockedjoint.formulations.bounds.moments.symmetric_rows import AdaptedRows, adapted_rows
from lockedjoint.formulations.bounds.moments.wigner import ComplexArray, wigner_matrices
from lockedjoint.nlp.arrays import FloatArray

#: Order of the joints: the joint at each place.
JointOrder: TypeAlias = tuple[int, ...]


class Selection(NamedTuple):
    """Which scalar row φ, and which vector w_a, makes each row of a block.

    Attributes
    ----------
    rows
        Number of the scalar row, shape (size,).
    vectors
        Number a of the vector, shape (size,).
    """

    rows: NDArray[np.intp]
    vectors: NDArray[np.intp]


class LockedCase(NamedTuple):
    """One choice of the locked joint, with the orders of the joints to be averaged over."""

    #: Number of the locked joint, from 0; None if none is locked.
    locked: int | None
    #: The orders: each has the locked joint first, then the joints with odd m, then the others.
    orders: list[JointOrder]


class BlockFamily:
    """All blocks of one sector for n joints: of squares, or of a condition.

    Parameters
    ----------
    sector
        The sector of the scalar rows.
    joints
        n.
    condition
        The condition, None for squares. Of scalar rows that multiply a vector w_a the degree is
        lower, by `WorstCaseCondition.lowered`.
    """

    def __init__(
        self, sector: RowSector, joints: int, condition: WorstCaseCondition | None = None
    ) -> None:
        self.sector = sector
        self.joints = joints
        self.condition = condition
        self.lowered = (0,) if condition is None else condition.lowered
        groups = sector.groups(joints)
        plain = (PlainRows(labels, groups, sector.spin) for labels in sector.label_sets(joints))
        #: Plain rows by label sets, those that cannot be coupled to the total spin left out.
        self.rows = [rows for rows in plain if rows.length]

    @property
    def name(self) -> str:
        """Name of the condition; of squares, of their space of functions."""
        if self.condition is not None:
            return self.condition.name
        return "sectors" if self.sector.odd is not None else "unsigned"

    @cached_property
    def blocks(self) -> list[AdaptedRows]:
        """The scalar rows of each block.

        Without a condition the mean of the block over uniform rotations is the unit matrix.
        """
        return adapted_rows(self.rows, self.sector.charge)

    @cached_property
    def selections(self) -> list[Selection]:
        """The `selection` of each block."""
        return [self.selection(block) for block in self.blocks]

    @property
    def sizes(self) -> list[int]:
        """Number of rows of each block."""
        return [len(selected.rows) for selected in self.selections]

    def selection(self, block: AdaptedRows) -> Selection:
        """Return which scalar row, and which vector, makes each row of a block."""
        columns = ((part.columns, self.rows[part.label_set].labels) for part in block.parts)
        return selection(columns, block.size, self.sector.degree, self.lowered)

    @property
    def largest_spin(self) -> int:
        """Largest spin of one joint."""
        return max((spin for rows in self.rows for spin in rows.spins), default=0)

    @property
    def cases(self) -> list[LockedCase]:
        """Each choice of the locked joint, if one is locked, and of the joints with odd m.

        An order has the locked joint first, then those with odd m.
        """
        cases = []
        for locked in [None] if self.sector.locked is None else range(self.joints):
            first = () if locked is None else (locked,)
            others = [joint for joint in range(self.joints) if joint != locked]
            orders = [
                (*first, *odd, *(joint for joint in others if joint not in odd))
                for odd in combinations(others, self.sector.odd or 0)
            ]
            cases.append(LockedCase(locked, orders))
        return cases

    def evaluate(self, rotations: FloatArray) -> list[FloatArray]:
        """Return the values of each block, shape (configurations, size, size).

        Parameters
        ----------
        rotations
            The configurations, shape (configurations, n, 3, 3).
        """
        wigner = wigner_matrices(rotations, self.largest_spin)
        if self.condition is None:
            return self._mean_squares(wigner, self.cases[0])
        jacobian = EnclosedMatrix.jacobian(rotations)
        blocks = [np.zeros((len(rotations), size, size)) for size in self.sizes]
        for case in self.cases:
            squares = self._mean_squares(wigner, case)
            matrix = self.condition.values(jacobian, case.locked).values
            for block, square, selected in zip(blocks, squares, self.selections, strict=True):
                i, a = selected
                block += square[:, i[:, None], i] * matrix[:, a[:, None], a]
        return blocks

    def _mean_squares(
        self, wigner: Sequence[ComplexArray], case: LockedCase
    ) -> list[FloatArray]:
        """Return one case's share of the average of φφᵀ, for each block.

        Parameters
        ----------
        wigner
            D^0, D^1, …, each of shape (configurations, n, 2l + 1, 2l + 1).
        case
            The locked joint and the orders of the joints.

        Returns
        -------
        list
            The share of each block, shape (configurations, size, size).
        """
        configurations = len(wigner[0])
        sums = [np.zeros((configurations, block.size, block.size)) for block in self.blocks]
        for order in case.orders:
            plain = self.plain_values(wigner, order)
            for total, block in zip(sums, self.blocks, strict=True):
                values = _adapted_values(block, plain)
                total += values @ values.transpose(0, 2, 1)
        # The averages are over the locked joints, the orders of the joints with odd m, and the
        # components of the total spin; the last one is over the tableaux of the block.
        terms = len(self.cases) * len(case.orders) * (2 * self.sector.spin + 1)
        for total, block in zip(sums, self.blocks, strict=True):
            total /= terms * block.tableaux
        return sums

    def plain_values(
        self, wigner: Sequence[ComplexArray], order: Sequence[int]
    ) -> list[FloatArray]:
        """Return the values of the plain rows of each label set, see `plain_values`.

        Parameters
        ----------
        wigner
            D^0, D^1, …, each of shape (configurations, n, 2l + 1, 2l + 1).
        order
            The joint at each place.

        Returns
        -------
        list
            The values of each label set, shape (rows, 2(2L + 1), configurations); constants
            have one configuration.
        """
        return [plain_values(rows, wigner, order) for rows in self.rows]


def sector_families(
    sectors: Sequence[RowSector], joints: int, condition: WorstCaseCondition | None = None
) -> list[BlockFamily]:
    """Return the blocks of all sectors that have rows for `joints` joints."""
    families = (BlockFamily(sector, joints, condition) for sector in sectors)
    return [family for family in families if family.blocks]


def condition_families(
    sectors: Mapping[str, Sequence[RowSector]], joints: int, conditions: Conditions
) -> list[BlockFamily]:
    """Return the blocks of the sectors of each name: of its condition, or else of squares."""
    families = []
    for name, chosen in sectors.items():
        families += sector_families(chosen, joints, conditions.get(name))
    return families


def selection(
    columns: Iterable[tuple[range, Sequence[Label]]],
    size: int,
    degree: int,
    lowered: tuple[int, ...],
) -> Selection:
    """Return which scalar row of a block, and which vector w_a, makes each row of a condition.

    Parameters
    ----------
    columns
        Places of scalar rows in the block, and their labels, whose degrees add up.
    size
        Number of scalar rows.
    degree
        Largest degree of a scalar row.
    lowered
        How much lower the largest degree is of those that multiply w_a, for each a.
    """
    degrees = np.zeros(size, dtype=int)
    for place, labels in columns:
        here = slice(place.start, place.stop)
        degrees[here] = np.maximum(degrees[here], sum(map(label_degree, labels)))
    allowed = [np.flatnonzero(degrees <= degree - less) for less in lowered]
    vectors = [np.full(len(rows), a) for a, rows in enumerate(allowed)]
    return Selection(np.concatenate(allowed), np.concatenate(vectors))


def _adapted_values(block: AdaptedRows, plain: Sequence[FloatArray]) -> FloatArray:
    """Return the values of a block's rows, shape (configurations, size, tableaux · components).

    `plain` has the values of each label set, shape (rows, components, configurations), where
    there are 2(2L + 1) components.
    """
    # Plain rows without any joint are constants, with one value for all configurations.
    configurations = max(values.shape[2] for values in plain)
    components = plain[0].shape[1]
    sums = np.zeros((block.tableaux, block.size, components * configurations))
    for part in block.parts:
        values = plain[part.label_set]
        values = np.tile(values, (1, 1, configurations // values.shape[2]))
        values = values.reshape(len(values), -1)
        here = slice(part.columns.start, part.columns.stop)
        sums[:, here] += part.coefficients.transpose(0, 2, 1) @ values
    shaped = sums.reshape(block.tableaux, block.size, components, configurations)
    return shaped.transpose(3, 1, 0, 2).reshape(configurations, block.size, -1)
