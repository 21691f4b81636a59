"""Blocks that say that a principal submatrix of JᵀJ is at least tI: one joint is locked.

With n = 7 the matrix J_f without column f is square, so J_f J_fᵀ ⪰ tI and J_fᵀ J_f ⪰ tI say the
same; as conditions on pseudo-moments they do not. A row is a vector p_i(x) of polynomials, one
for each joint i ≠ f: a product of Wigner functions with one joint marked. Its block is that of
|Σ_i j_i p_i|² − t Σ_i |p_i|². Where a sign of column i turns, p_i turns too, so a marked joint
has m of the other parity than its group.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from formulations.bounds.so3_moments.adapted_rows import AdaptedRows, adapted_rows
from formulations.bounds.so3_moments.clebsch_gordan import Floats
from formulations.bounds.so3_moments.permuted_rows import PermutedRows
from formulations.bounds.so3_moments.row_sectors import (
    Label,
    label_degree,
    label_sets,
    labels_of_parity,
)
from formulations.bounds.so3_moments.sampled_blocks import (
    adapted_values,
    joint_factors,
    plain_rows,
)
from formulations.bounds.so3_moments.wigner import jacobians_of, wigner_matrices
from nlp.errors import InputError


@dataclass(frozen=True, order=True)
class GramSector:
    """Rows of a Gram localiser with one behaviour under all symmetries but permutations.

    Parameters
    ----------
    odd
        Number k of joints, the locked one not counted, whose sign changes j_i p_i.
    charge
        Sum c of all m, not negative.
    spin
        Total spin L.
    degree
        Largest degree of the polynomials p.
    locked
        Parity of m of the locked joint, 0 or 1.

    Raises
    ------
    InputError
        Unless k + parity + 1, the charge and the degree agree modulo 2.
    """

    odd: int
    charge: int
    spin: int
    degree: int
    locked: int

    def __post_init__(self) -> None:
        values = (self.odd, self.charge, self.spin, self.degree, self.locked)
        parity = (self.odd + self.locked + 1) % 2
        fits = self.degree % 2 == parity and self.charge % 2 == parity
        if min(values) < 0 or self.locked > 1 or not fits:
            raise InputError("Gram sector (k, c, L, e, parity)", values, "fitting parities")

    def plain_rows(self, joints: int) -> list[PermutedRows]:
        """Return the rows; places: locked joint, odd joints, even joints."""
        places = (range(1), range(1, 1 + self.odd), range(1 + self.odd, joints))
        heads: list[tuple[Label, ...]] = [()] if self.locked == 0 else []
        heads += [(label,) for label in labels_of_parity(self.locked, self.degree)]
        found = []
        for head in heads:
            for in_odd in (True, False):
                own: list[Label] = [(0, 0)] if in_odd else []
                own += labels_of_parity(0 if in_odd else 1, self.degree)
                for label in own:
                    found += self._with_mark(head, label, in_odd, joints, places)
        return [rows for rows in found if rows.length]

    def _with_mark(
        self,
        head: tuple[Label, ...],
        label: Label,
        in_odd: bool,
        joints: int,
        places: tuple[range, ...],
    ) -> list[PermutedRows]:
        used = (*head, label)
        left = self.degree - sum(map(label_degree, used))
        charge = self.charge - sum(entry[1] for entry in used)
        others = self.odd - 1 if in_odd else self.odd
        if left < 0 or others < 0:
            return []
        marked = ((*label, 1),)
        found = []
        # The marked joint is one of the joints that are not locked.
        for odd, even in label_sets(others, charge, left, joints - 2):
            first = tuple(sorted(odd + marked)) if in_odd else odd
            second = even if in_odd else tuple(sorted(even + marked))
            if len(second) <= len(places[2]):
                found.append(PermutedRows((head, first, second), places, self.spin))
        return found


def gram_sectors(degree: int, spins: range, charges: range) -> list[GramSector]:
    """Return the sectors of a degree and of the one below, for either parity."""
    return [
        GramSector(k, c, spin, top, parity)
        for top in (degree, degree - 1)
        for parity in (0, 1)
        for spin in spins
        for k in range(top + 2)
        for c in charges
        if (k + parity + 1 - top) % 2 == 0 and (c - top) % 2 == 0
    ]


class GramLocaliser:
    """Blocks of J_fᵀ J_f − tI, averaged over all symmetries and the locked joint.

    Parameters
    ----------
    sector
        The rows.
    joints
        Number n of joints.
    limit
        t.
    """

    def __init__(self, sector: GramSector, joints: int, limit: float = 0.0) -> None:
        self.sector = sector
        self.joints = joints
        self.limit = limit
        self.rows = sector.plain_rows(joints)
        self.blocks: list[AdaptedRows] = (
            adapted_rows(self.rows, sector.charge) if self.rows else []
        )

    @property
    def sizes(self) -> list[int]:
        """Numbers of rows of the blocks."""
        return [block.size for block in self.blocks]

    def evaluate(self, rotations: Floats) -> list[Floats]:
        """Return each block, (configurations, size, size), at (configurations, n, 3, 3)."""
        weighted, unit = self.parts(rotations)
        return [a - self.limit * b for a, b in zip(weighted, unit, strict=True)]

    def parts(self, rotations: Floats) -> tuple[list[Floats], list[Floats]]:
        """Return the blocks of |Σ j_i p_i|² and those of Σ |p_i|²."""
        count = len(rotations)
        largest = max(spin for rows in self.rows for spin in rows.spins)
        wigner = wigner_matrices(rotations, max(largest, 1))
        columns = jacobians_of(rotations).transpose(2, 0, 1)
        units = np.broadcast_to(
            np.eye(self.joints)[:, None, :], (self.joints, count, self.joints)
        )
        orders = self._orders()
        weighted = [np.zeros((count, block.size, block.size)) for block in self.blocks]
        unit = [np.zeros_like(block) for block in weighted]
        for order in orders:
            factors = joint_factors(wigner, order)
            plain = [plain_rows(rows, factors) for rows in self.rows]
            for found, vectors in ((weighted, columns), (unit, units)):
                values = [
                    _times_marked(rows, entry, vectors[list(order)])
                    for rows, entry in zip(self.rows, plain, strict=True)
                ]
                for total, block in zip(found, self.blocks, strict=True):
                    shaped = adapted_values(block, values)
                    total += shaped @ shaped.swapaxes(-1, -2)
        for a, b, block in zip(weighted, unit, self.blocks, strict=True):
            scale = len(orders) * (2 * self.sector.spin + 1) * block.tableaux
            a /= scale
            b /= scale
        return weighted, unit

    def _orders(self) -> list[tuple[int, ...]]:
        found = []
        for head in range(self.joints):
            others = [joint for joint in range(self.joints) if joint != head]
            for chosen in combinations(others, self.sector.odd):
                rest = tuple(joint for joint in others if joint not in chosen)
                found.append((head, *chosen, *rest))
        return found


def _times_marked(rows: PermutedRows, values: Floats, vectors: Floats) -> Floats:
    """Return the rows times the vector of the marked joint, (rows, configurations, …).

    `vectors` holds one for each joint and configuration, (joints, configurations, size).
    """
    place = next(q for q, label in enumerate(rows.labels) if len(label) == 3)
    joints = [assignment[place] for assignment in rows.assignments]
    shaped = values.reshape(len(joints), rows.ways, -1, 1, values.shape[2])
    product = shaped * vectors[joints][:, None, :, :, None]
    return product.reshape(rows.length, vectors.shape[1], -1)
