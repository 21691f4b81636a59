"""Blocks that say that a matrix of the form Σ j_i j_iᵀ − sI is positive semidefinite.

A row is a vector w(x) of six polynomials: a product of Wigner functions coupled with one
further spin 1 of charge ±1, the slot, which stands for the six directions (v and ω as v ± iω).
The block of wᵀ(Σ j_i j_iᵀ − sI)w is a sum over i of products of rows with joint i in the slot,
minus s times one with unit vectors in the slot. One joint may be locked: left out of the sum
and treated apart from the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from formulations.bounds.so3_moments.blocks.sampled_blocks import (
    Complex,
    Factors,
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
from formulations.bounds.so3_moments.representations.wigner import wigner_matrices
from nlp.errors import InputError


@dataclass(frozen=True, order=True)
class LocaliserSector:
    """Rows of a matrix localiser with one behaviour under all symmetries but permutations.

    Parameters
    ----------
    odd
        Number k of joints with odd m, a locked joint not counted.
    charge
        Sum c of all m and of the slot's ±1, not negative.
    spin
        Total spin L.
    degree
        Largest degree of the polynomials.
    locked
        Parity of m of the locked joint, 0 or 1; None if no joint is locked.

    Raises
    ------
    InputError
        Unless the degree has the parity of the odd joints and the charge the other one.
    """

    odd: int
    charge: int
    spin: int
    degree: int
    locked: int | None

    def __post_init__(self) -> None:
        values = (self.odd, self.charge, self.spin, self.degree, self.locked)
        parity = self.odd + (self.locked or 0)
        fits = (parity - self.degree) % 2 == 0 and (parity - self.charge) % 2 == 1
        if min(values[:4]) < 0 or self.locked not in (None, 0, 1) or not fits:
            raise InputError(
                "localiser sector (k, c, L, e, parity)", values, "fitting parities"
            )

    def plain_rows(self, joints: int) -> list[PermutedRows]:
        """Return the rows; places: locked joint, odd joints, even joints, slot."""
        first = 0 if self.locked is None else 1
        places = (
            range(first),
            range(first, first + self.odd),
            range(first + self.odd, joints),
            range(joints, joints + 1),
        )
        heads: list[tuple[Label, ...]] = [()] if self.locked != 1 else []
        if self.locked is not None:
            heads += [(label,) for label in labels_of_parity(self.locked, self.degree)]
        found = []
        for head in heads:
            left = self.degree - sum(map(label_degree, head))
            for q in (-1, 1):
                charge = self.charge - q - sum(label[1] for label in head)
                found += [
                    PermutedRows((head, odd, even, ((1, q),)), places, self.spin)
                    for odd, even in label_sets(self.odd, charge, left, joints - first)
                ]
        return [rows for rows in found if rows.length]


def localiser_sectors(
    degree: int, spins: range, charges: range, *, locked: bool
) -> list[LocaliserSector]:
    """Return the sectors of the given degree, total spins and charges, of either parity."""
    return [
        LocaliserSector(k, c, spin, top, parity)
        for top in (degree, degree - 1)
        for parity in ((0, 1) if locked else (None,))
        for spin in spins
        for k in range(top + 1)
        for c in charges
        if (k + (parity or 0) - top) % 2 == 0 and (c - top) % 2 == 1
    ]


class MatrixLocaliser:
    """Blocks of ±(Σ j_i j_iᵀ − sI) for one or more s.

    Parameters
    ----------
    sector
        The rows; if they have a locked joint it is left out of the sum.
    joints
        Number n of joints.
    forms
        Pairs (sign, s); each gives its own blocks.
    """

    def __init__(
        self, sector: LocaliserSector, joints: int, forms: tuple[tuple[int, float], ...]
    ) -> None:
        self.sector = sector
        self.joints = joints
        self.forms = forms
        self.rows = sector.plain_rows(joints)
        self.blocks: list[AdaptedRows] = (
            adapted_rows(self.rows, sector.charge) if self.rows else []
        )

    @property
    def sizes(self) -> list[int]:
        """Numbers of rows of the blocks, form by form."""
        return [block.size for _ in self.forms for block in self.blocks]

    def evaluate(self, rotations: Floats) -> list[Floats]:
        """Return each block, (configurations, size, size), at (configurations, n, 3, 3)."""
        weighted, plain = self.parts(rotations)
        return [
            sign * (a - shift * b)
            for sign, shift in self.forms
            for a, b in zip(weighted, plain, strict=True)
        ]

    def parts(self, rotations: Floats) -> tuple[list[Floats], list[Floats]]:
        """Return the blocks of Σ j_i j_iᵀ and those of I."""
        count = len(rotations)
        spins = [spin for rows in self.rows for spin in rows.spins]
        wigner = wigner_matrices(rotations, max(spins))
        orders = list(self._orders())
        weighted = [np.zeros((count, block.size, block.size)) for block in self.blocks]
        unit = [np.zeros_like(block) for block in weighted]
        for order in orders:
            moving = order if self.sector.locked is None else order[1:]
            factors = self._with_slot(joint_factors(wigner, order), wigner[1][:, list(moving)])
            values = [plain_rows(rows, factors) for rows in self.rows]
            for a, b, block in zip(weighted, unit, self.blocks, strict=True):
                shaped = adapted_values(block, values)
                shaped = shaped.reshape(-1, count, *shaped.shape[1:])
                squares = shaped @ shaped.swapaxes(-1, -2)
                a += squares[: len(moving)].sum(axis=0)
                b += squares[len(moving) :].sum(axis=0)
        for a, b, block in zip(weighted, unit, self.blocks, strict=True):
            # The 3 makes the mean of the block of I the unit matrix.
            scale = 3 * len(orders) * (2 * self.sector.spin + 1) * block.tableaux
            a /= scale
            b /= scale
        return weighted, unit

    def _orders(self) -> list[tuple[int, ...]]:
        everyone = range(self.joints)
        heads: list[tuple[int, ...]] = [()]
        if self.sector.locked is not None:
            heads = [(joint,) for joint in everyone]
        found = []
        for head in heads:
            others = [joint for joint in everyone if joint not in head]
            for chosen in combinations(others, self.sector.odd):
                rest = tuple(joint for joint in others if joint not in chosen)
                found.append((*head, *chosen, *rest))
        return found

    def _with_slot(self, factors: Factors, moving: Complex) -> Factors:
        """Return the factors with, in the slot, each moving joint and then each unit vector.

        `moving` holds D^1 of the joints of the sum, (configurations, joints, 3, 3).
        """
        count = len(moving)
        units = np.broadcast_to(np.eye(3, dtype=complex)[:, None, :], (3, count, 3))
        nothing = np.zeros_like(units)

        def extended(label: Label, place: int) -> Complex:
            if place < self.joints:
                return factors(label, place)
            columns = moving[..., 1 + label[1]].swapaxes(0, 1)
            # A unit vector belongs to one of the charges of the slot.
            six = (units, nothing) if label[1] > 0 else (nothing, units)
            return np.concatenate([columns, *six]).reshape(-1, 3)

        return extended
