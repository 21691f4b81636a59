"""Localisers: blocks that are positive semidefinite only where a condition holds.

`ScaledBlocks` multiplies blocks by a scalar that must not be negative. `KrylovLocaliser` states
wᵀ(J_f J_fᵀ − tI)w ≥ 0 for vectors w = r_0 j_f + r_1 M j_f + r_2 M² j_f with M = JJᵀ.
Where a worst case t is reached with joint f locked, the eigenvector is (M − tI)⁻¹j_f, and M is
close to a multiple of I; so few powers of M approximate it. The polynomials r_k(x) depend on
which joint is locked; their degree falls by two with each power. Compared with vectors w of
arbitrary polynomials there are far fewer rows: blocks of scalar rows are multiplied by the
numbers j_fᵀ M^k (J_f J_fᵀ − tI) M^l j_f.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from formulations.bounds.so3_moments.blocks.sampled_blocks import (
    BlockFamily,
    RowBlocks,
    choices_first,
)
from formulations.bounds.so3_moments.representations.adapted_rows import AdaptedRows
from formulations.bounds.so3_moments.representations.row_sectors import (
    Label,
    RowSector,
    degree_sectors,
    label_degree,
)
from formulations.bounds.so3_moments.representations.wigner import jacobians_of, wigner_matrices
from nlp.arrays import FloatArray
from nlp.errors import InputError

POWERS = 3
# Columns of a block, and a power of M for each.
Selection: TypeAlias = tuple[NDArray[np.intp], NDArray[np.intp]]


@dataclass(frozen=True, eq=False)
class ScaledBlocks:
    """A scalar localiser: g(x)B(x) ⪰ 0 where g(x) ≥ 0.

    Parameters
    ----------
    family
        The blocks B.
    factor
        Values of g at rotations (configurations, n, 3, 3).
    """

    family: BlockFamily
    factor: Callable[[FloatArray], FloatArray]

    @property
    def sizes(self) -> list[int]:
        """Numbers of rows of the blocks."""
        return self.family.sizes

    def evaluate(self, rotations: FloatArray) -> list[FloatArray]:
        """Return each block, (configurations, size, size), at (configurations, n, 3, 3)."""
        factor = self.factor(rotations)[:, None, None]
        return [factor * block for block in self.family.evaluate(rotations)]


def krylov_sectors(degree: int, spins: range, charges: range) -> list[RowSector]:
    """Return the sectors of a degree and of the one below, for either parity."""
    return [
        sector
        for top in (degree, degree - 1)
        for parity in (0, 1)
        for sector in degree_sectors(top, spins, charges, parity)
    ]


class KrylovLocaliser(RowBlocks):
    """Blocks of J_f J_fᵀ − tI on Krylov vectors, averaged over symmetries and locked joints.

    Parameters
    ----------
    sector
        The polynomials r_k, with a locked joint; the degree of r_k is lower by 2k than that
        of the sector.
    joints
        Number n of joints.
    limit
        t.
    """

    def __init__(self, sector: RowSector, joints: int, limit: float = 0.0) -> None:
        if sector.locked is None:
            raise InputError("sector", sector, "one with a locked joint")
        super().__init__(sector, joints)
        self.limit = limit

    @cached_property
    def selections(self) -> list[Selection]:
        """Of each block, see `selection`."""
        return [self.selection(block) for block in self.blocks]

    @property
    def sizes(self) -> list[int]:
        """Numbers of rows of the blocks."""
        return [len(chosen) for chosen, _ in self.selections]

    def evaluate(self, rotations: FloatArray) -> list[FloatArray]:
        """Return each block, (configurations, size, size), at (configurations, n, 3, 3)."""
        weighted, unit = self.parts(rotations)
        return [a - self.limit * b for a, b in zip(weighted, unit, strict=True)]

    def parts(self, rotations: FloatArray) -> tuple[list[FloatArray], list[FloatArray]]:
        """Return the blocks of J_f J_fᵀ and those of I."""
        wigner = wigner_matrices(rotations, self.largest_spin)
        jacobians = jacobians_of(rotations)
        weighted = [np.zeros((len(rotations), size, size)) for size in self.sizes]
        unit = [np.zeros_like(block) for block in weighted]
        for locked in range(self.joints):
            vectors, kept = krylov_vectors(jacobians, locked)
            grams = kept.swapaxes(1, 2) @ kept, vectors.swapaxes(1, 2) @ vectors
            squares = self.mean_squares(wigner, self.orders(locked), share=self.joints)
            for number, (chosen, powers) in enumerate(self.selections):
                found = squares[number][:, chosen[:, None], chosen]
                weighted[number] += found * grams[0][:, powers[:, None], powers]
                unit[number] += found * grams[1][:, powers[:, None], powers]
        return weighted, unit

    def orders(self, locked: int) -> list[tuple[int, ...]]:
        """Return orders of the joints that put the locked one and each choice of k first."""
        others = [joint for joint in range(self.joints) if joint != locked]
        return [(locked, *order) for order in choices_first(others, self.sector.odd)]

    def selection(self, block: AdaptedRows) -> Selection:
        """Return which scalar row, and which power of M, makes each row of a block."""
        columns = ((place, self.rows[number].labels) for number, place, _ in block.parts)
        return krylov_selection(columns, block.size, self.sector.degree)


def krylov_selection(
    columns: Iterable[tuple[range, Sequence[Label]]], size: int, degree: int
) -> Selection:
    """Return which column of a block, and which power of M, makes each row of a localiser.

    Parameters
    ----------
    columns
        Columns of the block, and the labels of rows that contribute to them.
    size
        Number of columns.
    degree
        Largest degree d of r_0; that of r_k is at most d − 2k.
    """
    degrees = np.zeros(size, dtype=int)
    for place, labels in columns:
        here = slice(place.start, place.stop)
        degrees[here] = np.maximum(degrees[here], sum(map(label_degree, labels)))
    allowed = [np.flatnonzero(degrees <= degree - 2 * k) for k in range(POWERS)]
    powers = [np.full(len(chosen), k) for k, chosen in enumerate(allowed)]
    return np.concatenate(allowed), np.concatenate(powers)


def krylov_vectors(jacobians: FloatArray, locked: int) -> tuple[FloatArray, FloatArray]:
    """Return V = (j_f, M j_f, M² j_f) in units of the mean, and J_fᵀV.

    j_f is in units of √2, M in units of n/3. In the precision of the Jacobians, shapes
    (configurations, 6, powers) and (configurations, n − 1, powers).
    """
    real = jacobians.dtype.type
    mean = real(jacobians.shape[2]) / 3
    vector = jacobians[:, :, locked] / np.sqrt(real(2))
    found = [vector]
    for _ in range(1, POWERS):
        turned = (jacobians.swapaxes(1, 2) @ vector[..., None]) / mean
        vector = (jacobians @ turned)[..., 0]
        found.append(vector)
    vectors = np.stack(found, axis=-1)
    return vectors, np.delete(jacobians, locked, axis=2).swapaxes(1, 2) @ vectors
