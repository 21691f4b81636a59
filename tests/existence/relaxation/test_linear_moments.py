from __future__ import annotations

from fractions import Fraction

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from formulations.existence.equations import Frame
from formulations.existence.graphs import ONE, Monomial
from formulations.existence.relaxation.linear_moments import (
    eliminate,
    solve_moment_equations,
)

X = [ONE, *(Monomial(((0, c),)) for c in range(1, 9))]


def rows_of(matrix: list[list[int]]) -> list[dict[Monomial, Fraction]]:
    return [{X[c]: Fraction(v) for c, v in enumerate(row) if v} for row in matrix]


def test_a_small_system_by_hand() -> None:
    # x3 = 2·x1 + 1 and 3·x2 = x1, twice.
    result = eliminate(rows_of([[1, 2, 0, -1], [0, 1, -3, 0], [1, 3, -3, -1]]))
    assert result == {
        X[2]: {X[1]: Fraction(1, 3)},
        X[3]: {ONE: Fraction(1), X[1]: Fraction(2)},
    }


def test_a_contradiction_is_found_and_does_not_count_as_rank() -> None:
    assert eliminate(rows_of([[1, 1, 1], [2, 1, 1]])).keys() == {ONE, X[2]}
    moments = solve_moment_equations(Frame(3, 2), 1)
    assert not moments.consistent
    assert moments.rank == len(moments.classes) - 1
    assert (moments.free, moments.solution) == ((), {})


@given(st.integers(0, 2**32 - 1), st.integers(1, 7), st.integers(1, 7))
def test_solutions_satisfy_every_equation_exactly(seed: int, height: int, width: int) -> None:
    rng = np.random.default_rng(seed)
    unknowns = rng.integers(-3, 4, size=width)
    matrix = rng.integers(-2, 3, size=(height, width)) * rng.integers(
        0, 2, size=(height, width)
    )
    # A planted solution: the constant is chosen to fit.
    augmented = np.column_stack([-matrix @ unknowns, matrix])
    result = eliminate(rows_of(augmented.tolist()))
    assert ONE not in result
    assert len(result) == np.linalg.matrix_rank(matrix)
    values = {X[c]: Fraction(int(v)) for c, v in enumerate(unknowns, start=1)}
    values[ONE] = Fraction(1)
    for free in set(values) - set(result) - {ONE}:
        values[free] = Fraction(int(rng.integers(-9, 10)), 7)
    for c, row in result.items():
        assert set(row) <= set(values) - set(result)
        values[c] = sum((value * values[k] for k, value in row.items()), Fraction(0))
    for equation in rows_of(augmented.tolist()):
        assert sum(value * values[c] for c, value in equation.items()) == 0
