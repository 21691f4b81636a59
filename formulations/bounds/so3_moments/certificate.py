"""The certificate of a rigorous bound: a file with its sum of squares.

A block is given by a matrix U for each set of labels, its rows in the first tableau, and by a
factor L of its multiplier. The columns of U come from eigenvectors, whose signs and order
differ between machines; therefore U is in the file. What is proved holds for every U and L:
they need not be orthogonal or symmetric, or come from a solver. See `verification`.

Matrices are doubles, little-endian, row after row, in base64. Whatever is not exactly in the
format is refused, and sizes are limited before anything of that size is built.
"""

import json
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np

from formulations.bounds.so3_moments.blocks.sampled_blocks import RowBlocks
from formulations.bounds.so3_moments.representations.row_sectors import Label, RowSector
from formulations.bounds.so3_moments.representations.young_basis import Shapes, first_tableau
from nlp.arrays import FloatArray
from nlp.errors import InputError

FORMAT = "lockedjoint bound 1"
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
    first
        Number of the block's first column among these.
    basis
        U, shape (plain rows, columns).
    """

    labels: tuple[tuple[Label, ...], ...]
    first: int
    basis: FloatArray

    @property
    def columns(self) -> range:
        """Numbers of the block's columns to which these rows contribute."""
        return range(self.first, self.first + self.basis.shape[1])


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
        L, shape (columns of all U, squares). Of Krylov vectors: first for r_0 all columns,
        then for r_1 and r_2 those of low enough degree, see `krylov_selection`.
    """

    shapes: Shapes
    rows: tuple[BlockRows, ...]
    factor: FloatArray

    @property
    def size(self) -> int:
        """Number of columns of all U."""
        return max(one.columns.stop for one in self.rows)


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
        blocks = []
        for block in family.blocks:
            start = first_tableau(block.shapes)
            rows = tuple(
                BlockRows(family.rows[number].parts, columns.start, coefficients[start])
                for number, columns, coefficients in block.parts
            )
            factor = next(remaining)
            if factor.size:
                blocks.append(BlockSquares(block.shapes, rows, factor))
        if blocks:
            found.append((sector, tuple(blocks)))
    return tuple(found)


def _sectors_fields(sectors: Sequence[SectorSquares]) -> list[dict[str, Any]]:
    return [
        {**_sector_fields(sector), "blocks": [_block_fields(block) for block in blocks]}
        for sector, blocks in sectors
    ]


def _sector_fields(sector: RowSector) -> dict[str, int]:
    locked = {} if sector.locked is None else {"locked": sector.locked}
    return {**{name: getattr(sector, name) for name in SECTOR}, **locked}


def _block_fields(block: BlockSquares) -> dict[str, Any]:
    rows = [
        {
            "labels": one.labels,
            "first": one.first,
            "columns": one.basis.shape[1],
            "basis": _encoded(one.basis),
        }
        for one in block.rows
    ]
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
