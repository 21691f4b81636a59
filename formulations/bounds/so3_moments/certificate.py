"""The certificate of a rigorous bound: a file with its sum of squares, and its strict reader.

A block is given by columns P e_i of the projector on the rows of the first tableau, for each
set of labels, and by a factor L of its multiplier: unlike eigenvectors, the projector does not
differ between machines. What is proved holds for every L and every choice of rows i. Matrices
are doubles, little-endian, row after row, in base64.
"""

import json
from base64 import b64decode, b64encode
from collections import Counter
from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import asdict, dataclass, replace
from fractions import Fraction
from itertools import accumulate, pairwise, product
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from formulations.bounds.recorded import read_bounds
from formulations.bounds.so3_moments.sampled_blocks import (
    RowBlocks,
    Selection,
    krylov_form,
    selection,
)
from formulations.bounds.so3_moments.wigner import LabelSet, RowSector
from formulations.existence.certificate import shown
from formulations.existence.reading import Part, loaded, read
from formulations.existence.tableaux import Shapes, partitions, tableau_contents
from nlp.arrays import FloatArray
from nlp.errors import InputError

_FORMAT = "lockedjoint bound 2"
# The keys of the file after the format, and those that the quantity max-min adds.
_FIELDS = ("quantity", "joints", "bound", "constant", "sectors")
_EXCLUSION = ("excluded", "scaled", "krylov")
FILE_BYTES = 20_000_000
# Smaller entries are 0, so that no product underflows.
_SMALLEST = 1e-30
# Limits on what a file may ask for; presets stay far below them. Eq. (6) needs 7 joints.
_JOINTS = {"residual": range(6, 10), "max-min": range(7, 10)}
_SECTORS, _LARGEST, _LEAST_EXCLUDED = 100, 1e6, 1e-3
_LIMITS = {"odd": 6, "charge": 6, "spin": 3, "degree": 6}
_SCALED_LIMITS = {**_LIMITS, "degree": 4}
_KRYLOV_LIMITS = {**_SCALED_LIMITS, "locked": 1}

# What a certificate can bound.
CertifiedQuantity: TypeAlias = Literal["residual", "max-min"]


@dataclass(frozen=True, eq=False)
class BlockSquares:
    """The squares of one block, or those that multiply a localiser."""

    #: Shapes of the permutations of the joints in each group.
    shapes: Shapes
    #: For each set of labels the numbers i of plain rows: the columns of U are P e_i, in the
    #: first tableau.
    rows: Mapping[LabelSet, tuple[int, ...]]
    #: L, shape (columns of all U, squares), one U after another. Of Krylov vectors: first for
    #: r_0 all columns, then for r_1 and r_2 those of low enough degree, see `selection`.
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

    def selection(self, family: RowBlocks) -> Selection:
        """Return which column, and which power of M, makes each row of the factor."""
        labels = (sum(one, ()) for one in self.rows)
        columns = zip(self.columns, labels, strict=True)
        return selection(columns, self.size, family.sector.degree, family.lowered)

    def to_dict(self) -> dict[str, Any]:
        """Return its fields in the file."""
        return {
            "shapes": self.shapes,
            "rows": [{"labels": one, "pivots": own} for one, own in self.rows.items()],
            "squares": self.factor.shape[1],
            "factor": b64encode(_without_tiny(self.factor).astype("<f8").tobytes()).decode(),
        }


SectorSquares: TypeAlias = tuple[RowSector, tuple[BlockSquares, ...]]


@dataclass(frozen=True, eq=False)
class BoundCertificate:
    """A sum of squares, and of localisers, that proves a bound for unit revolute joints."""

    #: ``"residual"``: ρ = ½‖JJᵀ − (n/3)I‖_F², from below. ``"max-min"``: the worst case σ after
    #: one locked joint, eq. (5), from above.
    quantity: CertifiedQuantity
    joints: int
    #: The bound that is claimed.
    bound: float
    #: b, such that ρ − b is the sum of squares but for rounding; for max-min −b is the sum of
    #: squares and localisers, which cannot be where all of them are ≥ 0.
    constant: float
    #: The squares of each sector.
    sectors: tuple[SectorSquares, ...]
    #: The squared worst case t that is excluded; None for the residual.
    excluded: float | None = None
    #: Squares that are multiplied by (ρ_max(t) − ρ)/(5n/3), and by J_f J_fᵀ − tI on Krylov
    #: vectors.
    scaled: tuple[SectorSquares, ...] = ()
    krylov: tuple[SectorSquares, ...] = ()

    def to_json(self) -> str:
        """Return the text of the file."""
        names = _FIELDS if self.excluded is None else (*_FIELDS, *_EXCLUSION)
        values = {name: getattr(self, name) for name in names}
        plain = {
            name: _plain_sectors(value) if isinstance(value, tuple) else value
            for name, value in values.items()
        }
        return json.dumps({"format": _FORMAT, **plain}) + "\n"


def _plain_sectors(sectors: Sequence[SectorSquares]) -> list[dict[str, Any]]:
    return [
        {
            **{name: number for name, number in asdict(sector).items() if number is not None},
            "blocks": [block.to_dict() for block in blocks],
        }
        for sector, blocks in sectors
    ]


def _without_tiny(matrix: FloatArray) -> FloatArray:
    """Return a matrix with 0 for what is too small to matter."""
    return np.where(np.abs(matrix) < _SMALLEST, 0.0, matrix)


def read_any(path: Path | str) -> Any:
    """Return the certificate in a file: of a bound, of existence, of nonexistence; or a list.

    FileError if it cannot be read, CertificateError if it is ill-formed.
    """
    value = loaded(path, FILE_BYTES)
    if isinstance(value, dict) and "quantity" in value:
        return _certificate(Part(value))
    if isinstance(value, list):
        return read_bounds(value)
    return read(path)


def _certificate(part: Part) -> BoundCertificate:
    quantity = part.value["quantity"]
    if quantity not in get_args(CertifiedQuantity):
        part.refuse(f"quantity: {shown(quantity)} is not known")
    more = _EXCLUSION if quantity == "max-min" else ()
    format_, _, count, bound, constant, plain, *exclusion = part.fields(
        "format", *_FIELDS, *more
    )
    if format_.value != _FORMAT:
        format_.refuse(f"{shown(format_.value)} is not {_FORMAT!r}")
    joints = count.whole(_JOINTS[quantity])
    found = BoundCertificate(
        quantity,
        joints,
        bound.number(_LARGEST),
        constant.number(_LARGEST),
        _sectors(plain, joints, _LIMITS),
    )
    if not exclusion:
        return found
    excluded, scaled, krylov = exclusion
    t = excluded.number(_LARGEST)
    if t < _LEAST_EXCLUDED or Fraction(t) > _largest_excluded(joints):
        excluded.refuse(f"{t} is not from {_LEAST_EXCLUDED:g} to (n − 6)/3")
    return replace(
        found,
        excluded=t,
        scaled=_sectors(scaled, joints, _SCALED_LIMITS),
        krylov=_sectors(krylov, joints, _KRYLOV_LIMITS),
    )


def _largest_excluded(joints: int) -> Fraction:
    """Return the square of eq. (6): nothing above it has to be excluded."""
    return Fraction(joints - 6, 3)


def _sectors(part: Part, joints: int, limits: Mapping[str, int]) -> tuple[SectorSquares, ...]:
    found = tuple(_sector(one, joints, limits) for one in part.items(range(_SECTORS + 1)))
    _require_distinct(part, [sector for sector, _ in found])
    return found


def _sector(part: Part, joints: int, limits: Mapping[str, int]) -> SectorSquares:
    *numbers, listed = part.fields(*limits, "blocks")
    within = zip(numbers, limits.values(), strict=True)
    values = [number.whole(range(most + 1)) for number, most in within]
    try:
        sector = RowSector(*values)
    except InputError as error:
        part.refuse(str(error).rstrip("."))
    form = None if sector.locked is None else krylov_form(0.0)  # whatever the limit
    family = RowBlocks(sector, joints, form)
    shapes = {*product(*(tuple(partitions(len(group))) for group in sector.places(joints)))}
    # A shape has at most two blocks: even and odd under conjugation.
    parts = listed.items(range(2 * len(shapes) + 1))
    blocks = tuple(_block(one, family, shapes) for one in parts)
    seen = Counter(block.shapes for block in blocks)
    if max(seen.values(), default=0) > 2:
        listed.refuse("more than two have the same shapes")
    return sector, blocks


def _block(part: Part, family: RowBlocks, shapes: AbstractSet[Shapes]) -> BlockSquares:
    named, listed, count, factor = part.fields("shapes", "rows", "squares", "factor")
    found = named.read(Shapes)
    if found not in shapes:
        named.refuse("they are none of this sector")
    tableaux = len(tableau_contents(found))
    lengths = {entry.parts: entry.length for entry in family.rows}
    rows = []
    for one in listed.items(range(1, len(lengths) + 1)):
        labels, pivots = one.fields("labels", "pivots")
        name = labels.read(LabelSet)
        if name not in lengths:
            labels.refuse("they are none of this sector")
        length = lengths[name]
        # At most as many as there are independent rows for each tableau.
        items = pivots.items(range(1, length // tableaux + 1))
        rows.append((name, tuple(pivot.whole(range(length)) for pivot in items)))
        _require_distinct(pivots, rows[-1][1])
    _require_distinct(listed, [name for name, _ in rows])
    empty = BlockSquares(found, dict(rows), np.zeros((0, 0)))
    height = len(empty.selection(family)[0])
    squares = count.whole(range(1, height + 1))
    return replace(empty, factor=_matrix(factor, (height, squares)))


def _require_distinct(part: Part, values: Sequence[object]) -> None:
    if len(set(values)) < len(values):
        part.refuse("one is given twice")


def _matrix(part: Part, shape: tuple[int, int]) -> FloatArray:
    size, value = 8 * shape[0] * shape[1], part.value
    if not isinstance(value, str) or len(value) != 4 * -(-size // 3):
        part.refuse(f"not the base64 text of {size} bytes, a matrix of {shape}")
    try:
        content = b64decode(value, validate=True)
    except ValueError as error:
        part.refuse(f"not a base64 text ({error})")
    if len(content) != size:
        part.refuse(f"{len(content)} bytes instead of {size}")
    matrix = np.frombuffer(content, dtype="<f8").reshape(shape).astype(float)
    if not np.all(np.abs(matrix) <= _LARGEST):  # nor NaN
        part.refuse(f"an entry is not a number of size up to {_LARGEST:g}")
    return _without_tiny(matrix)
