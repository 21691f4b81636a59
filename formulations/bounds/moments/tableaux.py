"""Standard tableaux, and bases of rows in which permutations act as in Young's orthogonal form.

The Jucys–Murphy elements X_{i+1} = s_i X_i s_i + s_i, where s_i exchanges i and i + 1, commute,
and each standard tableau names one joint eigenspace: X_k has the content (column minus row) of
the box in which k stands. For the columns U_T of orthonormal bases of these eigenspaces

    s_i U_T = U_T/r + √(1 − 1/r²) U_{T'},   r = content of i + 1 minus content of i,

T' being T with i and i + 1 exchanged. The average of |(U_T a)ᵀφ|² over permutations is that
over all T. Objects may fall into groups; then there is a tableau for each group.
"""

from collections.abc import Iterator, Mapping
from functools import cache
from itertools import accumulate, chain, product
from operator import mul
from typing import Any, TypeAlias

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from lockedjoint.nlp.arrays import FloatArray

Shape: TypeAlias = tuple[int, ...]
# One shape for each of the groups, which are ranges of consecutive objects.
Shapes: TypeAlias = tuple[Shape, ...]
Groups: TypeAlias = tuple[range, ...]
Contents: TypeAlias = tuple[int, ...]
# For each object i such that i + 1 is in its group the orthogonal matrix, sparse, (rows, rows),
# that exchanges the two.
Exchanges: TypeAlias = Mapping[int, csr_array]
# For each tableau the number of another one, and a distance, see `young_form`.
Images: TypeAlias = tuple[tuple[int, int], ...]


def partitions(n: int, largest: int | None = None) -> Iterator[Shape]:
    """Give the partitions of n, the largest parts first."""
    if n == 0:
        yield ()
    for part in range(n if largest is None else min(n, largest), 0, -1):
        yield from ((part, *rest) for rest in partitions(n - part, part))


def row_reading_contents(shape: Shape) -> Contents:
    """Return the contents of 2…n in the tableau that is filled row after row."""
    return tuple(column - row for row, part in enumerate(shape) for column in range(part))[1:]


def standard_tableaux(shape: Shape) -> list[Contents]:
    """Return the standard tableaux of a shape, each as the contents of 2…n."""
    if sum(shape) < 2:
        return [()]
    corners = [row for row, part in enumerate(shape) if part > max(shape[row + 1 :], default=0)]
    return [
        (*contents, shape[row] - 1 - row)
        for row in corners
        for contents in standard_tableaux((*shape[:row], shape[row] - 1, *shape[row + 1 :]))
    ]


@cache
def tableau_contents(shapes: Shapes) -> tuple[tuple[Contents, ...], ...]:
    """Return the standard tableaux of a shape in each group, as contents of 2, 3, …; sorted."""
    return tuple(product(*(sorted(standard_tableaux(shape)) for shape in shapes)))


def first_tableau(shapes: Shapes) -> int:
    """Return the number of the tableau that is filled row after row."""
    return tableau_contents(shapes).index(tuple(map(row_reading_contents, shapes)))


def adapted_bases(exchanges: Exchanges, groups: Groups) -> dict[Shapes, FloatArray]:
    """Return for each shape that occurs a basis, (rows, multiplicity), of its first tableau."""
    # Contents of k are from 1 − k to k − 1, so that with these weights, a mixed radix, the
    # eigenvalues of Σ w_k X_k are whole and differ from tableau to tableau.
    radices = [2 * place + 1 for group in groups for place in range(1, len(group))]
    weights = list(accumulate(radices[:-1], mul, initial=1)) if radices else []
    rows = next(iter(exchanges.values())).shape[0] if exchanges else 1
    total: Any = csr_array((rows, rows))
    remaining = iter(weights)
    for group in groups:
        element: Any = csr_array((rows, rows))
        for exchange in (exchanges[i] for i in group[:-1]):
            element = exchange @ element @ exchange + exchange
            total = total + next(remaining) * element
    operator = csr_array(0.5 * (total + total.T))
    parts: dict[Shapes, list[FloatArray]] = {
        shapes: [] for shapes in product(*(tuple(partitions(len(group))) for group in groups))
    }
    orbits, orbit_of = connected_components(operator, directed=False)
    for orbit in (np.flatnonzero(orbit_of == number) for number in range(orbits)):
        values, vectors = np.linalg.eigh(operator[orbit][:, orbit].toarray())
        for shapes, bases in parts.items():
            contents = chain(*map(row_reading_contents, shapes))
            wanted = sum(w * content for w, content in zip(weights, contents, strict=True))
            chosen = np.abs(values - wanted) < 0.5
            bases.append(np.zeros((rows, int(chosen.sum()))))
            bases[-1][orbit] = vectors[:, chosen]
    adapted = {shapes: np.hstack(bases) for shapes, bases in parts.items()}
    return {shapes: basis for shapes, basis in adapted.items() if basis.shape[1]}


def tableau_bases(
    columns: FloatArray, exchanges: Exchanges, groups: Groups, shapes: Shapes
) -> FloatArray:
    """Return the bases of all tableaux whose first is P · columns, (tableaux, rows, columns).

    P projects on what belongs to the first tableau; no eigenvectors are needed.
    """
    tableaux = len(tableau_contents(shapes))
    bases = np.zeros((tableaux, *columns.shape))
    # The mean of P_g U Y_gᵀ over all permutations g is P · columns/tableaux.
    bases[first_tableau(shapes)] = tableaux * columns
    form = young_form(shapes, groups)
    for group in groups:
        # All permutations of the first j + 1 objects of a group are those of the first j,
        # followed by moving the last one to any place.
        for end in range(1, len(group)):
            moved, total = bases, bases.copy()
            for i in reversed(group[:end]):
                moved = young_image(_times(exchanges[i], moved), form[i])
                total += moved
            bases = total / (end + 1)
    return bases


def _times(exchange: csr_array, bases: FloatArray) -> FloatArray:
    """Return a sparse matrix times each of the bases, (tableaux, rows, columns)."""
    tableaux, rows, columns = bases.shape
    product: FloatArray = exchange @ bases.transpose(1, 0, 2).reshape(rows, -1)
    return product.reshape(rows, tableaux, columns).transpose(1, 0, 2)


def young_image(bases: FloatArray, images: Images) -> FloatArray:
    """Return Σ_T' U_T' Y_{T'T} for the exchange of an object and the next, (tableaux, …)."""
    found = np.empty_like(bases)
    for number, (goal, distance) in enumerate(images):
        found[number] = bases[number] / distance
        if abs(distance) > 1:
            found[number] += np.sqrt(1 - 1 / bases.dtype.type(distance) ** 2) * bases[goal]
    return found


@cache
def young_form(shapes: Shapes, groups: Groups) -> dict[int, Images]:
    """Return Young's orthogonal form of the exchange of each object i and the next.

    For each of `tableau_contents` the number of T' and the distance r; T itself if |r| = 1.
    """
    names = tableau_contents(shapes)
    numbers = {name: number for number, name in enumerate(names)}
    form: dict[int, Images] = {}
    for position, group in enumerate(groups):
        for place, i in enumerate(group[:-1]):
            images = []
            for name in names:
                boxes = [0, *name[position]]
                distance = boxes[place + 1] - boxes[place]
                boxes[place : place + 2] = boxes[place + 1], boxes[place]
                goal = (*name[:position], tuple(boxes[1:]), *name[position + 1 :])
                images.append((numbers.get(goal, numbers[name]), distance))
            form[i] = tuple(images)
    return form
