"""Partitions, standard tableaux and their contents: the irreducible representations of S_n.

Representations of S_n are named by partitions of n. The Jucys–Murphy elements
X_k = Σ_{i<k} (i k), k = 2…n, commute, and each standard tableau names one joint eigenspace: the
eigenvalue of X_k is the content (column minus row) of the box in which k stands.
"""

from collections.abc import Iterator
from math import factorial, prod
from typing import TypeAlias

Shape: TypeAlias = tuple[int, ...]


def partitions(n: int, largest: int | None = None) -> Iterator[Shape]:
    """Give the partitions of n, the largest parts first."""
    if n == 0:
        yield ()
        return
    for part in range(n if largest is None else min(n, largest), 0, -1):
        for rest in partitions(n - part, part):
            yield (part, *rest)


def row_reading_contents(shape: Shape) -> tuple[int, ...]:
    """Return the contents of 2…n in the tableau that is filled row after row."""
    contents = [column - row for row, part in enumerate(shape) for column in range(part)]
    return tuple(contents[1:])


def dimension(shape: Shape) -> int:
    """Return the number of standard tableaux of a shape, by the hook length formula."""
    columns = [sum(part > column for part in shape) for column in range(shape[0])]
    hooks = [
        (part - column) + (columns[column] - row) - 1
        for row, part in enumerate(shape)
        for column in range(part)
    ]
    return factorial(sum(shape)) // prod(hooks)


def all_contents(n: int) -> set[tuple[int, ...]]:
    """Return the contents of 2…n in every standard tableau with n boxes."""
    grown: set[tuple[Shape, tuple[int, ...]]] = {((1,), ())}
    for _ in range(n - 1):
        grown = {
            (shape[:row] + (part + 1,) + shape[row + 1 :], (*contents, part - row))
            for shape, contents in grown
            for row, part in enumerate((*shape, 0))
            if row == 0 or shape[row - 1] > part
        }
    return {contents for _, contents in grown}
