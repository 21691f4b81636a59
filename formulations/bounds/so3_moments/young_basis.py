"""Bases of rows in which permutations act as in Young's orthogonal form.

For a shape λ with standard tableaux T the columns of U_T are joint eigenvectors of the
Jucys–Murphy elements X_{i+1} = s_i X_i s_i + s_i, where s_i exchanges i and i + 1, and

    s_i U_T = U_T/r + √(1 − 1/r²) U_{T'},   r = content of i + 1 minus content of i,

T' being T with i and i + 1 exchanged. So averages over all permutations follow from U alone:
the average of |(U_T a)ᵀφ|² over permutations of the joints is that over all T.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from itertools import product
from math import sqrt
from typing import TypeAlias

import numpy as np

from formulations.existence.tableaux import (
    Shape,
    partitions,
    row_reading_contents,
    standard_tableaux,
)
from nlp.arrays import FloatArray

# One shape for each of the groups of joints that are permuted among themselves.
Shapes: TypeAlias = tuple[Shape, ...]
Groups: TypeAlias = tuple[range, ...]
Contents: TypeAlias = tuple[int, ...]
# For each tableau the number of another one, and a distance, see `young_form`.
Images: TypeAlias = tuple[tuple[int, int], ...]

_WEIGHTS = tuple(sqrt(prime) for prime in (2, 3, 5, 7, 11, 13, 17, 19, 23, 29))
_WINDOW = 0.25


def young_bases(
    exchanges: Mapping[int, FloatArray], groups: Groups
) -> dict[Shapes, FloatArray]:
    """Return for each shape that occurs the bases U_T, (tableaux, rows, multiplicity).

    `exchanges` holds the orthogonal (rows, rows) that exchanges joints i and i + 1, for each i
    such that both are in one group. The tableaux are in the order of `tableau_contents`. All
    bases together are orthonormal.
    """
    elements = _jucys_murphy(exchanges, groups)
    rows = len(next(iter(exchanges.values()))) if exchanges else 1
    operator = sum(
        (_WEIGHTS[joint] * x for joint, x in elements.items()), np.zeros((rows, rows))
    )
    values, vectors = np.linalg.eigh(0.5 * (operator + operator.T))
    found: dict[Shapes, FloatArray] = {}
    for shapes in product(*(tuple(partitions(len(group))) for group in groups)):
        start = tableau_contents(shapes)[first_tableau(shapes)]
        contents = {
            joint: content
            for group, row in zip(groups, start, strict=True)
            for joint, content in zip(group, row, strict=False)
        }
        wanted = sum(_WEIGHTS[joint] * content for joint, content in contents.items())
        near = vectors[:, np.abs(values - wanted) < _WINDOW]
        first = _joint_eigenvectors(near, elements, contents)
        if first.shape[1]:
            bases = _derived(first, exchanges, groups, shapes)
            found[shapes] = _averaged(bases, exchanges, groups, shapes)
    return found


def first_tableau(shapes: Shapes) -> int:
    """Return the number of the tableau that is filled row after row."""
    return tableau_contents(shapes).index(tuple(map(row_reading_contents, shapes)))


def projected_tableaux(
    rows: Sequence[int], exchanges: Mapping[int, FloatArray], groups: Groups, shapes: Shapes
) -> FloatArray:
    """Return the bases of all tableaux whose first is P e_i for some rows i.

    P projects on what belongs to the first tableau. No eigenvectors are needed for that, so
    other machines get the same to within rounding.
    """
    tableaux = len(tableau_contents(shapes))
    length = len(next(iter(exchanges.values()))) if exchanges else 1
    bases = np.zeros((tableaux, length, len(rows)))
    # The mean over all permutations is P e_i/tableaux.
    bases[first_tableau(shapes), list(rows), range(len(rows))] = tableaux
    return _averaged(bases, exchanges, groups, shapes)


def _jucys_murphy(exchanges: Mapping[int, FloatArray], groups: Groups) -> dict[int, FloatArray]:
    """Return X_{i+1} of each group, by joint i."""
    found = {}
    for group in groups:
        element: FloatArray | None = None
        for joint in group[:-1]:
            swap = exchanges[joint]
            element = swap if element is None else swap @ element @ swap + swap
            found[joint] = element
    return found


def _joint_eigenvectors(
    near: FloatArray, elements: Mapping[int, FloatArray], contents: Mapping[int, int]
) -> FloatArray:
    """Return the vectors in the span of `near` with X_{i+1} u = (content) u for all i.

    The weighted sum of the X may have other eigenvalues close by; but the other eigenvalues of
    Σ (X − content)² are at least 1.
    """
    if not near.shape[1]:
        return near
    square = np.zeros((near.shape[1], near.shape[1]))
    for joint, content in contents.items():
        image = elements[joint] @ near - content * near
        square += image.T @ image
    values, vectors = np.linalg.eigh(square)
    return np.asarray(near @ vectors[:, values < 0.5])


def _derived(
    first: FloatArray, exchanges: Mapping[int, FloatArray], groups: Groups, shapes: Shapes
) -> FloatArray:
    """Return the bases of all tableaux from that of the first, by Young's orthogonal form."""
    start = first_tableau(shapes)
    bases: dict[int, FloatArray] = {start: first}
    waiting = [start]
    while waiting:
        number = waiting.pop()
        for joint, images in young_form(shapes, groups).items():
            goal, distance = images[number]
            if abs(distance) > 1 and goal not in bases:
                moved = exchanges[joint] @ bases[number] - bases[number] / distance
                bases[goal] = moved / sqrt(1 - 1 / distance**2)
                waiting.append(goal)
    return np.stack([bases[number] for number in range(len(bases))])


def _averaged(
    bases: FloatArray, exchanges: Mapping[int, FloatArray], groups: Groups, shapes: Shapes
) -> FloatArray:
    """Return the mean over all permutations g of P_g U Y_gᵀ: rounding errors are averaged out.

    All permutations of the first j + 1 joints of a group are those of the first j, followed by
    moving the last joint to any place.
    """
    for group in groups:
        for end in range(1, len(group)):
            moved, total = bases, bases.copy()
            for joint in reversed(group[:end]):
                moved = young_image(exchanges[joint] @ moved, young_form(shapes, groups)[joint])
                total += moved
            bases = total / (end + 1)
    return bases


def young_image(bases: FloatArray, images: Images) -> FloatArray:
    """Return Σ_T' U_T' Y_{T'T} for the exchange of a joint and the next, (tableaux, …)."""
    found = np.empty_like(bases)
    for number, (goal, distance) in enumerate(images):
        found[number] = bases[number] / distance
        if abs(distance) > 1:
            found[number] += sqrt(1 - 1 / distance**2) * bases[goal]
    return found


@cache
def tableau_contents(shapes: Shapes) -> tuple[tuple[Contents, ...], ...]:
    """Return the standard tableaux of a shape in each group, as contents of 2, 3, …; sorted."""
    return tuple(product(*(sorted(standard_tableaux(shape)) for shape in shapes)))


@cache
def young_form(shapes: Shapes, groups: Groups) -> dict[int, Images]:
    """Return Young's orthogonal form of the exchange of each joint i and the next.

    For each tableau, in the order of `tableau_contents`: the number of the tableau with i and
    i + 1 exchanged, and the distance r. If |r| = 1 there is no such tableau, and the number is
    that of the tableau itself.
    """
    names = tableau_contents(shapes)
    numbers = {name: number for number, name in enumerate(names)}
    form: dict[int, Images] = {}
    for position, group in enumerate(groups):
        for place, joint in enumerate(group[:-1]):
            images = []
            for name in names:
                boxes = [0, *name[position]]
                distance = boxes[place + 1] - boxes[place]
                boxes[place : place + 2] = boxes[place + 1], boxes[place]
                goal = (*name[:position], tuple(boxes[1:]), *name[position + 1 :])
                images.append((numbers.get(goal, numbers[name]), distance))
            form[joint] = tuple(images)
    return form
