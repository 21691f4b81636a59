"""The certificate of a rigorous bound: a file with its sum of squares.

A block is given by a matrix U for each set of labels, its rows in the first tableau, and by a
factor L of its multiplier. The columns of U come from eigenvectors, whose signs and order
differ between machines; therefore U is in the file. What is proved holds for every U and L:
they need not be orthogonal or symmetric, or come from a solver. See `verification`.

Matrices are doubles, little-endian, row after row, in base64. Whatever is not exactly in the
format is refused, and sizes are limited before anything of that size is built.
"""

import json
from base64 import b64decode, b64encode
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from math import isfinite
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from formulations.bounds.so3_moments.blocks.sampled_blocks import SectorBlocks
from formulations.bounds.so3_moments.representations.permuted_rows import PermutedRows
from formulations.bounds.so3_moments.representations.row_sectors import Label, RowSector
from formulations.bounds.so3_moments.representations.young_basis import (
    Shapes,
    first_tableau,
    tableau_contents,
)
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
from formulations.existence.relaxation.tableaux import partitions
from nlp.arrays import FloatArray
from nlp.errors import InputError, LockedJointError, shown

FORMAT = "lockedjoint bound 1"
FILE_BYTES = 20_000_000
# Limits on what a file may ask for; presets stay far below them.
_JOINTS, _SECTORS, _LARGEST = range(6, 10), 100, 1e6
# Smaller entries are 0, so that no product underflows.
_SMALLEST = 1e-30
_SECTOR_LIMITS = {"odd": 6, "charge": 6, "spin": 3, "degree": 6}

# What a certificate can bound. Another quantity adds its name here, its case in `verify_bound`.
CertifiedQuantity: TypeAlias = Literal["residual"]


class IllFormedError(LockedJointError):
    """A file that is no certificate of a bound."""


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


@dataclass(frozen=True, eq=False)
class BlockSquares:
    """The squares of one block.

    Parameters
    ----------
    shapes
        Shapes of the permutations of the joints in each group.
    rows
        The rows, for each set of labels.
    factor
        L, shape (columns of all U, squares).
    """

    shapes: Shapes
    rows: tuple[BlockRows, ...]
    factor: FloatArray


@dataclass(frozen=True, eq=False)
class BoundCertificate:
    """A sum of squares that proves a bound.

    Parameters
    ----------
    quantity
        What is bounded; ``"residual"``: ρ = ½‖JJᵀ − (n/3)I‖_F², from below.
    joints
        Number n of unit revolute joints.
    bound
        The bound that is claimed.
    constant
        b, such that ρ − b is the sum of squares but for rounding.
    sectors
        The squares of each sector.
    """

    quantity: CertifiedQuantity
    joints: int
    bound: float
    constant: float
    sectors: tuple[tuple[RowSector, tuple[BlockSquares, ...]], ...]

    def to_json(self) -> str:
        """Return the text of the file."""
        sectors = [
            {**_sector_fields(sector), "blocks": [_block_fields(block) for block in blocks]}
            for sector, blocks in self.sectors
        ]
        head = {"quantity": self.quantity, "joints": self.joints}
        claim = {"bound": self.bound, "constant": self.constant}
        return json.dumps({"format": FORMAT, **head, **claim, "sectors": sectors}) + "\n"


def squares_of(
    families: Sequence[SectorBlocks], factors: Sequence[FloatArray]
) -> tuple[tuple[RowSector, tuple[BlockSquares, ...]], ...]:
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


def _sector_fields(sector: RowSector) -> dict[str, int]:
    return {name: getattr(sector, name) for name in _SECTOR_LIMITS}


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
    return b64encode(_without_tiny(matrix).astype("<f8").tobytes()).decode()


def _without_tiny(matrix: FloatArray) -> FloatArray:
    return np.where(np.abs(matrix) < _SMALLEST, 0.0, matrix)


def _certificate(value: Any) -> BoundCertificate:
    names = ("format", "quantity", "joints", "bound", "constant", "sectors")
    parts = fields_of(value, *names)
    if parts["format"] != FORMAT:
        raise CertificateError(f"format: {shown(parts['format'])} is not {FORMAT!r}.")
    quantity = parts["quantity"]
    if quantity not in get_args(CertifiedQuantity):
        raise CertificateError(f"quantity: {shown(quantity)} is not known.")
    joints = at("joints", partial(_whole, allowed=_JOINTS), parts["joints"])
    bound, constant = (at(name, _number, parts[name]) for name in ("bound", "constant"))
    read_sector = partial(_sector, joints=joints)
    sectors = at("sectors", _short_list(read_sector, _SECTORS), parts["sectors"])
    _distinct("sectors", [sector for sector, _ in sectors])
    return BoundCertificate(quantity, joints, bound, constant, sectors)


def _sector(value: Any, joints: int) -> tuple[RowSector, tuple[BlockSquares, ...]]:
    parts = fields_of(value, *_SECTOR_LIMITS, "blocks")
    numbers = [
        at(name, partial(_whole, allowed=range(most + 1)), parts[name])
        for name, most in _SECTOR_LIMITS.items()
    ]
    try:
        sector = RowSector(*numbers)
    except LockedJointError as error:
        raise CertificateError(str(error)) from None
    # Compared as texts: 1.0 and True would be equal to 1 as well.
    rows = {repr(entry.parts): entry for entry in SectorBlocks(sector, joints).rows}
    places = sector.places(joints)
    shapes = {repr(one): one for one in product(*(partitions(len(group)) for group in places))}
    # A shape has at most two blocks: even and odd under conjugation.
    read_blocks = _short_list(partial(_block, rows=rows, shapes=shapes), 2 * len(shapes))
    blocks = at("blocks", read_blocks, parts["blocks"])
    seen = Counter(block.shapes for block in blocks)
    if max(seen.values(), default=0) > 2:
        raise CertificateError("blocks: more than two have the same shapes.")
    return sector, blocks


def _block(
    value: Any, rows: Mapping[str, PermutedRows], shapes: Mapping[str, Shapes]
) -> BlockSquares:
    parts = fields_of(value, "shapes", "rows", "squares", "factor")
    found = shapes.get(repr(_tuples(parts["shapes"])))
    if found is None:
        raise CertificateError(f"shapes: {shown(parts['shapes'])} are none of this sector.")
    read_rows = partial(_rows, rows=rows, tableaux=len(tableau_contents(found)))
    together = at("rows", _short_list(read_rows, len(rows)), parts["rows"])
    _distinct("rows", [one.labels for one in together])
    size = max((one.first + one.basis.shape[1] for one in together), default=0)
    if size > sum(one.basis.shape[1] for one in together):
        raise CertificateError(f"rows: {size} columns, but not all of them occur.")
    squares = at("squares", partial(_whole, allowed=range(1, size + 1)), parts["squares"])
    factor = at("factor", partial(_matrix, shape=(size, squares)), parts["factor"])
    return BlockSquares(found, together, factor)


def _rows(value: Any, rows: Mapping[str, PermutedRows], tableaux: int) -> BlockRows:
    parts = fields_of(value, "labels", "first", "columns", "basis")
    entry = rows.get(repr(_tuples(parts["labels"])))
    if entry is None:
        raise CertificateError(f"labels: {shown(parts['labels'])} are none of this sector.")
    # At most as many as there are independent rows for each tableau.
    most = entry.length // tableaux
    columns = at("columns", partial(_whole, allowed=range(1, most + 1)), parts["columns"])
    first = at("first", partial(_whole, allowed=range(10**4)), parts["first"])
    basis = at("basis", partial(_matrix, shape=(entry.length, columns)), parts["basis"])
    return BlockRows(entry.parts, first, basis)


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
