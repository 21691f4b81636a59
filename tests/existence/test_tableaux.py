"""Tableaux against counting formulas, adapted bases against the Jucys–Murphy elements."""

from functools import partial
from math import factorial, prod

import numpy as np
import pytest

from formulations.existence.moments import EdgeMultisets
from formulations.existence.tableaux import (
    adapted_bases,
    partitions,
    row_reading_contents,
    standard_tableaux,
)


def hook_formula(shape):
    """Return the number of standard tableaux by the hook length formula."""
    columns = [sum(part > column for part in shape) for column in range(shape[0])]
    hooks = [
        (part - column) + (columns[column] - row) - 1
        for row, part in enumerate(shape)
        for column in range(part)
    ]
    return factorial(sum(shape)) // prod(hooks)


@pytest.mark.parametrize("n", range(1, 8))
def test_tableaux_are_as_many_as_formulas_say(n):
    shapes = list(partitions(n))
    assert len(set(shapes)) == len(shapes)
    tableaux = {shape: standard_tableaux(shape) for shape in shapes}
    assert sum(len(contents) ** 2 for contents in tableaux.values()) == factorial(n)
    for shape, contents in tableaux.items():
        assert len(contents) == hook_formula(shape)
        assert row_reading_contents(shape) in contents
    everything = [contents for of_shape in tableaux.values() for contents in of_shape]
    assert len(set(everything)) == len(everything)


def test_contents_are_column_minus_row():
    assert row_reading_contents((3, 3, 1)) == (1, 2, -1, 0, 1, -2)
    assert row_reading_contents((1, 1, 1)) == (-1, -2)
    assert sorted(standard_tableaux((2, 1))) == [(-1, 1), (1, -1)]


@pytest.mark.parametrize(
    ("joints", "order", "charge", "loops"),
    [(7, 2, 0, False), (7, 2, 2, True), (6, 3, 1, False), (5, 3, 3, True), (3, 2, 0, False)],
)
def test_bases_are_whole_and_of_joint_eigenvectors(joints, order, charge, loops):
    multisets = EdgeMultisets(joints, order, loops)
    rows = multisets.rows(charge)
    bases = adapted_bases(joints, partial(multisets.images, rows))
    copies = {shape: basis.shape[1] for shape, basis in bases.items()}
    assert sum(hook_formula(shape) * number for shape, number in copies.items()) == len(rows[0])
    together = np.hstack(list(bases.values()))
    identity = np.eye(together.shape[1])
    np.testing.assert_allclose(together.T @ together, identity, atol=1e-11)
    for k in range(1, joints):
        # The Jucys–Murphy element X_{k+1} = Σ_{i<k} (i k), joints counted from 0.
        moved = {shape: np.zeros_like(basis) for shape, basis in bases.items()}
        for i in range(k):
            names = np.arange(joints)
            names[[i, k]] = k, i
            [images] = multisets.images(rows, names[None])
            for shape, basis in bases.items():
                moved[shape] += basis[images]
        for shape, basis in bases.items():
            content = row_reading_contents(shape)[k - 1]
            np.testing.assert_allclose(moved[shape], content * basis, atol=1e-10)
