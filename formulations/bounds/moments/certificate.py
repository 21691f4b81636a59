"""The certificate of a rigorous bound: its sum of squares, and the file that it is written to.

What comes in: what `relaxation` has found. What goes out: a `BoundCertificate`, and the text of
its file, which `certificate_reader` reads back and `verification` proves.

A bound is proved by a sum of squares Σ |Lᵀr|², each times a condition that is ≥ 0, or times 1
(docs/bounds.md, sections 2 and 4):

- sector: the functions with one behaviour under frames, phase and signs, see `row_sectors`;
- plain row: a product of Wigner functions of the joints, with given labels. Its number i counts
  the plain rows of one set of labels;
- shape and tableau: how functions behave when joints of one group change places. A shape has
  several tableaux, whose blocks are equal: the first is enough;
- P: the projector, shape (plain rows, plain rows), on the combinations of plain rows of one set
  of labels that belong to the first tableau. e_i is unit vector i, so P e_i is column i of P;
- U: the chosen columns P e_i of one set of labels, shape (plain rows, chosen). Unlike
  eigenvectors, these do not differ between machines. The file names them by i, as ``pivots``;
- r: the combinations Uᵀ(plain rows) of a block, of all its sets of labels; L: the factor, shape
  (entries of r, squares), of the block's multiplier LLᵀ.

What is proved holds for every L and every choice of rows i. Matrices are doubles,
little-endian, row after row, in base64.
"""

import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import accumulate, chain, pairwise
from typing import Any, Literal, TypeAlias

import numpy as np

from lockedjoint.formulations.bounds.moments.conditions import (
    WITH_SIGNS,
    Conditions,
    worst_case_conditions,
)
from lockedjoint.formulations.bounds.moments.lever_conditions import lever_conditions
from lockedjoint.formulations.bounds.moments.row_sectors import LabelSet, RowSector
from lockedjoint.formulations.bounds.moments.sampled_blocks import (
    BlockFamily,
    Selection,
    selection,
)
from lockedjoint.formulations.bounds.moments.tableaux import (
    Shapes,
)
from lockedjoint.formulations.bounds.spectral_limit import Spectrum
from lockedjoint.nlp.arrays import FloatArray

#: Value of the key ``format``: a reader refuses any other.
FORMAT = "lockedjoint bound 2"
#: Keys of the file after the format, for every quantity.
FIELDS = ("quantity", "joints", "bound", "constant", "sectors")
# Keys that max-min adds: t and the sums of the conditions; ``spectrum`` has A, B and C of
# `spectral_limit`.
_EXCLUSION = ("excluded", "scaled", "krylov", "spectrum", "spectral", *WITH_SIGNS)
#: Keys that each quantity adds.
ADDED = {"residual": (), "max-min": _EXCLUSION, "isotropy": ("turned", "aligned", "narrow")}
# Fields of the file that are no sectors.
_PLAIN_FIELDS = ("quantity", "joints", "bound", "constant", "excluded", "spectrum")
# Size below which an entry of L is written as 0, so that no product underflows: bounds on
# rounding assume that.
_SMALLEST = 1e-30
#: What a certificate can bound.
CertifiedQuantity: TypeAlias = Literal["residual", "max-min", "isotropy"]


@dataclass(frozen=True, eq=False)
class BlockSquares:
    """The squares of one block, or those that multiply a localiser."""

    #: Shapes of the permutations of the joints in each group.
    shapes: Shapes
    #: The numbers i of the chosen plain rows, by sets of labels: the columns of U are P e_i.
    rows: Mapping[LabelSet, tuple[int, ...]]
    #: L, shape (columns of all U, squares), one U after another. With a condition on several
    #: vectors w_a: first the columns of all U for w_0, then for w_1, w_2, … those of low enough
    #: degree, see `selection`.
    factor: FloatArray

    @property
    def columns(self) -> list[range]:
        """Numbers of the columns of each U among all of them."""
        ends = accumulate(map(len, self.rows.values()))
        return [range(a, b) for a, b in pairwise([0, *ends])]

    @property
    def size(self) -> int:
        """Number of columns of all U."""
        return self.columns[-1].stop

    def selection(self, family: BlockFamily) -> Selection:
        """Return which column, and which vector w_a, makes each row of the factor."""
        # The labels of all groups of joints together.
        labels = (tuple(chain.from_iterable(one)) for one in self.rows)
        columns = zip(self.columns, labels, strict=True)
        return selection(columns, self.size, family.sector.degree, family.lowered)

    def to_dict(self) -> dict[str, Any]:
        """Return its fields in the file."""
        return {
            "shapes": self.shapes,
            "rows": [
                {"labels": labels, "pivots": pivots} for labels, pivots in self.rows.items()
            ],
            "squares": self.factor.shape[1],
            "factor": b64encode(without_tiny(self.factor).astype("<f8").tobytes()).decode(),
        }


#: A sector, with the squares of its blocks.
SectorSquares: TypeAlias = tuple[RowSector, tuple[BlockSquares, ...]]


@dataclass(frozen=True, eq=False)
class BoundCertificate:
    """A sum of squares, and of localisers, that proves a bound for unit revolute joints."""

    #: ``"residual"``: ρ = ½‖JJᵀ − (n/3)I‖_F², from below. ``"max-min"``: the worst case σ after
    #: one locked joint, eq. (5), from above. ``"isotropy"``: the same of isotropic Jacobians of
    #: revolute joints with lever arms of any length.
    quantity: CertifiedQuantity
    joints: int
    #: The bound that is claimed.
    bound: float
    #: b, such that ρ − b is the sum of squares but for rounding; for max-min −b is the sum of
    #: squares and localisers, which cannot be where all of them are ≥ 0. For isotropy there is
    #: `lever_conditions.lever_defect` in place of ρ.
    constant: float
    #: The squares of each sector, by the name of the condition that they multiply: ``sectors``
    #: and ``unsigned`` by none.
    sums: Mapping[str, tuple[SectorSquares, ...]]
    #: The squared worst case t that is excluded; None for other quantities than max-min.
    excluded: float | None = None
    #: A, B and C of `spectral_limit`; None for other quantities than max-min.
    spectrum: Spectrum | None = None

    @property
    def conditions(self) -> Conditions:
        """What the sums multiply, by name; InputError if the spectrum is not proved."""
        if self.quantity == "isotropy":
            return lever_conditions()
        if self.excluded is None or self.spectrum is None:
            return {}
        return worst_case_conditions(self.joints, self.excluded, self.spectrum)

    def to_json(self) -> str:
        """Return the text of the file."""
        names = FIELDS + ADDED[self.quantity]
        plain = {
            name: getattr(self, name)
            if name in _PLAIN_FIELDS
            else _plain_sectors(self.sums.get(name, ()))
            for name in names
        }
        return json.dumps({"format": FORMAT, **plain}) + "\n"


def _plain_sectors(sectors: Sequence[SectorSquares]) -> list[dict[str, Any]]:
    """Return sectors as in the file: without the fields that are None."""
    return [
        {
            **{name: number for name, number in asdict(sector).items() if number is not None},
            "blocks": [block.to_dict() for block in blocks],
        }
        for sector, blocks in sectors
    ]


def without_tiny(matrix: FloatArray) -> FloatArray:
    """Return a matrix with 0 for what is too small to matter."""
    return np.where(np.abs(matrix) < _SMALLEST, 0.0, matrix)
