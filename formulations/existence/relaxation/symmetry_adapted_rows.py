"""Rows of the moment matrix sorted by the representations of the symmetric group.

Permuting joints permutes monomials and leaves averaged moments as they are. In the joint
eigenvectors of the Jucys–Murphy elements the moment matrix falls into blocks, one per standard
tableau, and tableaux of one shape give equal blocks: one per shape is enough, with as many rows
as the representation has copies.
"""

from __future__ import annotations

from itertools import combinations
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from formulations.existence.relaxation.row_sectors import RowSector
from formulations.existence.relaxation.tableaux import (
    Shape,
    all_contents,
    partitions,
    row_reading_contents,
)
from nlp.errors import InputError

Matrix: TypeAlias = NDArray[np.float64]

# Weights of X_2, X_3, … for which Σ w_k X_k tells all standard tableaux apart.
_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23)
_SMALLEST_GAP = 1e-4


def adapted_rows(sector: RowSector) -> dict[Shape, Matrix]:
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
    swap_weights = np.array([weights[j - 1] for _, j in pairs])
    wanted = _eigenvalues(joints, weights)
    found: dict[Shape, list[Matrix]] = {shape: [] for shape in wanted}
    for p, q in sector.types:
        images = sector.images(p, q, swaps)
        for orbit in _orbits(images):
            values, vectors = _eigenvectors(images[:, orbit], orbit, swap_weights)
            for shape, eigenvalue in wanted.items():
                chosen = np.abs(values - eigenvalue) < 0.5 * _SMALLEST_GAP
                basis = np.zeros((sector.length, int(chosen.sum())))
                basis[sector.offset(p, q) + orbit] = vectors[:, chosen]
                found[shape].append(basis)
    bases = {shape: np.hstack(parts) for shape, parts in found.items()}
    return {shape: basis for shape, basis in bases.items() if basis.shape[1]}


def _eigenvalues(joints: int, weights: NDArray[np.float64]) -> dict[Shape, float]:
    """Return the eigenvalue of Σ w_k X_k for one tableau of each shape."""
    spectrum = np.sort([np.dot(weights, contents) for contents in all_contents(joints)])
    if np.diff(spectrum).min(initial=np.inf) < _SMALLEST_GAP:
        raise InputError(
            "joints", joints, "up to 9: the weights do not tell more tableaux apart"
        )
    return {
        shape: float(np.dot(weights, row_reading_contents(shape)))
        for shape in partitions(joints)
    }


def _orbits(images: NDArray[np.integer]) -> list[NDArray[np.integer]]:
    """Return the orbits of a group from the images under its generators, each ascending."""
    least = np.arange(images.shape[1])
    while True:
        spread = np.minimum(least, least[images].min(axis=0))
        if (spread == least).all():
            return [np.flatnonzero(least == root) for root in np.unique(least)]
        least = spread


def _eigenvectors(
    images: NDArray[np.integer],
    orbit: NDArray[np.integer],
    weights: NDArray[np.float64],
) -> tuple[NDArray[np.float64], Matrix]:
    operator = np.zeros((len(orbit), len(orbit)))
    columns = np.arange(len(orbit))
    for image, weight in zip(images, weights, strict=True):
        operator[np.searchsorted(orbit, image), columns] += weight
    values, vectors = np.linalg.eigh(operator)
    return values, vectors
