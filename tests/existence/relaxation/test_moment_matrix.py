"""The blocks against the whole moment matrix, and against direct averages of true solutions."""

from __future__ import annotations

from collections.abc import Callable
from itertools import permutations

import numpy as np
import pytest
from numpy.typing import NDArray

from formulations.existence.equations import Frame
from formulations.existence.graphs import classes
from formulations.existence.relaxation.linear_moments import solve_moment_equations
from formulations.existence.relaxation.moment_matrix import class_tables, moment_blocks
from formulations.existence.relaxation.numbered_monomials import (
    EdgeMultisets,
    Integers,
    RowSector,
)
from formulations.existence.relaxation.relaxation import ExistenceRelaxation
from formulations.existence.relaxation.row_bases import equation_rows, row_bases
from formulations.existence.relaxation.tableaux import dimension

Complex = NDArray[np.complex128]


def row_values(sector: RowSector, w: Complex) -> Complex:
    """Evaluate every monomial of a sector."""
    i, j = np.array(sector.multisets.edges).T
    products = [w[i, j][members].prod(axis=-1) for members in sector.multisets.members]
    return np.concatenate(
        [np.outer(products[p], products[q].conj()).ravel() for p, q in sector.types]
    )


@pytest.mark.parametrize("charge", [0, 1, 2])
def test_blocks_have_the_eigenvalues_of_the_whole_matrix(
    order_2: ExistenceRelaxation, charge: int
) -> None:
    moments = dict(
        zip(order_2.moments.classes, order_2.moments.coefficients()[:, 0], strict=True)
    )
    multisets = EdgeMultisets(7, 2)
    tables = class_tables(classes(7, 2), multisets)
    values = np.array([moments[graph] for graph in classes(7, 2)])
    sector = RowSector(multisets, charge)
    whole = np.zeros((sector.length, sector.length))
    for p, q in sector.types:
        for r, s in sector.types:
            w, wbar = sector.multisets.unions(q, r), sector.multisets.unions(p, s)
            found = values[tables[q + r][w[None, :, :, None], wbar[:, None, None, :]]]
            rows = slice(sector.offset(p, q), sector.offset(p, q) + sector.size(p, q))
            columns = slice(sector.offset(r, s), sector.offset(r, s) + sector.size(r, s))
            whole[rows, columns] = found.reshape(sector.size(p, q), sector.size(r, s))
    expected = np.linalg.eigvalsh(whole)
    found_values = [
        np.repeat(np.linalg.eigvalsh(block.at(np.zeros(0))), dimension(block.shape))
        for block in order_2.blocks
        if block.charge == charge
    ]
    nonzero = np.sort(np.concatenate(found_values))
    np.testing.assert_allclose(expected[len(expected) - len(nonzero) :], nonzero, atol=1e-10)
    np.testing.assert_allclose(expected[: len(expected) - len(nonzero)], 0, atol=1e-10)


@pytest.mark.parametrize("charge", [0, 1, 2])
def test_blocks_of_a_true_solution_are_its_averages(
    solution_6r: Callable[[int], Complex],
    averages: Callable[[EdgeMultisets, tuple[Integers, ...], Complex], NDArray[np.float64]],
    charge: int,
) -> None:
    frame, multisets = Frame(6, 6), EdgeMultisets(6, 2)
    tables = class_tables(classes(6, 2), multisets)
    w = solution_6r(charge)
    sector = RowSector(multisets, charge)
    bases = row_bases(sector, frame)
    blocks = moment_blocks(bases, sector, tables, averages(multisets, tables, w)[:, None])
    orders = [np.array(order) for order in permutations(range(6))]
    values = np.array([row_values(sector, w[np.ix_(order, order)]) for order in orders])
    kept = [basis for basis in bases if basis.rows.shape[1]]
    assert len(kept) == len(blocks)
    for basis, block in zip(kept, blocks, strict=True):
        seen = values @ basis.rows
        direct = (seen.conj().T @ seen).real / len(orders)
        np.testing.assert_allclose(block.at(np.zeros(0)), direct, atol=1e-12)
        assert np.linalg.eigvalsh(direct)[0] > -1e-12


@pytest.mark.parametrize("charge", [0, 1, 2, 3])
def test_rows_made_of_equations_vanish_at_solutions(
    solution_6r: Callable[[int], Complex],
    solution_simplex: Callable[[int], Complex],
    charge: int,
) -> None:
    for frame, order, w in (
        (Frame(6, 6), 3, solution_6r(1)),
        (Frame(7, 6, diagonal=True), 2, solution_simplex(1)),
    ):
        multisets = EdgeMultisets(frame.joints, order, frame.diagonal)
        sector = RowSector(multisets, charge)
        rows = list(equation_rows(sector, frame)) if charge <= order else []
        values = row_values(sector, w) if rows else np.zeros(0)
        for numbers, coefficients in rows:
            assert abs(values[numbers] @ np.array(coefficients)) < 1e-12
            assert np.abs(values[numbers]).max() < 10
        # At a matrix that is no solution they do not vanish.
        if rows:
            other = row_values(sector, w + 0.1)
            assert max(abs(other[n] @ np.array(c)) for n, c in rows) > 1e-3


def test_free_moments_are_seen_in_the_blocks() -> None:
    frame, multisets = Frame(6, 6), EdgeMultisets(6, 2)
    tables = class_tables(classes(6, 2), multisets)
    moments = solve_moment_equations(frame, 2)
    sector = RowSector(multisets, 2)
    blocks = moment_blocks(row_bases(sector, frame), sector, tables, moments.coefficients())
    assert {block.matrices.shape[0] for block in blocks} == {1 + len(moments.free)}
    assert max(np.abs(block.matrices[1:]).max() for block in blocks) > 0.1
