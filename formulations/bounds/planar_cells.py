"""Cells of the circle: how many directions of columns each arc holds.

z_i is the complex square of column i of a planar Jacobian, n in all. Only their angles count
here. Angles are whole numbers, in units of 2π/`TURN` rad. An arc holds its beginning and not
its end; the arc (0, 0) is the angle 0 alone. A rotation of all columns changes nothing, so that
one z_i is put to the angle 0.
"""

from collections.abc import Iterator
from typing import TypeAlias

#: An arc, from and to, and how many z_i it holds.
Cell: TypeAlias = tuple[int, int, int]

#: A full turn, in the unit of the ends of arcs. A power of 2 can be halved so many times
#: exactly.
TURN = 2**48
#: Number of arcs into which the circle is cut first. More give more first nodes.
ARCS = 8
# The length of an arc of the root, in the same unit.
_ARC = TURN // ARCS


def first_cells(n: int) -> Iterator[tuple[Cell, ...]]:
    """Yield all counts of n z_i in the first cells, but for rotations.

    One z_i is at the angle 0, one such that the arc of length `_ARC` that begins there holds
    `most`, at least as many as any arc of this length. Cells without z_i are left out.
    """
    for most in range(-(-n // ARCS), n + 1):
        for counts in _counts(n - most, ARCS - 1, most):
            held = [(0, 0, 1), (0, _ARC, most - 1)]
            held += [((i + 1) * _ARC, (i + 2) * _ARC, one) for i, one in enumerate(counts)]
            yield tuple(cell for cell in held if cell[2])


def _counts(total: int, cells: int, most: int) -> Iterator[tuple[int, ...]]:
    """Yield all ways to put `total` things into cells, at most `most` into each."""
    if cells == 0:
        yield from [()] if total == 0 else []
        return
    for first in range(min(total, most) + 1):
        for rest in _counts(total - first, cells - 1, most):
            yield (first, *rest)


def is_crowded(cells: tuple[Cell, ...]) -> bool:
    """Whether an arc of length `_ARC` holds more z_i than the one from the angle 0 on.

    Then the node is a rotation of another one. Only arcs that begin where a cell does can hold
    a cell more.
    """

    def held(start: int) -> int:
        """Return how many z_i are surely in the arc of length `_ARC` that begins at `start`."""
        return sum(
            count
            for low, high, count in cells
            if (low - start) % TURN + high - low <= _ARC
            and (low - start) % TURN < _ARC  # an arc is without its end
        )

    most = sum(count for low, _, count in cells if low < _ARC)
    return any(held(start) > most for start, _, _ in cells)


def is_one_sided(cells: tuple[Cell, ...]) -> bool:
    """Whether all z_i are strictly on one side of a line, so that their sum is not 0."""
    for index, (_, end, _) in enumerate(cells):
        others = cells[:index] + cells[index + 1 :]
        if all((low - end) % TURN > TURN // 2 for low, _, _ in others):
            return True
    return False
