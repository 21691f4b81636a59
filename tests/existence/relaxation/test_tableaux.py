from __future__ import annotations

from math import factorial

import pytest

from formulations.existence.relaxation.tableaux import (
    all_contents,
    dimension,
    partitions,
    row_reading_contents,
)


@pytest.mark.parametrize("n", range(1, 8))
def test_tableaux_are_as_many_as_representations_say(n: int) -> None:
    shapes = list(partitions(n))
    assert len(set(shapes)) == len(shapes)
    assert sum(dimension(shape) ** 2 for shape in shapes) == factorial(n)
    assert len(all_contents(n)) == sum(dimension(shape) for shape in shapes)
    assert {row_reading_contents(shape) for shape in shapes} <= all_contents(n)


def test_contents_are_column_minus_row() -> None:
    assert row_reading_contents((3, 3, 1)) == (1, 2, -1, 0, 1, -2)
    assert row_reading_contents((1, 1, 1)) == (-1, -2)
