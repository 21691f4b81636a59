"""Rows of the moment matrix, sorted by symmetry and without those that the equations make zero.

Permuting joints permutes monomials and leaves averaged moments as they are. In the joint
eigenvectors of the Jucys–Murphy elements the moment matrix falls into blocks, one per standard
tableau, and tableaux of one shape give equal blocks: one per shape is enough, with as many rows
as the representation has copies. On the rows that are orthogonal to the equations the moment
matrix of a true solution is positive semidefinite and may be definite.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from formulations.existence.equations import CHARGE, Frame, Polynomial, times
from formulations.existence.graphs import Monomial
from formulations.existence.relaxation.numbered_monomials import Integers, RowSector
from formulations.existence.relaxation.tableaux import (
    Shape,
    all_contents,
    partitions,
    row_reading_contents,
)
from nlp.arrays import FloatArray
from nlp.errors import InputError

# Weights of X_2, X_3, … for which Σ w_k X_k has another eigenvalue on every standard tableau.
_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23)
_SMALLEST_GAP = 1e-4
# Singular values of the equations' rows below this are rounding.
_RANK_TOLERANCE = 1e-8


@dataclass(frozen=True, eq=False)
class RowBasis:
    """Orthonormal rows of one charge and one representation, equations taken out.

    Parameters
    ----------
    shape
        The partition that names the representation of the symmetric group.
    copies
        How often the representation occurs among the monomials.
    rows
        The basis, shape (rows of the sector, block size).
    doubt
        Largest singular value taken for zero over the smallest taken for nonzero; far below 1
        if the number of rows is certain.
    """

    shape: Shape
    copies: int
    rows: FloatArray
    doubt: float


def row_bases(sector: RowSector, frame: Frame) -> list[RowBasis]:
    """Return the rows of one charge, per representation, without those that are zero.

    Parameters
    ----------
    sector
        The rows of one charge.
    frame
        The Jacobians whose equations are taken out.
    """
    bases = adapted_rows(sector)
    together = np.hstack(list(bases.values()))
    vanishing = [
        np.asarray(values) @ together[numbers]
        for numbers, values in equation_rows(sector, frame)
    ]
    stacked = np.array(vanishing).reshape(-1, together.shape[1])
    ends = np.cumsum([basis.shape[1] for basis in bases.values()])[:-1]
    parts = np.split(stacked, ends, axis=1)
    return [
        _without(shape, basis, part)
        for (shape, basis), part in zip(bases.items(), parts, strict=True)
    ]


def _without(shape: Shape, basis: FloatArray, vanishing: FloatArray) -> RowBasis:
    """Return the part of a basis that is orthogonal to vanishing rows given in it."""
    copies = basis.shape[1]
    padded = np.vstack([vanishing, np.zeros((copies, copies))])
    _, singular, vectors = np.linalg.svd(padded, full_matrices=False)
    rank = int((singular > _RANK_TOLERANCE).sum())
    dropped = float(singular[rank:].max(initial=0.0))
    kept = float(singular[:rank].min(initial=np.inf))
    return RowBasis(shape, copies, basis @ vectors[rank:].T, dropped / kept)


def adapted_rows(sector: RowSector) -> dict[Shape, FloatArray]:
    """Return for each shape an orthonormal basis of the eigenspace of one of its tableaux.

    Parameters
    ----------
    sector
        The rows.

    Returns
    -------
    dict
        Shape of the partition to a matrix (rows of the sector, multiplicity). Shapes that do
        not occur are left out.

    Raises
    ------
    InputError
        If there are more than 9 joints.
    """
    joints = sector.multisets.joints
    pairs = list(combinations(range(joints), 2))
    swaps = np.tile(np.arange(joints), (len(pairs), 1))
    for swap, (i, j) in zip(swaps, pairs, strict=True):
        swap[[i, j]] = j, i
    weights = np.sqrt(_PRIMES[: joints - 1])
    # The transposition (i j), i < j, is part of X_{j+1}, counted from 1.
    swap_weights = [weights[j - 1] for _, j in pairs]
    wanted = _eigenvalues(joints, weights)
    found: dict[Shape, list[FloatArray]] = {shape: [] for shape in wanted}
    for p, q in sector.types:
        images = sector.images(p, q, swaps)
        for orbit in _orbits(images):
            operator = np.zeros((len(orbit), len(orbit)))
            for image, weight in zip(images[:, orbit], swap_weights, strict=True):
                operator[np.searchsorted(orbit, image), np.arange(len(orbit))] += weight
            values, vectors = np.linalg.eigh(operator)
            for shape, eigenvalue in wanted.items():
                chosen = np.abs(values - eigenvalue) < 0.5 * _SMALLEST_GAP
                basis = np.zeros((sector.length, int(chosen.sum())))
                basis[sector.offset(p, q) + orbit] = vectors[:, chosen]
                found[shape].append(basis)
    bases = {shape: np.hstack(parts) for shape, parts in found.items()}
    return {shape: basis for shape, basis in bases.items() if basis.shape[1]}


def _eigenvalues(joints: int, weights: FloatArray) -> dict[Shape, float]:
    """Return the eigenvalue of Σ w_k X_k for one tableau of each shape."""
    spectrum = np.sort([np.dot(weights, contents) for contents in all_contents(joints)])
    if np.diff(spectrum).min(initial=np.inf) < _SMALLEST_GAP:
        raise InputError(
            "joints", joints, "up to 9: the weights do not distinguish more tableaux"
        )
    return {
        shape: float(np.dot(weights, row_reading_contents(shape)))
        for shape in partitions(joints)
    }


def _orbits(images: Integers) -> list[Integers]:
    """Return the orbits of a group from the images under its generators, each ascending."""
    least = np.arange(images.shape[1])
    while True:
        spread = np.minimum(least, least[images].min(axis=0))
        if (spread == least).all():
            return [np.flatnonzero(least == root) for root in np.unique(least)]
        least = spread


def equation_rows(sector: RowSector, frame: Frame) -> Iterator[tuple[list[int], list[float]]]:
    """Give every multiple of an equation that fits into a sector, as numbers and coefficients.

    As vectors of rows they are in the kernel of every moment matrix that obeys the equations.

    Parameters
    ----------
    sector
        The rows.
    frame
        The Jacobians whose equations are meant.
    """
    order = sector.multisets.order
    for polynomial, charge in _equations(frame):
        degree = max(monomial.degree for monomial in polynomial)
        for monomial in _monomials(sector, sector.charge - charge, order - degree):
            terms = times(monomial, polynomial)
            yield (
                [sector.number(term) for term in terms],
                [float(value) for value in terms.values()],
            )


def _equations(frame: Frame) -> Iterator[tuple[Polynomial, int]]:
    """Give every equation and, if it is another, its conjugate; each with its charge."""
    for equation in frame.equations():
        polynomial, charge = frame.polynomial(equation), CHARGE[equation.kind]
        if not polynomial:
            continue
        yield polynomial, charge
        if charge:
            yield {term.conjugate(): value for term, value in polynomial.items()}, -charge


def _monomials(sector: RowSector, charge: int, degree: int) -> Iterator[Monomial]:
    """Give every monomial of a charge, up to a degree."""
    edges = sector.multisets.edges
    for total in range(abs(charge), degree + 1, 2):
        p = (total + charge) // 2
        for w in sector.multisets.members[p]:
            for wbar in sector.multisets.members[total - p]:
                yield Monomial(tuple(edges[e] for e in w), tuple(edges[e] for e in wbar))
