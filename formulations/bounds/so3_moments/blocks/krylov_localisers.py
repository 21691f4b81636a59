"""Blocks that say wᵀ(J_f J_fᵀ − tI)w ≥ 0 for vectors w = r_0 j_f + r_1 M j_f + r_2 M² j_f.

Where a worst case t is reached with joint f locked, the eigenvector is (M − tI)⁻¹j_f with
M = JJᵀ, and M is close to a multiple of I; so few powers of M come close to it. The polynomials
r_k(x) know which joint is locked; their degree falls by two with each power. Compared with
`matrix_localisers`, where w may be any vector of polynomials, there are fewer rows by far, and
no slot: blocks of scalar rows are multiplied by the numbers j_fᵀ M^k (J_f J_fᵀ − tI) M^l j_f.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from formulations.bounds.so3_moments.blocks.sampled_blocks import (
    adapted_values,
    joint_factors,
    plain_rows,
)
from formulations.bounds.so3_moments.representations.adapted_rows import (
    AdaptedRows,
    adapted_rows,
)
from formulations.bounds.so3_moments.representations.clebsch_gordan import Floats
from formulations.bounds.so3_moments.representations.permuted_rows import PermutedRows
from formulations.bounds.so3_moments.representations.row_sectors import (
    Label,
    label_degree,
    label_sets,
    labels_of_parity,
)
from formulations.bounds.so3_moments.representations.wigner import jacobians_of, wigner_matrices
from nlp.errors import InputError

POWERS = 3


@dataclass(frozen=True, order=True)
class KrylovSector:
    """Polynomials r_k with one behaviour under all symmetries but permutations.

    Parameters
    ----------
    odd
        Number k of joints with odd m, the locked one not counted.
    charge
        Sum c of all m, not negative.
    spin
        Total spin L.
    degree
        Largest degree of r_0; that of r_k is lower by 2k.
    locked
        Parity of m of the locked joint, 0 or 1.

    Raises
    ------
    InputError
        Unless k + parity, the charge and the degree agree modulo 2.
    """

    odd: int
    charge: int
    spin: int
    degree: int
    locked: int

    def __post_init__(self) -> None:
        values = (self.odd, self.charge, self.spin, self.degree, self.locked)
        parity = (self.odd + self.locked) % 2
        fits = self.degree % 2 == parity and self.charge % 2 == parity
        if min(values) < 0 or self.locked > 1 or not fits:
            raise InputError("Krylov sector (k, c, L, d, parity)", values, "fitting parities")

    def plain_rows(self, joints: int) -> list[PermutedRows]:
        """Return the rows; places: locked joint, odd joints, even joints."""
        places = (range(1), range(1, 1 + self.odd), range(1 + self.odd, joints))
        heads: list[tuple[Label, ...]] = [()] if self.locked == 0 else []
        heads += [(label,) for label in labels_of_parity(self.locked, self.degree)]
        found = []
        for head in heads:
            left = self.degree - sum(map(label_degree, head))
            charge = self.charge - sum(label[1] for label in head)
            found += [
                PermutedRows((head, odd, even), places, self.spin)
                for odd, even in label_sets(self.odd, charge, left, joints - 1)
            ]
        return [rows for rows in found if rows.length]


def krylov_sectors(degree: int, spins: range, charges: range) -> list[KrylovSector]:
    """Return the sectors of a degree and of the one below, for either parity."""
    return [
        KrylovSector(k, c, spin, top, parity)
        for top in (degree, degree - 1)
        for parity in (0, 1)
        for spin in spins
        for k in range(top + 1)
        for c in charges
        if (k + parity - top) % 2 == 0 and (c - top) % 2 == 0
    ]


class KrylovLocaliser:
    """Blocks of J_f J_fᵀ − tI on Krylov vectors, averaged over symmetries and locked joints.

    Parameters
    ----------
    sector
        The polynomials.
    joints
        Number n of joints.
    limit
        t.
    """

    def __init__(self, sector: KrylovSector, joints: int, limit: float = 0.0) -> None:
        self.sector = sector
        self.joints = joints
        self.limit = limit
        self.rows = sector.plain_rows(joints)
        self.blocks: list[AdaptedRows] = (
            adapted_rows(self.rows, sector.charge) if self.rows else []
        )
        self.selections = [self._selection(block) for block in self.blocks]

    @property
    def sizes(self) -> list[int]:
        """Numbers of rows of the blocks."""
        return [len(chosen) for chosen, _ in self.selections]

    @property
    def largest_spin(self) -> int:
        """Largest spin of one joint."""
        return max((spin for rows in self.rows for spin in rows.spins), default=0)

    def evaluate(self, rotations: Floats) -> list[Floats]:
        """Return each block, (configurations, size, size), at (configurations, n, 3, 3)."""
        weighted, unit = self.parts(rotations)
        return [a - self.limit * b for a, b in zip(weighted, unit, strict=True)]

    def parts(self, rotations: Floats) -> tuple[list[Floats], list[Floats]]:
        """Return the blocks of J_f J_fᵀ and those of I."""
        count = len(rotations)
        wigner = wigner_matrices(rotations, self.largest_spin)
        jacobians = jacobians_of(rotations)
        weighted = [np.zeros((count, size, size)) for size in self.sizes]
        unit = [np.zeros_like(block) for block in weighted]
        for locked in range(self.joints):
            vectors = krylov_vectors(jacobians, locked)
            kept = np.delete(jacobians, locked, axis=2).swapaxes(1, 2) @ vectors
            grams = kept.swapaxes(1, 2) @ kept, vectors.swapaxes(1, 2) @ vectors
            squares = [np.zeros((count, block.size, block.size)) for block in self.blocks]
            orders = self._orders(locked)
            for order in orders:
                factors = joint_factors(wigner, order)
                plain = [plain_rows(rows, factors) for rows in self.rows]
                for total, block in zip(squares, self.blocks, strict=True):
                    values = adapted_values(block, plain)
                    total += values @ values.transpose(0, 2, 1)
            for number, block in enumerate(self.blocks):
                scale = self.joints * len(orders) * (2 * self.sector.spin + 1) * block.tableaux
                chosen, powers = self.selections[number]
                found = squares[number][:, chosen[:, None], chosen] / scale
                weighted[number] += found * grams[0][:, powers[:, None], powers]
                unit[number] += found * grams[1][:, powers[:, None], powers]
        return weighted, unit

    def _selection(self, block: AdaptedRows) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return which scalar row, and which power of M, makes each row of a block."""
        degrees = np.zeros(block.size, dtype=int)
        for number, columns, _ in block.parts:
            degree = sum(map(label_degree, self.rows[number].labels))
            degrees[columns.start : columns.stop] = degree
        allowed = [np.flatnonzero(degrees <= self.sector.degree - 2 * k) for k in range(POWERS)]
        powers = [np.full(len(chosen), k) for k, chosen in enumerate(allowed)]
        return np.concatenate(allowed), np.concatenate(powers)

    def _orders(self, locked: int) -> list[tuple[int, ...]]:
        others = [joint for joint in range(self.joints) if joint != locked]
        return [
            (locked, *chosen, *(joint for joint in others if joint not in chosen))
            for chosen in combinations(others, self.sector.odd)
        ]


def krylov_vectors(jacobians: Floats, locked: int) -> Floats:
    """Return j_f, M j_f, M² j_f in units of the mean, (configurations, 6, powers).

    j_f is in units of √2, M in units of n/3.
    """
    joints = jacobians.shape[2]
    vector = jacobians[:, :, locked] / np.sqrt(2)
    found = [vector]
    for _ in range(1, POWERS):
        turned = (jacobians.swapaxes(1, 2) @ vector[..., None]) / (joints / 3)
        vector = (jacobians @ turned)[..., 0]
        found.append(vector)
    return np.stack(found, axis=-1)
