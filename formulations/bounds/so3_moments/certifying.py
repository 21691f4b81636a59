"""A rigorous bound: the certificate of what a search found, verified from its file.

The squares of the certificate are factors L of the solver's multipliers, with P e_i in place of
the rows of the search (see `certificate`). Nothing of the search is part of the proof: what is
reported is what `verification` proves from the text of the file.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from math import floor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeAlias

import numpy as np
import scipy.linalg

from formulations.bounds.closed_form import root_above
from formulations.bounds.so3_moments.certificate import (
    BlockSquares,
    BoundCertificate,
    SectorSquares,
    read_any,
)
from formulations.bounds.so3_moments.enclosed_squares import require_extended_precision
from formulations.bounds.so3_moments.global_bound import Evidence
from formulations.bounds.so3_moments.moment_program import refined_multipliers
from formulations.bounds.so3_moments.relaxation import Progress, SolvedRelaxation
from formulations.bounds.so3_moments.sampled_blocks import (
    RowBlocks,
)
from formulations.bounds.so3_moments.symmetric_rows import AdaptedRows
from formulations.bounds.so3_moments.verification import verify_bound
from formulations.bounds.so3_moments.young_basis import Shapes, first_tableau
from formulations.existence.certificate import CertificateError
from formulations.io.files import prepare_file, write_text
from nlp.arrays import FloatArray, semidefinite_root

# Singular values of bases below this, relative, are 0.
_RANK = 1e-6
_HOW_CHECKED = (
    "certificate verified from its file: a sum of squares or localisers by construction; its "
    "difference from what it should be is an invariant polynomial, bounded everywhere by its "
    "values at points, all rounding bounded"
)
# What a certificate of the residual states before it is verified: nothing, as ρ ≥ 0. Afterwards
# what was proved, less a share of δ, rounded down to so many digits.
_NOTHING, _SHARE, _DIGITS = -1.0, 0.1, 8
# For shapes and number of labels: pivots i, and the left inverse of the P e_i.
_Frames: TypeAlias = Mapping[tuple[Shapes, int], tuple[tuple[int, ...], FloatArray]]


def prepare_proof(out: Path | None) -> None:
    """Refuse, before any work, a machine without extended precision or an impossible file."""
    require_extended_precision()
    prepare_file(out)


def verify_search(
    solved: SolvedRelaxation,
    joints: int,
    progress: Progress,
    out: Path | None,
    *,
    excluded: float | None = None,
) -> tuple[float, Evidence]:
    """Write the certificate of a search to a file, verify it from there, and say how it went.

    The certificate states √`excluded`, or on the residual what was proved, less a share of what
    is lost to rounding, since elsewhere more may be lost; its constant is the dual value of the
    identity. It is kept in `out`, if it proves what it states; CertificateError else. Returns
    the bound that it states, and the evidence.
    """
    multipliers = refined_multipliers(solved.program, solved.multipliers)
    constant = solved.identity.dual_value(multipliers)
    if excluded is not None and constant <= 0:
        raise CertificateError(f"σ² ≥ {excluded} is not excluded: there is no certificate.")
    stated = _NOTHING if excluded is None else root_above(Fraction(excluded))
    certificate = search_certificate(
        solved.families, multipliers, constant, stated, joints, excluded
    )
    with TemporaryDirectory() as folder:
        path = Path(folder) / "bound.json"
        path.write_text(certificate.to_json(), encoding="utf-8")
        verified = verify_bound(read_any(path), progress=progress)
    if excluded is None:
        surely = verified.bound - _SHARE * verified.check["defect"]
        stated = floor(surely * 10**_DIGITS) / 10**_DIGITS
    if out is not None:
        write_text(out, replace(certificate, bound=stated).to_json())
    check = {"constant": certificate.constant, "verified": verified.bound, **verified.check}
    return stated, solved.evidence(_HOW_CHECKED, check, multipliers, phase="verification")


def search_certificate(
    families: Sequence[RowBlocks],
    multipliers: Sequence[FloatArray],
    constant: float,
    bound: float,
    joints: int,
    excluded: float | None = None,
) -> BoundCertificate:
    """Return the certificate of a bound, from multipliers X of the blocks B of a search.

    They make ρ − `constant` = Σ ⟨X, B(x)⟩; of max-min, where there is a worst case t =
    `excluded`, −`constant` = Σ ⟨X, B(x)⟩.
    """
    parts: dict[str, list[SectorSquares]] = {"sectors": [], "scaled": [], "krylov": []}
    remaining = iter(multipliers)
    for family in families:
        name = "scaled" if family.factor else "krylov" if family.form else "sectors"
        parts[name] += _squares(family, [next(remaining) for _ in family.blocks])
    return BoundCertificate(
        "residual" if excluded is None else "max-min",
        joints,
        bound,
        constant,
        excluded=excluded,
        **{name: tuple(squares) for name, squares in parts.items()},
    )


def _squares(family: RowBlocks, multipliers: Sequence[FloatArray]) -> list[SectorSquares]:
    """Return the squares of a family, nothing if all its multipliers are 0."""
    frames = _frames(family)
    blocks = []
    for block, multiplier in zip(family.blocks, multipliers, strict=True):
        root = semidefinite_root(multiplier)
        factor = root[:, root.any(axis=0)]
        if factor.size:
            blocks.append(_block_squares(family, block, factor, frames))
    return [(family.sector, tuple(blocks))] if blocks else []


def _frames(family: RowBlocks) -> _Frames:
    """Return the frames of a family.

    Blocks that are even and odd under conjugation share what belongs to the first tableau.
    """
    together: dict[tuple[Shapes, int], list[FloatArray]] = {}
    for block in family.blocks:
        start = first_tableau(block.shapes)
        for number, _, coefficients in block.parts:
            together.setdefault((block.shapes, number), []).append(coefficients[start])
    frames = {}
    for key, parts in together.items():
        vectors, values, _ = np.linalg.svd(np.hstack(parts), full_matrices=False)
        vectors = vectors[:, values > _RANK * values[0]]
        order = scipy.linalg.qr(vectors.T, mode="r", pivoting=True)[1]
        pivots = sorted(int(i) for i in order[: vectors.shape[1]])
        # P = vectors · vectorsᵀ.
        frames[key] = tuple(pivots), np.linalg.inv(vectors[pivots].T) @ vectors.T
    return frames


def _block_squares(
    family: RowBlocks, block: AdaptedRows, factor: FloatArray, frames: _Frames
) -> BlockSquares:
    """Return the same squares with P e_i in place of the block's own rows."""
    start = first_tableau(block.shapes)
    changes: dict[int, FloatArray] = {}
    for number, place, coefficients in block.parts:
        pivots, inverse = frames[block.shapes, number]
        change = changes.setdefault(number, np.zeros((len(pivots), block.size)))
        change[:, place.start : place.stop] += inverse @ coefficients[start]
    rows = {family.rows[n].parts: frames[block.shapes, n][0] for n in changes}
    change = np.vstack(list(changes.values()))
    # The rows of the factor of a localiser are those of r_0, r_1 and r_2.
    chosen, powers = family.selection(block)
    squares = BlockSquares(block.shapes, rows, change)
    allowed, by_power = squares.selection(family)
    parts = []
    for power in range(len(family.lowered)):
        own = np.zeros((block.size, factor.shape[1]))
        own[chosen[powers == power]] = factor[powers == power]
        parts.append((change @ own)[allowed[by_power == power]])
    return BlockSquares(block.shapes, rows, np.vstack(parts))
