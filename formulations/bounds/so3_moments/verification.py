"""Verify the certificate of a bound, without the solver and the relaxation that found it.

Only definitions are shared with the search: sectors of rows, Wigner functions, coupling, the
values of rows. The squares are those of the file, whatever they are; with all rounding bounded,
the difference of the two sides is evaluated at points of the verifier's own choice, where it
determines an invariant polynomial everywhere (docs/bounds.md, section 3).
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from math import inf, nextafter
from typing import Any, TypeAlias

import numpy as np

from formulations.bounds.so3_moments.blocks.enclosed_squares import (
    SAFETY,
    EnclosedBlock,
    enclosed_block,
    enclosed_sums,
)
from formulations.bounds.so3_moments.blocks.invariant_basis import invariant_basis
from formulations.bounds.so3_moments.blocks.invariants import invariant_dimension
from formulations.bounds.so3_moments.blocks.sampled_blocks import SectorBlocks
from formulations.bounds.so3_moments.certificate import (
    BlockSquares,
    BoundCertificate,
    CertifiedQuantity,
)
from formulations.bounds.so3_moments.representations.adapted_rows import AdaptedRows
from formulations.bounds.so3_moments.representations.rounding import (
    EXTENDED_UNIT,
    ROTATION_ENTRY,
    UNIT,
    gamma,
    require_extended_precision,
)
from formulations.bounds.so3_moments.representations.row_sectors import RowSector
from formulations.bounds.so3_moments.representations.wigner import (
    jacobians_of,
    random_rotations,
)
from formulations.bounds.so3_moments.representations.young_basis import all_tableaux
from formulations.existence.certificate import CertificateError
from nlp.arrays import FloatArray, Rng, one_blas_thread
from nlp.errors import InputError

# One sector: its rows, and its squares with bounds on what is wrong with them.
EnclosedSector: TypeAlias = tuple[SectorBlocks, list[EnclosedBlock]]
Progress: TypeAlias = Callable[[str], None]

# Candidates and points for each invariant: as many as determine them well.
_CANDIDATES, _POINTS = 2.08, 1.25
_dimension = cache(invariant_dimension)


@dataclass(frozen=True)
class VerifiedBound:
    """A bound that was proved from a certificate.

    Parameters
    ----------
    quantity
        What is bounded, see `BoundCertificate`.
    joints
        Number n of unit revolute joints.
    claimed
        The bound that the certificate states.
    bound
        The bound that was proved, at least as sharp.
    squares
        Number of squares.
    check
        The parts of the proof, see `sum_of_squares_defect`.
    """

    quantity: CertifiedQuantity
    joints: int
    claimed: float
    bound: float
    squares: int
    check: Mapping[str, float]

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for the command line and JSON."""
        return asdict(self)


@one_blas_thread()
def verify_bound(
    certificate: BoundCertificate,
    *,
    rng: Rng = 0,
    progress: Progress = lambda _: None,
) -> VerifiedBound:
    """Prove the bound that a certificate states.

    Parameters
    ----------
    certificate
        The certificate.
    rng
        Seed of the points, or a generator. The proof holds at any points; where they are
        changes the bound in its last digits.
    progress
        Receives a short message at each step.

    Raises
    ------
    CertificateError
        If its squares do not prove the bound that it states.
    NoExtendedPrecisionError
        If this machine has no extended precision.
    """
    require_extended_precision()
    degree = degree_of(sector for sector, _ in certificate.sectors)
    candidates, points = candidate_points(certificate.joints, degree, rng)
    check = sum_of_squares_defect(
        _enclosed(certificate), certificate.constant, candidates, degree, points, progress
    )
    proved = nextafter(certificate.constant - check["defect"], -inf)
    if not proved >= certificate.bound:  # nor NaN
        raise CertificateError(
            f"the file states {certificate.quantity} ≥ {certificate.bound}, but its squares "
            f"prove only {certificate.quantity} ≥ {proved:.9g}."
        )
    squares = sum(block.factor.shape[1] for _, some in certificate.sectors for block in some)
    stated = certificate.bound
    return VerifiedBound(
        certificate.quantity, certificate.joints, stated, proved, squares, check
    )


def degree_of(sectors: Iterable[RowSector]) -> int:
    """Return the largest degree of squares of rows of these sectors, and of the residual."""
    return max((2 * sector.degree for sector in sectors if sector.degree > 2), default=4)


def candidate_points(joints: int, degree: int, rng: Rng = 0) -> tuple[FloatArray, int]:
    """Return candidates for the points, in extended precision, and how many to keep."""
    dimension = _dimension(joints, degree)
    generator = np.random.default_rng(rng)
    count = round(_CANDIDATES * dimension) + 10
    points = round(_POINTS * dimension) + 5
    return random_rotations(generator, count, joints, extended=True), points


def sum_of_squares_defect(
    sectors: Iterable[EnclosedSector],
    constant: float,
    candidates: FloatArray,
    degree: int,
    points: int | None = None,
    progress: Progress = lambda _: None,
) -> dict[str, float]:
    """Bound |f| = |ρ − constant − s̄| over all configurations.

    Parameters
    ----------
    sectors
        Squares of rows of degree at most `degree`/2.
    constant
        The constant b.
    candidates
        Rotations in extended precision, (candidates, n, 3, 3).
    degree
        Largest degree of f, at least 4.
    points
        How many candidates to keep, those that determine the invariants best; all by default.
    progress
        Receives a short message at each step.

    Returns
    -------
    dict
        ``largest_value``, the largest |f| computed at the points, and ``largest_error``, the
        largest bound on its error there; ``amplification``, how much larger f may be
        elsewhere, per unit of root mean square at the points; ``basis_defect``, how far the
        matrix of values may be from its assumed inverse, below 1/2; and ``defect``, δ ≥ |f|.

    Raises
    ------
    InputError
        If the rotations are not in extended precision.
    NoBasisError
        If the points do not determine all invariants.
    """
    if candidates.dtype != np.longdouble:
        raise InputError("candidates", candidates.dtype, "rotations in extended precision")
    dimension = _dimension(candidates.shape[1], degree)
    progress(f"proving a basis of the {dimension} invariants of degree {degree}")
    basis, rotations = invariant_basis(candidates, degree, dimension, points)
    sums, errors = np.zeros(len(rotations)), np.zeros(len(rotations))
    count = 0
    for count, (family, blocks) in enumerate(sectors, start=1):
        progress(f"evaluating sums of squares with error bounds: sector {count}")
        part, wrong = enclosed_sums(family, blocks, rotations)
        sums += part
        errors += wrong
    residuals, wrong = enclosed_residuals(rotations)
    values = residuals - constant - sums
    errors += wrong + gamma(count + 4) * (residuals + abs(constant) + sums)
    errors *= SAFETY
    return {
        "largest_value": float(np.abs(values).max()),
        "largest_error": float(errors.max()),
        "amplification": basis.amplification,
        "basis_defect": basis.defect,
        "defect": basis.largest_value(values, errors),
    }


def enclosed_residuals(rotations: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return ρ = ½‖JJᵀ − (n/3)I‖_F² at each point, and a bound on its rounding error.

    The entries of J are off by `ROTATION_ENTRY` units, those of JJᵀ by the sum over the
    columns, and a square by twice the entry times that.
    """
    jacobians = jacobians_of(rotations)
    joints = jacobians.shape[-1]
    unit = EXTENDED_UNIT if rotations.dtype == np.longdouble else UNIT
    entry = joints * (2.1 * ROTATION_ENTRY * unit + 1.1 * gamma(joints + 4, unit))
    third = rotations.dtype.type(joints) / 3  # off by a unit, relative
    gram = jacobians @ jacobians.swapaxes(-1, -2) - third * np.eye(6)
    square = np.sum(gram**2, axis=(-1, -2))
    whole = 6.0 * entry
    error = np.sqrt(square) * whole + whole**2 + (gamma(40, unit) + UNIT) * square
    return np.asarray(square / 2, float), np.asarray(SAFETY * error, float)


def _enclosed(certificate: BoundCertificate) -> Iterator[EnclosedSector]:
    """Give the squares of each sector, with bounds on what is wrong with them."""
    for sector, blocks in certificate.sectors:
        family = SectorBlocks(sector, certificate.joints)
        yield family, [enclosed_block(family, _adapted(family, b), b.factor) for b in blocks]


def _adapted(family: SectorBlocks, squares: BlockSquares) -> AdaptedRows:
    """Return the rows of a block in all tableaux, from those in the first."""
    numbers = {entry.parts: number for number, entry in enumerate(family.rows)}
    parts = []
    for one in squares.rows:
        number = numbers[one.labels]
        entry = family.rows[number]
        places = entry.places
        exchanges = {joint: entry.exchange(joint) for group in places for joint in group[:-1]}
        bases = all_tableaux(one.basis, exchanges, places, squares.shapes)
        parts.append((number, range(one.first, one.first + one.basis.shape[1]), bases))
    size = len(squares.factor)
    return AdaptedRows(squares.shapes, "mixed", tuple(parts), size, len(parts[0][2]))
