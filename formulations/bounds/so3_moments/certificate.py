"""The certificate of a rigorous bound: a file with its sum of squares.

A block is given by columns of projectors, for each set of labels, and by a factor L of its
multiplier. The bases of the search come from eigenvectors, whose signs and order differ
between machines. The projector P on the rows that belong to the first tableau does not; so the
file names plain rows i, and U has the columns P e_i. What is proved holds for every L and every
choice of rows: L need not come from a solver. See `verification`.

Matrices are doubles, little-endian, row after row, in base64. Whatever is not exactly in the
format is refused, and sizes are limited before anything of that size is built.
"""

import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Any, Literal, TypeAlias

import numpy as np
import scipy.linalg

from formulations.bounds.so3_moments.blocks.localisers import (
    POWERS,
    KrylovLocaliser,
    krylov_selection,
)
from formulations.bounds.so3_moments.blocks.sampled_blocks import RowBlocks
from formulations.bounds.so3_moments.representations.adapted_rows import AdaptedRows
from formulations.bounds.so3_moments.representations.row_sectors import Label, RowSector
from formulations.bounds.so3_moments.representations.young_basis import Shapes, first_tableau
from nlp.arrays import FloatArray
from nlp.errors import InputError

FORMAT = "lockedjoint bound 2"
# Singular values of bases below this, relative, are 0.
_RANK = 1e-6
# Smaller entries are 0, so that no product underflows.
_SMALLEST = 1e-30
# The keys of a sector, but for ``locked``, and those that the quantity max-min adds.
SECTOR = ("odd", "charge", "spin", "degree")
EXCLUSION = ("excluded", "scaled", "krylov")

# What a certificate can bound.
CertifiedQuantity: TypeAlias = Literal["residual", "max-min"]


@dataclass(frozen=True, eq=False)
class BlockRows:
    """The rows of a block with one set of labels, in the first tableau.

    Parameters
    ----------
    labels
        The labels of each group of joints.
    pivots
        Numbers i of plain rows: the columns of U are P e_i.
    """

    labels: tuple[tuple[Label, ...], ...]
    pivots: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class BlockSquares:
    """The squares of one block, or those that multiply a localiser.

    Parameters
    ----------
    shapes
        Shapes of the permutations of the joints in each group.
    rows
        The rows, for each set of labels.
    factor
        L, shape (columns of all U, squares), one U after another. Of Krylov vectors: first
        for r_0 all columns, then for r_1 and r_2 those of low enough degree, see
        `krylov_selection`.
    """

    shapes: Shapes
    rows: tuple[BlockRows, ...]
    factor: FloatArray

    @property
    def columns(self) -> list[range]:
        """Numbers of the columns of each U among all of them."""
        return _ranges(self.rows)

    @property
    def size(self) -> int:
        """Number of columns of all U."""
        return self.columns[-1].stop


SectorSquares: TypeAlias = tuple[RowSector, tuple[BlockSquares, ...]]


@dataclass(frozen=True, eq=False)
class BoundCertificate:
    """A sum of squares, and of localisers, that proves a bound.

    Parameters
    ----------
    quantity
        What is bounded. ``"residual"``: ρ = ½‖JJᵀ − (n/3)I‖_F², from below. ``"max-min"``:
        the worst case σ after one locked joint, eq. (5), from above.
    joints
        Number n of unit revolute joints.
    bound
        The bound that is claimed.
    constant
        b, such that ρ − b is the sum of squares but for rounding; for max-min −b is the sum of
        squares and localisers, which cannot be where all of them are ≥ 0.
    sectors
        The squares of each sector.
    excluded
        The squared worst case t that is excluded; None for the residual.
    scaled
        Squares that are multiplied by (ρ_max(t) − ρ)/(5n/3).
    krylov
        Squares that multiply J_f J_fᵀ − tI on Krylov vectors.
    """

    quantity: CertifiedQuantity
    joints: int
    bound: float
    constant: float
    sectors: tuple[SectorSquares, ...]
    excluded: float | None = None
    scaled: tuple[SectorSquares, ...] = ()
    krylov: tuple[SectorSquares, ...] = ()

    def to_json(self) -> str:
        """Return the text of the file."""
        held: dict[str, Any] = {"sectors": _sectors_fields(self.sectors)}
        if self.excluded is not None:
            held["excluded"] = self.excluded
            held["scaled"] = _sectors_fields(self.scaled)
            held["krylov"] = _sectors_fields(self.krylov)
        head = {"quantity": self.quantity, "joints": self.joints}
        claim = {"bound": self.bound, "constant": self.constant}
        return json.dumps({"format": FORMAT, **head, **claim, **held}) + "\n"


def squares_of(
    families: Sequence[RowBlocks], factors: Sequence[FloatArray]
) -> tuple[SectorSquares, ...]:
    """Return the squares of blocks with a factor for each, (size, squares)."""
    remaining = iter(factors)
    found = []
    for family in families:
        sector = family.sector
        if not isinstance(sector, RowSector):
            raise InputError("families", sector, "invariant under the signs of the columns")
        frames = _frames(family)
        given = ((block, next(remaining)) for block in family.blocks)
        blocks = [
            _block_squares(family, block, factor, frames)
            for block, factor in given
            if factor.size
        ]
        if blocks:
            found.append((sector, tuple(blocks)))
    return tuple(found)


def _frames(family: RowBlocks) -> dict[tuple[Shapes, int], tuple[tuple[int, ...], FloatArray]]:
    """Return pivots, and the left inverse of the P e_i, for shapes and number of labels.

    Blocks that are even and odd under conjugation share what belongs to the first tableau.
    """
    together: dict[tuple[Shapes, int], list[FloatArray]] = {}
    for block in family.blocks:
        start = first_tableau(block.shapes)
        for number, _, coefficients in block.parts:
            together.setdefault((block.shapes, number), []).append(coefficients[start])
    found = {}
    for key, parts in together.items():
        vectors, values, _ = np.linalg.svd(np.hstack(parts), full_matrices=False)
        vectors = vectors[:, values > _RANK * values[0]]
        order = scipy.linalg.qr(vectors.T, mode="r", pivoting=True)[1]
        pivots = sorted(int(i) for i in order[: vectors.shape[1]])
        # P = vectors · vectorsᵀ.
        found[key] = tuple(pivots), np.linalg.inv(vectors[pivots].T) @ vectors.T
    return found


def _block_squares(
    family: RowBlocks,
    block: AdaptedRows,
    factor: FloatArray,
    frames: Mapping[tuple[Shapes, int], tuple[tuple[int, ...], FloatArray]],
) -> BlockSquares:
    """Return the same squares with P e_i in place of the block's own rows."""
    start = first_tableau(block.shapes)
    changes: dict[int, FloatArray] = {}
    for number, place, coefficients in block.parts:
        pivots, inverse = frames[block.shapes, number]
        change = changes.setdefault(number, np.zeros((len(pivots), block.size)))
        change[:, place.start : place.stop] += inverse @ coefficients[start]
    rows = tuple(
        BlockRows(family.rows[number].parts, frames[block.shapes, number][0])
        for number in changes
    )
    change = np.vstack(list(changes.values()))
    if not isinstance(family, KrylovLocaliser):
        return BlockSquares(block.shapes, rows, change @ factor)
    # The rows of the factor are those of r_0, r_1 and r_2.
    chosen, powers = family.selection(block)
    columns = zip(_ranges(rows), (sum(one.labels, ()) for one in rows), strict=True)
    allowed, by_power = krylov_selection(columns, len(change), family.sector.degree)
    parts = []
    for power in range(POWERS):
        own = np.zeros((block.size, factor.shape[1]))
        own[chosen[powers == power]] = factor[powers == power]
        parts.append((change @ own)[allowed[by_power == power]])
    return BlockSquares(block.shapes, rows, np.vstack(parts))


def _ranges(rows: Sequence[BlockRows]) -> list[range]:
    """Return the numbers of the columns of each U among all of them."""
    ends = accumulate(len(one.pivots) for one in rows)
    return [range(a, b) for a, b in pairwise([0, *ends])]


def _sectors_fields(sectors: Sequence[SectorSquares]) -> list[dict[str, Any]]:
    return [
        {**_sector_fields(sector), "blocks": [_block_fields(block) for block in blocks]}
        for sector, blocks in sectors
    ]


def _sector_fields(sector: RowSector) -> dict[str, int]:
    locked = {} if sector.locked is None else {"locked": sector.locked}
    return {**{name: getattr(sector, name) for name in SECTOR}, **locked}


def _block_fields(block: BlockSquares) -> dict[str, Any]:
    rows = [{"labels": one.labels, "pivots": one.pivots} for one in block.rows]
    squares = block.factor.shape[1]
    return {
        "shapes": block.shapes,
        "rows": rows,
        "squares": squares,
        "factor": _encoded(block.factor),
    }


def _encoded(matrix: FloatArray) -> str:
    return b64encode(without_tiny(matrix).astype("<f8").tobytes()).decode()


def without_tiny(matrix: FloatArray) -> FloatArray:
    """Return a matrix with 0 for what is too small to matter."""
    return np.where(np.abs(matrix) < _SMALLEST, 0.0, matrix)
