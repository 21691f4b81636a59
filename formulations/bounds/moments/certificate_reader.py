"""Read the certificate of a rigorous bound from a file, or refuse it.

What comes in: a path of a file that anybody may have written. What goes out: a
`BoundCertificate` that is well-formed. Whether it proves its bound is for `verification` to
say. To let files hold more, change the limits below. Sectors, labels, pivots and squares are
words of `certificate`; t and A, B, C of `spectral_limit`. A `Part` is a value of the file with
its place in it: it reads what is expected there, or refuses it with a CertificateError.
"""

from base64 import b64decode
from collections import Counter
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import replace
from fractions import Fraction
from itertools import product
from math import ceil
from pathlib import Path
from typing import Any, get_args

import numpy as np

from lockedjoint.formulations.bounds.lever_certificate import QUANTITY, LeverCertificate
from lockedjoint.formulations.bounds.moments.certificate import (
    ADDED,
    FIELDS,
    FORMAT,
    BlockSquares,
    BoundCertificate,
    CertifiedQuantity,
    SectorSquares,
    without_tiny,
)
from lockedjoint.formulations.bounds.moments.conditions import worst_case_conditions
from lockedjoint.formulations.bounds.moments.lever_conditions import lever_conditions
from lockedjoint.formulations.bounds.moments.row_sectors import LabelSet, RowSector
from lockedjoint.formulations.bounds.moments.sampled_blocks import BlockFamily
from lockedjoint.formulations.bounds.moments.tableaux import (
    Shapes,
    partitions,
    tableau_contents,
)
from lockedjoint.formulations.bounds.spectral_limit import Spectrum, spectral_limit
from lockedjoint.formulations.existence.certificate import shown
from lockedjoint.formulations.existence.reading import Part, loaded, read_certificate
from lockedjoint.nlp.arrays import FloatArray
from lockedjoint.nlp.errors import InputError

#: Largest size of a file in bytes.
FILE_BYTES = 20_000_000
# Numbers of joints that a file may have. These limits, and those below, are on what a file may
# ask for; files on record stay far below them.
_JOINTS = {"residual": range(6, 10), "max-min": range(7, 8), "isotropy": range(7, 8)}
# Largest number of sectors under each name.
_SECTORS = 100
# Largest absolute value of a number in a file.
_LARGEST = 1e6
# Smallest t that a file may exclude.
_LEAST_EXCLUDED = 1e-3
# Largest numbers of a sector of functions that change with the signs of the columns in a known
# way: the fields of `RowSector` but for the degree.
_SIGNED = {"odd": 6, "charge": 6, "spin": 4}
# The same where the signs of the columns are fixed; the file has no ``odd`` then.
_UNSIGNED = {"charge": 4, "spin": 4}
# The largest numbers of a sector, by the name of what its squares are multiplied with:
#
#   sectors, unsigned        1, without and with fixed signs
#   scaled, unsigned_scaled  ρ_max(t) − ρ, without and with fixed signs
#   krylov, gram, deviation  a matrix on vectors: `krylov_form`, `gram_form`, `deviation_form`
#   spectral                 α + β tr E³ − ρ, see `spectral_distance`
#   near                     a limit of |s|², s the sum of the columns, see `nearness`
#   turned, aligned, narrow  the conditions of `lever_conditions`
#
# A sector in the file has exactly these keys, and ``blocks``. The polynomials have a degree of
# at most 12, or 8 where it changes with the signs of the columns.
_LIMITS: dict[str, dict[str, int]] = {
    "sectors": {**_SIGNED, "degree": 6},
    "scaled": {**_SIGNED, "degree": 4},
    "krylov": {**_SIGNED, "degree": 4, "locked": 1},
    "spectral": {**_SIGNED, "degree": 3},
    "turned": {**_SIGNED, "degree": 4},
    "aligned": {**_SIGNED, "degree": 2},
    "narrow": {**_SIGNED, "degree": 4},
    "unsigned": {**_UNSIGNED, "degree": 4},
    "near": {**_UNSIGNED, "degree": 3},
    "unsigned_scaled": {**_UNSIGNED, "degree": 2},
    "gram": {**_UNSIGNED, "degree": 3, "locked": 0},
    "deviation": {**_UNSIGNED, "degree": 2, "locked": 0},
}
# Largest number of blocks of one shape: even and odd under conjugation.
_BLOCKS_OF_A_SHAPE = 2

# A t and a spectrum (A, B, C) that are proved at once, because A is large.
_SOME_T = 0.3
_SOME_SPECTRUM: Spectrum = (1e3, 0.0, 0.0)
# The conditions at this t. A reader needs only which vectors they act on, that is
# `WorstCaseCondition.lowered`, which is the same for all t.
_CONDITIONS_AT_SOME_T = {
    **worst_case_conditions(joints=7, t=_SOME_T, spectrum=_SOME_SPECTRUM),
    **lever_conditions(),
}


def read_any(path: Path | str) -> Any:
    """Return the certificate in a file: of a bound, of existence or of nonexistence.

    FileError if it cannot be read, CertificateError if it is ill-formed.
    """
    value = loaded(path, FILE_BYTES)
    if isinstance(value, dict) and value.get("quantity") == QUANTITY:
        return LeverCertificate.read(Part(value))
    if isinstance(value, dict) and "quantity" in value:
        return _certificate(Part(value))
    return read_certificate(path)


def _certificate(part: Part) -> BoundCertificate:
    """Return the certificate of a whole file, a bound; CertificateError if it is ill-formed."""
    quantity = part.value["quantity"]
    if quantity not in get_args(CertifiedQuantity):
        part.refuse(f"quantity: {shown(quantity)} is not known")
    excludes = quantity == "max-min"
    names = FIELDS + ADDED[quantity]
    found = dict(zip(("format", *names), part.fields("format", *names), strict=True))
    if found["format"].value != FORMAT:
        found["format"].refuse(f"{shown(found['format'].value)} is not {FORMAT!r}")
    joints = found["joints"].whole(_JOINTS[quantity])
    t: float | None = None
    spectrum: Spectrum | None = None
    if excludes:
        t = found["excluded"].number(_LARGEST)
        # The square of eq. (6): nothing above it has to be excluded.
        if t < _LEAST_EXCLUDED or Fraction(t) > Fraction(1, 3):
            found["excluded"].refuse(f"{t} is not from {_LEAST_EXCLUDED:g} to 1/3")
        a, b, c = (one.number(_LARGEST) for one in found["spectrum"].items(range(3, 4)))
        spectrum = (a, b, c)
        try:
            spectral_limit(t, spectrum)
        except InputError as error:
            found["spectrum"].refuse(str(error).rstrip("."))
    return BoundCertificate(
        quantity=quantity,
        joints=joints,
        bound=found["bound"].number(_LARGEST),
        constant=found["constant"].number(_LARGEST),
        sums={name: _sectors(found[name], joints, name) for name in names if name in _LIMITS},
        excluded=t,
        spectrum=spectrum,
    )


def _sectors(part: Part, joints: int, name: str) -> tuple[SectorSquares, ...]:
    """Read the sectors under one name, a key of `_LIMITS`."""
    found = tuple(_sector(one, joints, name) for one in part.items(range(_SECTORS + 1)))
    _require_distinct(part, [sector for sector, _ in found])
    return found


def _sector(part: Part, joints: int, name: str) -> SectorSquares:
    """Read one sector with its blocks."""
    limits = _LIMITS[name]
    *parts, listed = part.fields(*limits, "blocks")
    numbers = {
        key: number.whole(range(most + 1))
        for (key, most), number in zip(limits.items(), parts, strict=True)
    }
    try:
        sector = RowSector(
            odd=numbers.get("odd"),
            charge=numbers["charge"],
            spin=numbers["spin"],
            degree=numbers["degree"],
            locked=numbers.get("locked"),
        )
    except InputError as error:
        part.refuse(str(error).rstrip("."))
    family = BlockFamily(sector, joints, _CONDITIONS_AT_SOME_T.get(name))
    shapes_of_groups = [tuple(partitions(len(group))) for group in sector.groups(joints)]
    shapes = set(product(*shapes_of_groups))
    parts = listed.items(range(_BLOCKS_OF_A_SHAPE * len(shapes) + 1))
    blocks = tuple(_block(one, family, shapes) for one in parts)
    seen = Counter(block.shapes for block in blocks)
    if max(seen.values(), default=0) > _BLOCKS_OF_A_SHAPE:
        listed.refuse("more than two have the same shapes")
    return sector, blocks


def _block(part: Part, family: BlockFamily, shapes: AbstractSet[Shapes]) -> BlockSquares:
    """Read one block of a sector.

    `family` has the plain rows of the sector, and `shapes` are all that it can have.
    """
    named, listed, count, factor = part.fields("shapes", "rows", "squares", "factor")
    found = named.read(Shapes)
    if found not in shapes:
        named.refuse("they are none of this sector")
    tableaux = len(tableau_contents(found))
    # Numbers of plain rows.
    lengths = {entry.group_labels: entry.length for entry in family.rows}
    rows: dict[LabelSet, tuple[int, ...]] = {}
    read = []
    for one in listed.items(range(1, len(lengths) + 1)):
        labels, pivots = one.fields("labels", "pivots")
        name = labels.read(LabelSet)
        if name not in lengths:
            labels.refuse("they are none of this sector")
        length = lengths[name]
        # All tableaux have as many independent rows: no more pivots than this can be.
        items = pivots.items(range(1, length // tableaux + 1))
        rows[name] = tuple(pivot.whole(range(length)) for pivot in items)
        _require_distinct(pivots, rows[name])
        read.append(name)
    _require_distinct(listed, read)
    # The number of rows of the factor follows from the rest.
    without_factor = BlockSquares(shapes=found, rows=rows, factor=np.zeros((0, 0)))
    height = len(without_factor.selection(family).rows)
    squares = count.whole(range(1, height + 1))
    return replace(without_factor, factor=_matrix(factor, (height, squares)))


def _require_distinct(part: Part, values: Sequence[object]) -> None:
    """Refuse a part in which a value occurs twice."""
    if len(set(values)) < len(values):
        part.refuse("one is given twice")


def _matrix(part: Part, shape: tuple[int, int]) -> FloatArray:
    """Read a matrix of doubles of this shape, row after row, from its base64 text."""
    size, value = 8 * shape[0] * shape[1], part.value
    # Base64 has four letters for each three bytes, the last ones filled up.
    letters = 4 * ceil(size / 3)
    if not isinstance(value, str) or len(value) != letters:
        part.refuse(f"not the base64 text of {size} bytes, a matrix of {shape}")
    try:
        content = b64decode(value, validate=True)
    except ValueError as error:
        part.refuse(f"not a base64 text ({error})")
    if len(content) != size:
        part.refuse(f"{len(content)} bytes instead of {size}")
    matrix = np.frombuffer(content, dtype="<f8").reshape(shape).astype(float)
    # NaN fails this, too.
    if not np.all(np.abs(matrix) <= _LARGEST):
        part.refuse(f"an entry is not a number of size up to {_LARGEST:g}")
    return without_tiny(matrix)
