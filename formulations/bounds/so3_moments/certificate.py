"""The certificate of a rigorous bound: a file with its sum of squares, and its strict reader.

A block is given by columns of projectors, for each set of labels, and by a factor L of its
multiplier. Eigenvectors, the bases of the search, differ between machines in signs and order;
the projector P on the rows of the first tableau does not. So the file names plain rows i, and U
has the columns P e_i. What is proved holds for every L and every choice of rows.

Matrices are doubles, little-endian, row after row, in base64. Whatever is not exactly in the
format is refused, and sizes are limited before anything of that size is built.
"""

import json
from base64 import b64decode, b64encode
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from itertools import accumulate, pairwise, product
from math import isfinite
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from formulations.bounds.so3_moments.localisers import KrylovLocaliser
from formulations.bounds.so3_moments.row_sectors import LabelSet, RowSector
from formulations.bounds.so3_moments.sampled_blocks import (
    RowBlocks,
    SectorBlocks,
    Selection,
    selection,
)
from formulations.bounds.so3_moments.symmetric_rows import PermutedRows
from formulations.bounds.so3_moments.young_basis import Shapes, tableau_contents
from formulations.existence.certificate import CertificateError
from formulations.existence.reading import (
    Reader,
    Record,
    at,
    fields_of,
    list_of,
    loaded,
    read_either,
)
from formulations.existence.tableaux import partitions
from nlp.arrays import FloatArray
from nlp.errors import LockedJointError, shown

_FORMAT = "lockedjoint bound 2"
FILE_BYTES = 20_000_000
# Smaller entries are 0, so that no product underflows.
_SMALLEST = 1e-30
# The keys of a sector, but for ``locked``, and those that the quantity max-min adds.
_SECTOR = ("odd", "charge", "spin", "degree")
_EXCLUSION = ("excluded", "scaled", "krylov")
# Limits on what a file may ask for; presets stay far below them. Eq. (6) needs 7 joints.
_JOINTS = {"residual": range(6, 10), "max-min": range(7, 10)}
_SECTORS, _LARGEST, _LEAST_EXCLUDED = 100, 1e6, 1e-3
_LIMITS = {"odd": 6, "charge": 6, "spin": 3, "degree": 6}
_SCALED_LIMITS = {**_LIMITS, "degree": 4}
_KRYLOV_LIMITS = {**_SCALED_LIMITS, "locked": 1}

# What a certificate can bound.
CertifiedQuantity: TypeAlias = Literal["residual", "max-min"]


class IllFormedError(LockedJointError):
    """A file that is no certificate of a bound."""


@dataclass(frozen=True, eq=False)
class BlockRows:
    """The rows of a block with one set of labels, in the first tableau."""

    labels: LabelSet
    #: Numbers i of plain rows: the columns of U are P e_i.
    pivots: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class BlockSquares:
    """The squares of one block, or those that multiply a localiser."""

    #: Shapes of the permutations of the joints in each group.
    shapes: Shapes
    rows: tuple[BlockRows, ...]
    #: L, shape (columns of all U, squares), one U after another. Of Krylov vectors: first for
    #: r_0 all columns, then for r_1 and r_2 those of low enough degree, see `selection`.
    factor: FloatArray

    @property
    def columns(self) -> list[range]:
        """Numbers of the columns of each U among all of them."""
        ends = accumulate(len(one.pivots) for one in self.rows)
        return [range(a, b) for a, b in pairwise([0, *ends])]

    @property
    def size(self) -> int:
        """Number of columns of all U."""
        return self.columns[-1].stop

    def selection(self, family: RowBlocks) -> Selection:
        """Return which column, and which power of M, makes each row of the factor."""
        labels = (sum(one.labels, ()) for one in self.rows)
        columns = zip(self.columns, labels, strict=True)
        return selection(columns, self.size, family.sector.degree, family.lowered)

    def to_dict(self) -> dict[str, Any]:
        """Return its fields in the file."""
        return {
            "shapes": self.shapes,
            "rows": [{"labels": one.labels, "pivots": one.pivots} for one in self.rows],
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
        head = {"quantity": self.quantity, "joints": self.joints}
        claim = {"bound": self.bound, "constant": self.constant}
        parts: dict[str, Any] = {"sectors": _sectors_fields(self.sectors)}
        if self.excluded is not None:
            parts["excluded"] = self.excluded
            parts["scaled"] = _sectors_fields(self.scaled)
            parts["krylov"] = _sectors_fields(self.krylov)
        return json.dumps({"format": _FORMAT, **head, **claim, **parts}) + "\n"


def _sectors_fields(sectors: Sequence[SectorSquares]) -> list[dict[str, Any]]:
    return [
        {
            **{name: getattr(sector, name) for name in _SECTOR},
            **({} if sector.locked is None else {"locked": sector.locked}),
            "blocks": [block.to_dict() for block in blocks],
        }
        for sector, blocks in sectors
    ]


def _without_tiny(matrix: FloatArray) -> FloatArray:
    """Return a matrix with 0 for what is too small to matter."""
    return np.where(np.abs(matrix) < _SMALLEST, 0.0, matrix)


def read_any(path: Path | str) -> Any:
    """Return the certificate in a file: of a bound, of existence or of nonexistence.

    Raises
    ------
    FileError
        If the file cannot be read, is too large, or is not a JSON text in UTF-8.
    IllFormedError, CertificateError
        If the JSON text is not a well-formed certificate.
    """
    try:
        value = loaded(path, FILE_BYTES)
        if isinstance(value, dict) and "quantity" in value:
            return _certificate(value)
    except CertificateError as error:
        raise IllFormedError(f"{path} is no certificate: {error}") from None
    except RecursionError:
        raise IllFormedError(f"{path} is no certificate: it is nested too deeply.") from None
    return read_either(path)


def _certificate(value: Any) -> BoundCertificate:
    quantity = value["quantity"]
    if quantity not in get_args(CertifiedQuantity):
        raise CertificateError(f"quantity: {shown(quantity)} is not known.")
    more = _EXCLUSION if quantity == "max-min" else ()
    parts = fields_of(
        value, "format", "quantity", "joints", "bound", "constant", *more, "sectors"
    )
    if parts["format"] != _FORMAT:
        raise CertificateError(f"format: {shown(parts['format'])} is not {_FORMAT!r}.")
    joints = at("joints", partial(_whole, allowed=_JOINTS[quantity]), parts["joints"])
    bound, constant = (at(name, _number, parts[name]) for name in ("bound", "constant"))
    read = partial(_sectors, parts, joints)
    sectors = read("sectors", _LIMITS)
    if not more:
        return BoundCertificate(quantity, joints, bound, constant, sectors)
    excluded = at("excluded", _number, parts["excluded"])
    if excluded < _LEAST_EXCLUDED or Fraction(excluded) > _largest_excluded(joints):
        allowed = f"from {_LEAST_EXCLUDED:g} to (n − 6)/3"
        raise CertificateError(f"excluded: {excluded} is not a number {allowed}.")
    scaled, krylov = read("scaled", _SCALED_LIMITS), read("krylov", _KRYLOV_LIMITS)
    return BoundCertificate(
        quantity, joints, bound, constant, sectors, excluded, scaled, krylov
    )


def _largest_excluded(joints: int) -> Fraction:
    """Return the square of eq. (6): nothing above it has to be excluded."""
    return Fraction(joints - 6, 3)


def _sectors(
    parts: Mapping[str, Any], joints: int, name: str, limits: Mapping[str, int]
) -> tuple[SectorSquares, ...]:
    read_sector = partial(_sector, joints=joints, limits=limits)
    found = at(name, _short_list(read_sector, _SECTORS), parts[name])
    _distinct(name, [sector for sector, _ in found])
    return found


def _sector(value: Any, joints: int, limits: Mapping[str, int]) -> SectorSquares:
    parts = fields_of(value, *limits, "blocks")
    numbers = {
        name: at(name, partial(_whole, allowed=range(most + 1)), parts[name])
        for name, most in limits.items()
    }
    try:
        sector = RowSector(**numbers)
    except LockedJointError as error:
        raise CertificateError(str(error)) from None
    family: RowBlocks = SectorBlocks(sector, joints)
    if sector.locked is not None:
        family = KrylovLocaliser(sector, joints)
    # Compared as texts: 1.0 and True would be equal to 1 as well.
    rows = {repr(entry.parts): entry for entry in family.rows}
    places = sector.places(joints)
    shapes = {repr(one): one for one in product(*(partitions(len(group)) for group in places))}
    # A shape has at most two blocks: even and odd under conjugation.
    read_block = partial(_block, family=family, rows=rows, shapes=shapes)
    read_blocks = _short_list(read_block, 2 * len(shapes))
    blocks = at("blocks", read_blocks, parts["blocks"])
    seen = Counter(block.shapes for block in blocks)
    if max(seen.values(), default=0) > 2:
        raise CertificateError("blocks: more than two have the same shapes.")
    return sector, blocks


def _block(
    value: Any,
    family: RowBlocks,
    rows: Mapping[str, PermutedRows],
    shapes: Mapping[str, Shapes],
) -> BlockSquares:
    parts = fields_of(value, "shapes", "rows", "squares", "factor")
    found = shapes.get(repr(_tuples(parts["shapes"])))
    if found is None:
        raise CertificateError(f"shapes: {shown(parts['shapes'])} are none of this sector.")
    read_rows = partial(_rows, rows=rows, tableaux=len(tableau_contents(found)))
    together = at("rows", _short_list(read_rows, len(rows)), parts["rows"])
    _distinct("rows", [one.labels for one in together])
    if not together:
        raise CertificateError("rows: there are none.")
    block = BlockSquares(found, together, np.zeros((0, 0)))
    height = len(block.selection(family)[0])
    squares = at("squares", partial(_whole, allowed=range(1, height + 1)), parts["squares"])
    factor = at("factor", partial(_matrix, shape=(height, squares)), parts["factor"])
    return BlockSquares(found, together, factor)


def _rows(value: Any, rows: Mapping[str, PermutedRows], tableaux: int) -> BlockRows:
    parts = fields_of(value, "labels", "pivots")
    entry = rows.get(repr(_tuples(parts["labels"])))
    if entry is None:
        raise CertificateError(f"labels: {shown(parts['labels'])} are none of this sector.")
    # At most as many as there are independent rows for each tableau.
    read_pivot = partial(_whole, allowed=range(entry.length))
    pivots = at("pivots", _short_list(read_pivot, entry.length // tableaux), parts["pivots"])
    if not pivots:
        raise CertificateError("pivots: there are none.")
    _distinct("pivots", pivots)
    return BlockRows(entry.parts, pivots)


def _short_list(read_one: Reader[Record], most: int) -> Reader[tuple[Record, ...]]:
    """Return the reader of a list of limited length, which is checked first."""

    def read_all(value: Any) -> tuple[Record, ...]:
        if isinstance(value, list) and len(value) > most:
            raise CertificateError(f"{len(value)} are more than {most}.")
        return list_of(read_one)(value)

    return read_all


def _tuples(value: Any) -> Any:
    """Return lists of lists as tuples."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def _whole(value: Any, allowed: range) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value not in allowed:
        limits = f"from {allowed.start} to {allowed.stop - 1}"
        raise CertificateError(f"{shown(value)} is not an integer {limits}.")
    return value


def _number(value: Any) -> float:
    if not isinstance(value, float) or not isfinite(value) or abs(value) > _LARGEST:
        raise CertificateError(f"{shown(value)} is not a decimal number up to {_LARGEST:g}.")
    return value


def _matrix(value: Any, shape: tuple[int, int]) -> FloatArray:
    size = 8 * shape[0] * shape[1]
    if not isinstance(value, str) or len(value) != 4 * -(-size // 3):
        raise CertificateError(f"not the base64 text of {size} bytes, a matrix of {shape}.")
    try:
        content = b64decode(value, validate=True)
    except ValueError as error:
        raise CertificateError(f"not a base64 text ({error}).") from None
    if len(content) != size:
        raise CertificateError(f"{len(content)} bytes instead of {size}.")
    matrix = np.frombuffer(content, dtype="<f8").reshape(shape).astype(float)
    if not np.all(np.abs(matrix) <= _LARGEST):  # nor NaN
        raise CertificateError(f"an entry is not a number of size up to {_LARGEST:g}.")
    return _without_tiny(matrix)


def _distinct(name: str, values: Sequence[Any]) -> None:
    if len(set(values)) < len(values):
        raise CertificateError(f"{name}: one is given twice.")
