"""Eq. (6) by blocks of rows: against its own equation, and what attains it."""

import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from formulations.bounds.closed_form import (
    block_trace_bound,
    rational_root_above,
    root_above,
    root_below,
)
from formulations.measures import eigenvalue_bound
from formulations.registry import bound
from formulations.solving.solve import solve


def test_equal_blocks_are_no_different_from_the_whole():
    assert block_trace_bound(7, (3, 3), (7, 7)) == pytest.approx(1 / 3, rel=1e-14)
    assert block_trace_bound(9, (2, 1, 3), (4, 2, 6)) == pytest.approx(2 * 3 / 9, rel=1e-14)


def test_unequal_blocks_solve_their_equation():
    t = block_trace_bound(7, (3, 3), (28, 7))
    assert 0 < t < 7 / 3
    assert 3 / (28 / 3 - t) + 3 / (7 / 3 - t) == pytest.approx(1 / t, rel=1e-12)
    # A block that is free of charge leaves the bound of the other one with 7 joints.
    assert block_trace_bound(7, (3, 3), (1e12, 7)) == pytest.approx(
        eigenvalue_bound(3, 4, 7), rel=1e-9
    )


@pytest.mark.parametrize(
    ("joints", "sizes", "traces"),
    [
        (7, (3, 3), (28, 7)),
        (9, (2, 1, 3), (4, 2, 6)),
        (7, (3, 3), (0.1, 0.7)),
        (8, (1,), (1e-3,)),
    ],
)
def test_block_bounds_are_not_below_the_root(joints, sizes, traces):
    t = block_trace_bound(joints, sizes, traces)
    means = [Fraction(trace) / size for size, trace in zip(sizes, traces, strict=True)]

    def left(t):
        return t * sum(size / (mean - t) for size, mean in zip(sizes, means, strict=True))

    assert left(Fraction(t)) >= joints - sum(sizes)
    assert left(Fraction(t) * (1 - Fraction(1, 10**15))) < joints - sum(sizes)


@given(st.fractions(min_value=Fraction(1, 10**6), max_value=10**6))
def test_a_root_above_is_the_next_double_or_the_root(square):
    root = root_above(square)
    assert Fraction(root) ** 2 >= square > Fraction(math.nextafter(root, 0)) ** 2
    assert root_below(square) ** 2 <= square < rational_root_above(square) ** 2
    assert float(rational_root_above(square)) == pytest.approx(root, rel=1e-14)


def test_the_bound_on_isotropic_arms_with_a_prismatic_joint_is_attained():
    outcome = solve("isotropy", "lever-revolute:7,prismatic:1", 8, starts=4, workers=1)
    limit = bound("isotropy", outcome.arm)
    # T = 14, the prismatic column has norm 1: t = 14/6 − 13/7.
    assert limit.value == pytest.approx(math.sqrt(14 / 6 - 13 / 7), rel=1e-15)
    assert outcome.best.worst_case_sigma == pytest.approx(limit.value, abs=1e-8)
