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
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Any, Literal, TypeAlias

import numpy as np

from formulations.bounds.so3_moments.representations.row_sectors import Label, RowSector
from formulations.bounds.so3_moments.representations.young_basis import Shapes
from nlp.arrays import FloatArray

FORMAT = "lockedjoint bound 2"
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
