from __future__ import annotations

import numpy as np
import pytest

from formulations.existence.graphs import Monomial
from formulations.existence.relaxation.numbered_monomials import EdgeMultisets, RowSector
from formulations.existence.relaxation.row_bases import adapted_rows
from formulations.existence.relaxation.tableaux import dimension, row_reading_contents


@pytest.mark.parametrize(
    ("joints", "order", "charge", "loops"),
    [(7, 2, 0, False), (7, 2, 2, True), (6, 3, 1, False), (5, 3, 3, True), (3, 2, 0, False)],
)
def test_rows_are_all_there_and_are_joint_eigenvectors(
    joints: int, order: int, charge: int, loops: bool
) -> None:
    sector = RowSector(EdgeMultisets(joints, order, loops), charge)
    bases = adapted_rows(sector)
    copies = {shape: basis.shape[1] for shape, basis in bases.items()}
    assert sum(dimension(shape) * number for shape, number in copies.items()) == sector.length
    together = np.hstack(list(bases.values()))
    identity = np.eye(together.shape[1])
    np.testing.assert_allclose(together.T @ together, identity, atol=1e-11)
    for k in range(1, joints):
        # The Jucys–Murphy element X_{k+1} = Σ_{i<k} (i k), joints counted from 0.
        moved = {shape: np.zeros_like(basis) for shape, basis in bases.items()}
        for i in range(k):
            order_of_joints = np.arange(joints)
            order_of_joints[[i, k]] = k, i
            images = np.concatenate(
                [
                    sector.offset(p, q) + sector.images(p, q, order_of_joints[None])[0]
                    for p, q in sector.types
                ]
            )
            for shape, basis in bases.items():
                moved[shape] += basis[images]
        for shape, basis in bases.items():
            content = row_reading_contents(shape)[k - 1]
            np.testing.assert_allclose(moved[shape], content * basis, atol=1e-10)


def test_rows_are_numbered_one_by_one() -> None:
    multisets = EdgeMultisets(4, 3)
    sector = RowSector(multisets, 1)
    edges = multisets.edges
    linear = [Monomial((a,)) for a in edges]
    cubic = [
        Monomial((a, b), (c,)) for i, a in enumerate(edges) for b in edges[i:] for c in edges
    ]
    numbers = [sector.number(monomial) for monomial in linear + cubic]
    assert numbers == list(range(sector.length))
