"""Verify the certificate of a bound, without the solver and the relaxation that found it.

Only definitions are shared with the search: sectors of rows, Wigner functions, coupling, the
values of rows, Krylov vectors, and the limit of the residual. The sums are those of the file,
whatever they are; with all rounding bounded, the difference of the two sides is evaluated at
points of the verifier's own choice, where it determines an invariant polynomial everywhere
(docs/bounds.md, sections 3 and 4).

- objective: a function of the configuration x, see `_OBJECTIVES`: the residual ρ, the lever
  defect, or 0 for max-min;
- constant b, and sums: numbers and squares of the certificate, see `BoundCertificate`. Every
  sum is ≥ 0 where its condition holds;
- f = objective − b − Σ sums: an invariant polynomial, which would be 0 without rounding;
- defect: a bound on |f| everywhere. So objective ≥ b − defect where all conditions hold;
- sector, block: see `row_sectors` and `sampled_blocks`. Nothing here has a unit.
"""

from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from fractions import Fraction
from functools import cache, partial
from math import inf, nextafter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lockedjoint.formulations.bounds.moments import enclosed_sums
from lockedjoint.formulations.bounds.moments.certificate import (
    BlockSquares,
    BoundCertificate,
    CertifiedQuantity,
    SectorSquares,
)
from lockedjoint.formulations.bounds.moments.characters import invariant_dimension
from lockedjoint.formulations.bounds.moments.conditions import WITH_SIGNS, residual
from lockedjoint.formulations.bounds.moments.enclosed_matrix import (
    EXTENDED_UNIT,
    SAFETY,
    UNIT,
    EnclosedMatrix,
    gamma,
    require_extended_precision,
)
from lockedjoint.formulations.bounds.moments.enclosed_squares import enclosed_block
from lockedjoint.formulations.bounds.moments.invariants import (
    InvariantBasis,
    invariant_basis,
)
from lockedjoint.formulations.bounds.moments.lever_conditions import lever_defect
from lockedjoint.formulations.bounds.moments.rotations import random_rotations
from lockedjoint.formulations.bounds.moments.row_sectors import RowSector
from lockedjoint.formulations.bounds.moments.sampled_blocks import BlockFamily
from lockedjoint.formulations.bounds.moments.symmetric_rows import AdaptedRows, BlockPart
from lockedjoint.formulations.bounds.moments.tableaux import tableau_bases
from lockedjoint.formulations.bounds.rational_roots import root_above
from lockedjoint.formulations.bounds.revolute_exclusions import (
    excludes_isotropic_levers,
    least_excluded,
)
from lockedjoint.formulations.existence.certificate import CertificateError
from lockedjoint.nlp.arrays import FloatArray, Rng, one_blas_thread
from lockedjoint.nlp.executors import in_groups
from lockedjoint.nlp.progress import part_of

# Degree in J that a condition adds to that of two of its rows, by its name; others add 0. It is
# the degree of what multiplies the squares of rows, or of a matrix on vectors w_a together with
# two of these vectors.
_ADDED_DEGREE = {
    "scaled": 4,  # ρ
    "krylov": 4,  # J_f J_fᵀ − tI on j_f
    "spectral": 6,  # tr E³
    "near": 2,  # |s|²
    "unsigned_scaled": 4,  # ρ
    "gram": 2,  # J_fᵀJ_f − tI on (1, …, 1)
    "deviation": 4,  # δ₀M − ssᵀ on j_f
    "turned": 4,  # ‖C‖² − ‖H‖²
    "aligned": 8,  # |tr HC|² − ‖H‖⁴
    "narrow": 4,  # the lever defect
}
# Number of random configurations for each invariant from which points are chosen. More give
# better points, and take more time.
_CANDIDATES_PER_INVARIANT = 1.6
# Number of configurations in addition, for few invariants.
_MORE_CANDIDATES = 10
# Number of points for each invariant. With more the defect is smaller, and the sums take more
# time.
_POINTS_PER_INVARIANT = 1.16
# Number of points in addition, for few invariants.
_MORE_POINTS = 5
# Degree of the residual in J: the least degree for which invariants are counted.
_RESIDUAL_DEGREE = 4
# Share of a verification that is done when the basis is proved.
_BASIS = 0.3
# The dimension of V is counted once for each size.
_dimension = cache(invariant_dimension)
# These functions have a lower bound, by quantity; max-min has none.
_OBJECTIVES = {"residual": residual, "isotropy": lever_defect}


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
    #: The numbers of the proof, by the names of `_identity_defect`; and ``lever_defect`` for
    #: isotropy, ``excluded`` and ``margin`` = defect − b, below 0 where t is excluded, for
    #: max-min.
    check: Mapping[str, float]

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for the command line and JSON."""
        return asdict(self)


@one_blas_thread()
def verify_bound(
    certificate: BoundCertificate,
    *,
    rng: Rng = 0,
    executor: Executor | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> VerifiedBound:
    """Prove the bound that a certificate states.

    Parameters
    ----------
    certificate
        What is to be proved, well-formed as `certificate_reader` returns it.
    rng
        Seed of the random configurations. The claim is proved with any; the default makes the
        same points everywhere.
    executor
        Where the sums of each sector are evaluated, by default in this process.
    progress
        Is told how far the proof is.

    Raises
    ------
    CertificateError
        If the squares prove less than what is stated.
    NoBasisError
        If the points do not determine the invariants.
    NoExtendedPrecisionError
        If ``numpy.longdouble`` has fewer than 64 significant bits.
    """
    require_extended_precision()
    degrees = degrees_of(
        {name: [one for one, _ in own] for name, own in certificate.sums.items()}
    )
    dimension = _dimension(certificate.joints, *degrees)
    generator = np.random.default_rng(rng)
    count = round(_CANDIDATES_PER_INVARIANT * dimension) + _MORE_CANDIDATES
    candidates = random_rotations(generator, count, certificate.joints, extended=True)
    first, last = part_of(progress, 0.0, _BASIS), part_of(progress, _BASIS, 1.0)
    first(f"a basis of {dimension} invariants")
    points = round(_POINTS_PER_INVARIANT * dimension) + _MORE_POINTS
    basis, rotations = invariant_basis(candidates, degrees, dimension, points, executor, first)
    check = _identity_defect(certificate, basis, rotations, executor, last)
    # The objective is nowhere below `proved`.
    proved = nextafter(certificate.constant - check["defect"], -inf)
    if certificate.quantity == "residual":
        conclusion = _of_residual(certificate, proved)
    elif certificate.excluded is None:
        conclusion = _of_isotropy(certificate, proved)
    else:
        conclusion = _of_max_min(certificate, certificate.excluded, proved)
    bound, check = conclusion.bound, {**conclusion.figures, **check}
    name, stated = certificate.quantity, certificate.bound
    # `enough` is false for NaN as well.
    if not conclusion.enough:
        sign = conclusion.sign
        raise CertificateError(
            f"the file states {name} {sign} {stated}, but its squares prove only {name} {sign} "
            f"{bound}."
        )
    held = (block for own in certificate.sums.values() for _, blocks in own for block in blocks)
    squares = sum(block.factor.shape[1] for block in held)
    return VerifiedBound(name, certificate.joints, stated, bound, squares, check)


class _Conclusion(NamedTuple):
    """What follows for the quantity of a certificate.

    Attributes
    ----------
    bound
        The bound that is proved.
    enough
        Whether it proves what the certificate states.
    sign
        ``"≥"`` for a bound from below, ``"≤"`` for one from above.
    figures
        Numbers for the report, by name.
    """

    bound: float
    enough: bool
    sign: str
    figures: dict[str, float]


def _of_residual(certificate: BoundCertificate, proved: float) -> _Conclusion:
    """Conclude from `proved`, which is a lower bound of the residual ρ itself."""
    return _Conclusion(proved, proved >= certificate.bound, "≥", {})


def _of_isotropy(certificate: BoundCertificate, proved: float) -> _Conclusion:
    """Conclude from `proved`, a lower bound of the lever defect: it excludes large σ.

    σ is the worst case after one locked joint.
    """
    # The maximum is 0 for NaN: the order of the arguments matters.
    least = max(0.0, proved)
    bound = least_excluded(excludes_isotropic_levers, least)
    excluded = excludes_isotropic_levers(least, certificate.bound)
    enough = certificate.bound > 0 and excluded
    return _Conclusion(bound, enough, "≤", {"lever_defect": proved})


def _of_max_min(certificate: BoundCertificate, excluded: float, proved: float) -> _Conclusion:
    """Conclude from `proved`, a lower bound of 0 wherever the worst case σ has σ² ≥ t.

    t is `excluded`. All sums of the file are ≥ 0 there. So `proved` > 0 is a contradiction: no
    J has σ² ≥ t, and σ ≤ √t. Otherwise nothing is left but eq. (6), σ² ≤ (n − 6)/3.
    """
    impossible = proved > 0
    known = Fraction(excluded) if impossible else Fraction(certificate.joints - 6, 3)
    bound = root_above(known)
    enough = impossible and certificate.bound >= bound
    return _Conclusion(bound, enough, "≤", {"excluded": excluded, "margin": -proved})


def degrees_of(sectors: Mapping[str, Iterable[RowSector]]) -> tuple[int, int]:
    """Return d and d' of V: the largest degrees in J of the objective and the sums.

    `sectors` has those of a certificate by the name of their condition. d is of the sums that
    keep their values when a column changes its sign, and at least that of the residual. d' is
    of the sums whose rows change with the signs, those of the conditions in `WITH_SIGNS`; it is
    0 without any.
    """
    without_signs, with_signs = [_RESIDUAL_DEGREE], [0]
    for name, own in sectors.items():
        degrees = with_signs if name in WITH_SIGNS else without_signs
        degrees += [2 * sector.degree + _ADDED_DEGREE.get(name, 0) for sector in own]
    return max(without_signs), max(with_signs)


def _identity_defect(
    certificate: BoundCertificate,
    basis: InvariantBasis,
    rotations: FloatArray,
    executor: Executor | None,
    progress: Callable[[str], None],
) -> dict[str, float]:
    """Bound |f| everywhere, from its values at the points of the basis.

    `rotations` are these points, shape (points, joints, 3, 3). `certificate.sums` has, by the
    name of a condition, pairs of a sector and its blocks. Inside, `values` are those of f at
    the points, `errors` bound their errors and `sizes` the sums of absolute values of all
    terms, each of the shape (points,).

    Returns
    -------
    dict
        ``largest_value`` and ``largest_error``: of |f| at the points; ``amplification`` and
        ``basis_defect``: see `InvariantBasis`; ``defect``: the bound on |f|.
    """
    values: NDArray[Any] = np.zeros(len(rotations), np.longdouble)
    errors = np.zeros(len(rotations))
    if certificate.quantity in _OBJECTIVES:
        objective = _OBJECTIVES[certificate.quantity](EnclosedMatrix.jacobian(rotations))
        values, errors = objective.values[:, 0, 0], objective.errors
    sizes = np.abs(values).astype(float) + abs(certificate.constant)
    values = values - certificate.constant
    named = [(name, one) for name, own in certificate.sums.items() for one in own]
    calls = [(number, *one) for number, one in enumerate(named)]
    work = partial(_sector_sum, replace(certificate, sums={}), rotations)
    name = "sums evaluated with error bounds"
    families = dict(in_groups(work, calls, executor, progress, name))
    # The order is the same with any executor.
    for _, part in sorted(families.items()):
        values = values - part.values
        errors = errors + part.errors
        sizes = sizes + part.sizes
    # Sums cancel: they are added up in extended precision, and rounded at the end.
    errors = errors + gamma(len(families) + 5, EXTENDED_UNIT) * sizes
    values = values.astype(float)
    errors = SAFETY * (errors + UNIT * np.abs(values))
    return {
        "largest_value": float(np.abs(values).max()),
        "largest_error": float(errors.max()),
        "amplification": basis.amplification,
        "basis_defect": basis.defect,
        "defect": basis.largest_value(values, errors),
    }


def _sector_sum(
    certificate: BoundCertificate,
    rotations: FloatArray,
    number: int,
    name: str,
    squares: SectorSquares,
) -> tuple[int, enclosed_sums.EnclosedSum]:
    """Return `number`, by which the sum is known, and the sum of the blocks of one sector.

    `name` is that of the condition, `rotations` has the shape (points, joints, 3, 3). Of the
    certificate only joints and conditions are used, so that little goes to other processes.
    """
    sector, blocks = squares
    family = BlockFamily(sector, certificate.joints, certificate.conditions.get(name))
    enclosed = [enclosed_block(family, _adapted(family, one), one.factor) for one in blocks]
    return number, enclosed_sums.enclosed_sum(family, enclosed, rotations)


def _adapted(family: BlockFamily, squares: BlockSquares) -> AdaptedRows:
    """Return the rows of a block in all tableaux, from the pivots in the file.

    Column i of the projector P on the first tableau is made by `tableau_bases` from the unit
    vector e_i, for each pivot i.
    """
    numbers = {rows.group_labels: number for number, rows in enumerate(family.rows)}
    parts = []
    for (labels, pivots), columns in zip(squares.rows.items(), squares.columns, strict=True):
        rows = family.rows[numbers[labels]]
        chosen = np.eye(rows.length)[:, list(pivots)]
        bases = tableau_bases(chosen, rows.exchanges, rows.groups, squares.shapes)
        parts.append(BlockPart(numbers[labels], columns, bases))
    tableaux = len(parts[0].coefficients)
    return AdaptedRows(squares.shapes, tuple(parts), squares.size, tableaux)
