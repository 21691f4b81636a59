"""Standard tableaux, and bases that make block-diagonal what permutations leave as it is.

Representations of S_n are named by partitions of n. The Jucys–Murphy elements
X_k = Σ_{i<k} (i k), k = 2…n, commute, and each standard tableau names one joint eigenspace: the
eigenvalue of X_k is the content (column minus row) of the box in which k stands. A symmetric
matrix that commutes with all permutations falls into one block per standard tableau, and
tableaux of one shape give equal blocks. So one tableau of each shape is enough.
"""

from collections.abc import Callable, Iterator
from itertools import combinations
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from nlp.arrays import FloatArray

Shape: TypeAlias = tuple[int, ...]
IntArray: TypeAlias = NDArray[np.int64]


def partitions(n: int, largest: int | None = None) -> Iterator[Shape]:
    """Give the partitions of n, the largest parts first."""
    if n == 0:
        yield ()
    for part in range(n if largest is None else min(n, largest), 0, -1):
        yield from ((part, *rest) for rest in partitions(n - part, part))


def row_reading_contents(shape: Shape) -> tuple[int, ...]:
    """Return the contents of 2…n in the tableau that is filled row after row."""
    return tuple(column - row for row, part in enumerate(shape) for column in range(part))[1:]


def standard_tableaux(shape: Shape) -> list[tuple[int, ...]]:
    """Return the standard tableaux of a shape, each as the contents of 2…n."""
    if sum(shape) < 2:
        return [()]
    corners = [row for row, part in enumerate(shape) if part > max(shape[row + 1 :], default=0)]
    return [
        (*contents, shape[row] - 1 - row)
        for row in corners
        for contents in standard_tableaux((*shape[:row], shape[row] - 1, *shape[row + 1 :]))
    ]


def adapted_bases(n: int, images: Callable[[IntArray], IntArray]) -> dict[Shape, FloatArray]:
    """Return for each shape an orthonormal basis of what belongs to its row-reading tableau.

    Parameters
    ----------
    n
        Number of objects that are permuted.
    images
        The action: from permutations of the objects, shape (g, n), to those of the rows,
        shape (g, rows).

    Returns
    -------
    dict
        Shape to a matrix (rows, multiplicity); shapes that do not occur are left out.
    """
    exchanged = list(combinations(range(n), 2))
    transpositions = np.tile(np.arange(n), (len(exchanged), 1))
    for permutation, (i, k) in zip(transpositions, exchanged, strict=True):
        permutation[[i, k]] = k, i
    # Contents of k are between 1 − k and k − 1, so that with these weights, a mixed radix, the
    # eigenvalues of Σ w_k X_k are whole and differ from tableau to tableau.
    weights = np.cumprod([1, *range(3, 2 * n - 2, 2)])
    moved = images(transpositions)
    rows = moved.shape[1]
    places = moved.ravel(), np.tile(np.arange(rows), len(moved))
    entries = np.repeat([float(weights[k - 1]) for _, k in exchanged], rows)
    operator = coo_array((entries, places), shape=(rows, rows)).tocsr()
    orbits, orbit_of = connected_components(operator, directed=False)
    parts: dict[Shape, list[FloatArray]] = {shape: [] for shape in partitions(n)}
    for orbit in (np.flatnonzero(orbit_of == number) for number in range(orbits)):
        values, vectors = np.linalg.eigh(operator[orbit][:, orbit].toarray())
        for shape, bases in parts.items():
            chosen = np.abs(values - weights @ row_reading_contents(shape)) < 0.5
            bases.append(np.zeros((rows, int(chosen.sum()))))
            bases[-1][orbit] = vectors[:, chosen]
    adapted = {shape: np.hstack(bases) for shape, bases in parts.items()}
    return {shape: basis for shape, basis in adapted.items() if basis.shape[1]}
