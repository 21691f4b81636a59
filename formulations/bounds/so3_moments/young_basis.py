"""Bases of rows in which permutations act as in Young's orthogonal form.

For a shape λ with standard tableaux T the columns of U_T are joint eigenvectors of the
Jucys–Murphy elements X_{i+1} = s_i X_i s_i + s_i, where s_i exchanges i and i + 1, and

    s_i U_T = U_T/r + √(1 − 1/r²) U_{T'},   r = content of i + 1 minus content of i,

T' being T with i and i + 1 exchanged. So averages over all permutations follow from U alone:
the average of |(U_T a)ᵀφ|² over permutations of the joints is that over all T.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from itertools import accumulate, chain, product
from math import sqrt
from operator import mul
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


def young_bases(
    exchanges: Mapping[int, FloatArray], groups: Groups
) -> dict[Shapes, FloatArray]:
    """Return for each shape that occurs the bases U_T, (tableaux, rows, multiplicity).

    `exchanges` holds the orthogonal (rows, rows) that exchanges joints i and i + 1, for each i
    such that both are in one group. The tableaux are in the order of `tableau_contents`. All
    bases together are orthonormal.
    """
    weights = _weights(groups)
    values, vectors = np.linalg.eigh(_weighted_jucys_murphy(exchanges, groups, weights))
    found: dict[Shapes, FloatArray] = {}
    for shapes in product(*(tuple(partitions(len(group))) for group in groups)):
        contents = chain(*map(row_reading_contents, shapes))
        wanted = sum(w * content for w, content in zip(weights, contents, strict=True))
        first = vectors[:, np.abs(values - wanted) < 0.5]
        if first.shape[1]:
            found[shapes] = tableau_bases(first, exchanges, groups, shapes)
    return found


def first_tableau(shapes: Shapes) -> int:
    """Return the number of the tableau that is filled row after row."""
    return tableau_contents(shapes).index(tuple(map(row_reading_contents, shapes)))


def tableau_bases(
    columns: FloatArray, exchanges: Mapping[int, FloatArray], groups: Groups, shapes: Shapes
) -> FloatArray:
    """Return the bases of all tableaux whose first is P · columns, (rows, any number).

    P projects on what belongs to the first tableau. For columns of the unit matrix no
    eigenvectors are needed, so that other machines get the same to within rounding.
    """
    tableaux = len(tableau_contents(shapes))
    bases = np.zeros((tableaux, *columns.shape))
    # The mean over all permutations is P · columns/tableaux.
    bases[first_tableau(shapes)] = tableaux * columns
    return _averaged(bases, exchanges, groups, shapes)


def _weights(groups: Groups) -> list[int]:
    """Return weights for joints 2, 3, … of each group: Σ w_k X_k tells tableaux apart.

    Contents of joint k are whole, from 1 − k to k − 1: the weights are a mixed radix.
    """
    radices = [2 * place + 1 for group in groups for place in range(1, len(group))]
    return list(accumulate(radices[:-1], mul, initial=1)) if radices else []


def _weighted_jucys_murphy(
    exchanges: Mapping[int, FloatArray], groups: Groups, weights: Sequence[int]
) -> FloatArray:
    """Return Σ w_k X_k over all groups, (rows, rows)."""
    rows = len(next(iter(exchanges.values()))) if exchanges else 1
    total, remaining = np.zeros((rows, rows)), iter(weights)
    for group in groups:
        element = np.zeros((rows, rows))
        for joint in group[:-1]:
            element = exchanges[joint] @ element @ exchanges[joint] + exchanges[joint]
            total += next(remaining) * element
    return np.asarray(0.5 * (total + total.T))


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
