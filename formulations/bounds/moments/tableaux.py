"""Standard tableaux, and bases of rows in which permutations act as in Young's orthogonal form.

Permutations of objects (here joints) act on the rows of a vector space by orthogonal matrices.
This file splits the space into parts that permutations do not mix, one for each shape, and
chooses in each part a basis U_T, shape (rows, multiplicity), for each standard tableau T.

- shape: a partition of the number of objects, drawn as rows of boxes, the longest first;
- standard tableau: the objects 1, 2, … in the boxes, ascending along rows and columns. It is
  stored as the contents of the boxes of 2, 3, …, which determine it;
- content of a box: the number of its column minus that of its row;
- multiplicity: how often the part of a shape occurs, the number of columns of each U_T;
- a: any vector of coefficients, shape (multiplicity,), and φ any vector of rows, (rows,).

Let s_i exchange the objects i and i + 1. The Jucys–Murphy elements X_1 = 0 and X_{i+1} =
s_i X_i s_i + s_i commute. Each standard tableau T names one joint eigenspace: the eigenvalue of
X_k is the content (column minus row) of the box in which k stands. Orthonormal bases U_T of
these eigenspaces can be chosen such that

    s_i U_T = U_T/r + √(1 − 1/r²) U_{T'},   r = content of i + 1 minus content of i,

where T' is T with i and i + 1 exchanged. The mean of |(U_T a)ᵀφ|² over all permutations of φ is
its mean over all T. Objects may fall into groups; then there is a tableau for each group.

In the code objects are counted from 0, and `exchanges[i]` exchanges the objects i and i + 1 of
one group. There are no exchanges between groups.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from itertools import accumulate, chain, product
from operator import mul
from typing import Any, TypeAlias

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from lockedjoint.nlp.arrays import FloatArray

#: A shape: the lengths of its rows of boxes, the longest first.
Shape: TypeAlias = tuple[int, ...]
#: Ranges of consecutive objects.
Groups: TypeAlias = tuple[range, ...]
#: One shape for each group.
Shapes: TypeAlias = tuple[Shape, ...]
#: A tableau: the contents of the boxes of the objects 2, 3, ….
Contents: TypeAlias = tuple[int, ...]
#: The matrix, (rows, rows), that exchanges the objects i and i + 1, by i.
Exchanges: TypeAlias = Mapping[int, csr_array]
#: The number of T' and the distance r of each tableau T, see `young_form`.
Images: TypeAlias = tuple[tuple[int, int], ...]

# Distance from an integer below which a computed eigenvalue is this integer. Eigenvalues are
# integers, so that half of their distance separates them best.
_EIGENVALUE_DISTANCE = 0.5


def partitions(n: int, largest: int | None = None) -> Iterator[Shape]:
    """Yield the partitions of n into parts of at most `largest`, the largest parts first."""
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


def adapted_bases(exchanges: Exchanges, groups: Groups, rows: int) -> dict[Shapes, FloatArray]:
    """Return for each shape that occurs an orthonormal basis of its first tableau.

    The basis has the shape (rows, multiplicity). `rows` is the size of the `exchanges`, of
    which there are none if no group has two objects: then all rows have one shape.

    The bases are eigenvectors of one operator Σ w_k X_k. Its eigenvalues Σ w_k · content of k
    differ for all tableaux.
    """
    weights = _content_weights(groups)
    operator = _content_operator(exchanges, groups, weights, rows)
    all_shapes = product(*(tuple(partitions(len(group))) for group in groups))
    parts: dict[Shapes, list[FloatArray]] = {shapes: [] for shapes in all_shapes}
    # Orbits of rows that permutations do not mix have eigenvectors of their own. Small dense
    # matrices are much quicker than one of all rows.
    orbits, orbit_of = connected_components(operator, directed=False)
    for orbit in (np.flatnonzero(orbit_of == number) for number in range(orbits)):
        values, vectors = np.linalg.eigh(operator[orbit][:, orbit].toarray())
        for shapes, bases in parts.items():
            contents = chain(*map(row_reading_contents, shapes))
            eigenvalue = sum(w * content for w, content in zip(weights, contents, strict=True))
            chosen = np.abs(values - eigenvalue) < _EIGENVALUE_DISTANCE
            basis = np.zeros((rows, int(chosen.sum())))
            basis[orbit] = vectors[:, chosen]
            bases.append(basis)
    adapted = {shapes: np.hstack(bases) for shapes, bases in parts.items()}
    return {shapes: basis for shapes, basis in adapted.items() if basis.shape[1]}


def _content_weights(groups: Groups) -> list[int]:
    """Return w_k for the objects 2, 3, … of each group, one group after another.

    The content of object k is one of 2k − 1 integers, from 1 − k to k − 1. The weights are
    those of a mixed radix, 1, 3, 3·5, …, so that Σ w_k · content determines all contents.
    """
    radices = [2 * place + 1 for group in groups for place in range(1, len(group))]
    return list(accumulate(radices[:-1], mul, initial=1)) if radices else []


def _content_operator(
    exchanges: Exchanges, groups: Groups, weights: Sequence[int], rows: int
) -> csr_array:
    """Return Σ w_k X_k, shape (rows, rows), over the objects of all groups; symmetric."""
    total: Any = csr_array((rows, rows))
    next_weight = iter(weights)
    for group in groups:
        # This is X_k: X_1 = 0 at first, and then X_{k+1} from X_k.
        element: Any = csr_array((rows, rows))
        for exchange in (exchanges[i] for i in group[:-1]):
            element = exchange @ element @ exchange + exchange
            total = total + next(next_weight) * element
    return csr_array(0.5 * (total + total.T))


def tableau_bases(
    columns: FloatArray, exchanges: Exchanges, groups: Groups, shapes: Shapes
) -> FloatArray:
    """Return bases of all tableaux, (tableaux, rows, k), from `columns`, shape (rows, k).

    That of the first tableau is P · columns. P projects on what belongs to the first tableau;
    no eigenvectors are needed. The columns, times the number of tableaux, stand for the first
    tableau, and 0 for the others. The average of g U Y(g)ᵀ over all permutations g, with
    Young's form Y, then has P · columns in the first place.
    """
    tableaux = len(tableau_contents(shapes))
    bases = np.zeros((tableaux, *columns.shape))
    bases[first_tableau(shapes)] = tableaux * columns
    form = young_form(shapes, groups)
    for group in groups:
        # A permutation of the first end + 1 objects of a group is one of the first `end`,
        # followed by a move of the last object to any place.
        for end in range(1, len(group)):
            moved, total = bases, bases.copy()
            for i in reversed(group[:end]):
                moved = young_image(_times(exchanges[i], moved), form[i])
                total += moved
            bases = total / (end + 1)
    return bases


def _times(exchange: csr_array, bases: FloatArray) -> FloatArray:
    """Return a sparse matrix, (rows, rows), times each basis, (tableaux, rows, columns)."""
    tableaux, rows, columns = bases.shape
    images: FloatArray = exchange @ bases.transpose(1, 0, 2).reshape(rows, -1)
    return images.reshape(rows, tableaux, columns).transpose(1, 0, 2)


def young_image(bases: FloatArray, images: Images) -> FloatArray:
    """Return s_i U_T = U_T/r + √(1 − 1/r²) U_{T'} for all T, shape (tableaux, rows, columns).

    `bases` are the U_T, of the same shape, and `images` those of s_i in `young_form`. The
    result has the precision of the bases, which may be extended.
    """
    image = np.empty_like(bases)
    for number, (other, distance) in enumerate(images):
        image[number] = bases[number] / distance
        if abs(distance) > 1:
            image[number] += np.sqrt(1 - 1 / bases.dtype.type(distance) ** 2) * bases[other]
    return image


@cache
def young_form(shapes: Shapes, groups: Groups) -> dict[int, Images]:
    """Return Young's orthogonal form of the exchange of each object i and the next, by i.

    For each tableau T, in the order of `tableau_contents`, it has the number of T', and the
    distance r. If |r| is 1, T' is no standard tableau, and T stands in its place.
    """
    tableaux = tableau_contents(shapes)
    numbers = {tableau: number for number, tableau in enumerate(tableaux)}
    form: dict[int, Images] = {}
    for position, group in enumerate(groups):
        for place, i in enumerate(group[:-1]):
            images = []
            for tableau in tableaux:
                contents = [0, *tableau[position]]
                distance = contents[place + 1] - contents[place]
                contents[place], contents[place + 1] = contents[place + 1], contents[place]
                exchanged = (
                    *tableau[:position],
                    tuple(contents[1:]),
                    *tableau[position + 1 :],
                )
                images.append((numbers.get(exchanged, numbers[tableau]), distance))
            form[i] = tuple(images)
    return form
