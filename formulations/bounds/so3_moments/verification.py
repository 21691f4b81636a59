"""Verify the certificate of a bound, without the solver and the relaxation that found it.

Only definitions are shared with the search: sectors of rows, Wigner functions, coupling, the
values of rows, Krylov vectors, and the limit of the residual. The sums are those of the file,
whatever they are; with all rounding bounded, the difference of the two sides is evaluated at
points of the verifier's own choice, where it determines an invariant polynomial everywhere
(docs/bounds.md, sections 3 and 4).
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from functools import cache
from math import inf, nextafter
from typing import Any

import numpy as np

from formulations.bounds.closed_form import largest_residual, mean_residual, root_above
from formulations.bounds.so3_moments import enclosed_sums
from formulations.bounds.so3_moments.certificate import (
    BlockSquares,
    BoundCertificate,
    CertifiedQuantity,
    SectorSquares,
)
from formulations.bounds.so3_moments.enclosed_squares import (
    SAFETY,
    gamma,
    require_extended_precision,
)
from formulations.bounds.so3_moments.invariants import (
    InvariantBasis,
    invariant_basis,
    invariant_dimension,
)
from formulations.bounds.so3_moments.sampled_blocks import Form, RowBlocks, krylov_form
from formulations.bounds.so3_moments.symmetric_rows import AdaptedRows
from formulations.bounds.so3_moments.wigner import RowSector, random_rotations
from formulations.existence.certificate import CertificateError
from formulations.existence.tableaux import tableau_bases
from nlp.arrays import FloatArray, Rng, one_blas_thread

# Degree that scaling by ρ, or two Krylov vectors and J_f J_fᵀ, adds to that of two rows.
LOCALISED = 4
# Candidates and points for each invariant: as many as determine them well.
_CANDIDATES, _POINTS = 2.9, 1.4
_dimension = cache(invariant_dimension)


@dataclass(frozen=True)
class VerifiedBound:
    """A bound that was proved from a certificate."""

    quantity: CertifiedQuantity
    joints: int
    #: The bound that the certificate states, and the one that was proved, at least as sharp.
    claimed: float
    bound: float
    #: Number of squares and of localised squares.
    squares: int
    #: The parts of the proof: where the identity is off, by how much, and what that allows.
    check: Mapping[str, float]

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for the command line and JSON."""
        return asdict(self)


@one_blas_thread()
def verify_bound(
    certificate: BoundCertificate,
    *,
    rng: Rng = 0,
    progress: Callable[[str], None] = lambda _: None,
) -> VerifiedBound:
    """Prove the bound that a certificate states, or raise CertificateError."""
    require_extended_precision()
    held = (certificate.sectors, certificate.scaled, certificate.krylov)
    degree = degree_of(*([sector for sector, _ in some] for some in held))
    dimension = _dimension(certificate.joints, degree)
    generator, count = np.random.default_rng(rng), round(_CANDIDATES * dimension) + 10
    candidates = random_rotations(generator, count, certificate.joints, extended=True)
    progress(f"proving a basis of the {dimension} invariants of degree {degree}")
    points = round(_POINTS * dimension) + 5
    basis, rotations = invariant_basis(candidates, degree, dimension, points)
    check = _identity_defect(certificate, basis, rotations, progress)
    proved = nextafter(certificate.constant - check["defect"], -inf)
    if certificate.excluded is None:
        bound, enough, sign = proved, proved >= certificate.bound, "≥"
    else:
        # Where σ² ≥ t, all sums are ≥ 0 and so 0 ≥ `proved`. Without that, eq. (6) is left.
        impossible = proved > 0
        known = certificate.excluded if impossible else Fraction(certificate.joints - 6, 3)
        bound, sign = root_above(Fraction(known)), "≤"
        enough = impossible and certificate.bound >= bound
        check = {"excluded": certificate.excluded, "margin": -proved, **check}
    name, stated = certificate.quantity, certificate.bound
    if not enough:  # nor NaN
        raise CertificateError(
            f"the file states {name} {sign} {stated}, but its squares prove only {name} {sign} "
            f"{bound}."
        )
    squares = sum(one.factor.shape[1] for some in held for _, all_ in some for one in all_)
    return VerifiedBound(name, certificate.joints, stated, bound, squares, check)


def degree_of(
    plain: Iterable[RowSector],
    scaled: Iterable[RowSector] = (),
    krylov: Iterable[RowSector] = (),
) -> int:
    """Return the largest degree in J of squares of rows, of localisers, and of the residual."""
    degrees = [4, *(2 * sector.degree for sector in plain)]
    degrees += [2 * sector.degree + LOCALISED for sector in (*scaled, *krylov)]
    return max(degrees)


def _identity_defect(
    certificate: BoundCertificate,
    basis: InvariantBasis,
    rotations: FloatArray,
    progress: Callable[[str], None],
) -> dict[str, float]:
    """Bound |f| = |objective − constant − Σ sums of the file| everywhere: ``defect``."""
    joints, t = certificate.joints, certificate.excluded
    kinds: list[tuple[Sequence[SectorSquares], Form | None, bool]]
    kinds = [(certificate.sectors, None, False)]
    limit, found = 0.0, enclosed_sums.EnclosedSum(*np.zeros((3, len(rotations))))
    if t is None:
        found = enclosed_sums.enclosed_residuals(rotations)
    else:
        # Where the worst case is σ² ≥ t, ρ is below this limit.
        limit = largest_residual(joints, t)
        kinds += [(certificate.scaled, None, True), (certificate.krylov, krylov_form(t), False)]
    families = [
        (RowBlocks(sector, joints, form), blocks, scaled)
        for sectors, form, scaled in kinds
        for sector, blocks in sectors
    ]
    values, errors = found.values - certificate.constant, found.errors
    sizes = found.sizes + abs(certificate.constant)
    for number, (family, blocks, scaled) in enumerate(families, start=1):
        progress(f"evaluating sums with error bounds: {number} of {len(families)}")
        powers = [
            enclosed_sums.enclosed_powers(family, _adapted(family, one), one.factor)
            for one in blocks
        ]
        part = enclosed_sums.enclosed_sum(family, powers, rotations)
        if scaled:
            part = enclosed_sums.enclosed_scaled(limit, mean_residual(joints), part, rotations)
        values = values - part.values
        errors = errors + part.errors
        sizes = sizes + part.sizes
    errors = SAFETY * (errors + gamma(len(families) + 5) * sizes)
    return {
        "largest_value": float(np.abs(values).max()),
        "largest_error": float(errors.max()),
        "amplification": basis.amplification,
        "basis_defect": basis.defect,
        "defect": basis.largest_value(values, errors),
    }


def _adapted(family: RowBlocks, squares: BlockSquares) -> AdaptedRows:
    """Return the rows of a block in all tableaux, see `tableau_bases`."""
    numbers = {entry.parts: number for number, entry in enumerate(family.rows)}
    parts = []
    for (labels, pivots), columns in zip(squares.rows.items(), squares.columns, strict=True):
        entry = family.rows[numbers[labels]]
        chosen = np.eye(entry.length)[:, list(pivots)]
        bases = tableau_bases(chosen, entry.exchanges, entry.places, squares.shapes)
        parts.append((numbers[labels], columns, bases))
    return AdaptedRows(squares.shapes, tuple(parts), squares.size, len(parts[0][2]))
