"""What multipliers exclude: never an arm, and the bounds of the forms hold."""

import dataclasses

import numpy as np
import pytest

from lockedjoint.formulations.bounds.lever_cells.cells import no_null_vector
from lockedjoint.formulations.bounds.lever_cells.certificates import (
    excluded,
    positive,
    values,
    without_squares,
)
from lockedjoint.formulations.bounds.lever_cells.corners import (
    FIRST,
    MONOMIALS,
    SECOND,
    swap,
    symmetric_size,
)
from lockedjoint.formulations.bounds.lever_cells.equations import Multipliers
from lockedjoint.formulations.bounds.lever_cells.expansion import Expansion
from lockedjoint.formulations.bounds.lever_cells.forms import Forms
from lockedjoint.formulations.bounds.lever_cells.multipliers import multipliers
from tests.formulations.bounds.lever_cells.made_cells import (
    arm,
    cells_at,
    exact_forms,
    exact_sum,
    frames_at,
    largest_lever_arm,
)

#: Cells.
COUNT = 30
#: What a certificate must exceed.
MARGIN = 1e-6
#: A limit below all lever arms that are known.
LIMIT = 0.0798


def made(half, seed=0, reach=0.12):
    """Random numbers, chart, boxes and cells around the frame of an arm, their expansion."""
    rng = np.random.default_rng(seed)
    chart, found, cells = cells_at(arm()[:3], rng.uniform(-reach, reach, (COUNT, 6)), half)
    return rng, chart, found, cells, Expansion.of_cells(cells)


def at_place(coefficients, places):
    """Matrices (N,28,n,n) at places (N,6)."""
    pairs = places[:, FIRST] * places[:, SECOND]
    monomials = np.concatenate([np.ones((len(places), 1)), places, pairs], 1)
    return np.einsum("np,npij->nij", monomials, coefficients)


def plain_forms(expansion):
    """Forms of multipliers that make the form of (V̂, q) |V̂|², and that of (1, q) |q|²."""
    rows = np.zeros((COUNT, 89))
    rows[:, [0, 4, 7]] = 1  # lengths of the first three rows
    rows[:, 37:53] = np.eye(4).ravel()
    return Forms.of(expansion, Multipliers.unpacked(rows), LIMIT)


def worst_shares(half, forms_of):
    """The greatest shares that exact Y and X have of the errors that are allowed for."""
    rng, chart, found, cells, expansion = made(half)
    forms = forms_of(expansion)
    Y, X = forms.second_order_Y(), forms.second_order_X()
    shares = []
    for _ in range(30):
        places = rng.choice([-1.0, 1.0], (COUNT, 6))
        K, exact = frames_at(chart, found, cells, places, half)
        exact_Y, exact_X = exact_forms(forms, K)
        share_Y = symmetric_size(exact_Y - at_place(Y, places)) / forms.error_Y()
        share_X = symmetric_size(exact_X - at_place(X, places)) / forms.error_X()
        shares.append(np.stack([share_Y, share_X])[:, exact])
    return np.concatenate(shares, 1).max(1)


@pytest.mark.parametrize("half", [0.003, 0.03])
def test_errors_of_forms_hold_and_would_not_if_five_times_smaller(half):
    shares = worst_shares(half, plain_forms)
    assert (shares <= 1).all()
    assert half > 0.01 or (shares > 0.2).all()


@pytest.mark.parametrize("half", [0.003, 0.05])
def test_errors_of_forms_hold_for_multipliers_of_programs(half):
    shares = worst_shares(
        half, lambda expansion: Forms.of(expansion, multipliers(expansion, LIMIT)[1], LIMIT)
    )
    assert (shares <= 1).all()


@pytest.mark.parametrize("half", [0.01, 0.04])
def test_values_are_below_the_exact_sum(half):
    rng, chart, found, cells, expansion = made(half)
    good, m = multipliers(expansion, LIMIT)
    value = values(expansion, m, LIMIT)
    assert (good & np.isfinite(value)).mean() > 0.7
    for _ in range(10):
        places = rng.choice([-1.0, 1.0], (COUNT, 6))
        K, exact = frames_at(chart, found, cells, places, half)
        some = exact & np.isfinite(value)
        assert (value[some] < exact_sum(cells, m, LIMIT, K)[some]).all()


@pytest.mark.parametrize("half", [0.01, 0.025])
def test_excluded_are_cells_with_values_above_the_margin(half):
    _, _, _, _, expansion = made(half)
    _, m = multipliers(expansion, LIMIT)
    value = values(expansion, m, LIMIT)
    for margin in (MARGIN, np.median(value)):
        found, forms = excluded(expansion, m, LIMIT, margin)
        assert found.any()
        assert (value[found] > margin - 1e-8).all()
        assert found[value > margin + 1e-8].mean() > 0.9
        assert forms.scores().shape == (COUNT, 6)
    # one by one
    third = np.array([2])
    alone, _ = excluded(expansion.take(third), m.take(third), LIMIT, margin)
    assert alone == found[third]


def test_negative_or_infinite_multipliers_exclude_nothing():
    _, _, _, _, expansion = made(0.01)
    _, m = multipliers(expansion, LIMIT)
    assert excluded(expansion, m, LIMIT, MARGIN)[0].all()
    for place, value in ((60, -1e-9), (74, -1e-9), (87, -1e-9), (0, np.nan), (88, np.inf)):
        rows = m.packed()
        rows[3, place] = value
        found, _ = excluded(expansion, Multipliers.unpacked(rows), LIMIT, MARGIN)
        assert not found[3]
        assert found.sum() == COUNT - 1
        assert not excluded(expansion, Multipliers.unpacked(rows), LIMIT, -1.0)[0][3]


def test_cells_whose_bounds_do_not_hold_are_not_excluded():
    _, _, _, cells, expansion = made(0.01)
    _, m = multipliers(expansion, LIMIT)
    doubtful = dataclasses.replace(cells, ok=np.arange(COUNT) != 3)
    found, _ = excluded(dataclasses.replace(expansion, cells=doubtful), m, LIMIT, MARGIN)
    assert found.tolist() == doubtful.ok.tolist()
    assert values(dataclasses.replace(expansion, cells=doubtful), m, LIMIT)[3] == -np.inf


def test_frame_of_the_arm_is_excluded_below_its_lever_arms_only():
    best = arm()
    assert largest_lever_arm(best[6]) == pytest.approx(0.1026912, abs=1e-7)
    _, _, cells = cells_at(best[:3], np.zeros((1, 6)), 0.02)
    expansion = Expansion.of_cells(cells)
    outcomes = []
    for limit in (0.06, 0.11):
        _, m = multipliers(expansion, limit)
        outcomes.append(bool(excluded(expansion, m, limit, MARGIN)[0][0]))
    assert outcomes == [True, False]


def test_cells_with_an_arm_are_never_excluded():
    """Also by multipliers for a smaller limit, which do exclude the best arm's frame there."""
    rng = np.random.default_rng(5)
    arms = [arm()]
    while len(arms) < 8:
        found = arm(arm() + 0.08 * rng.normal(size=(7, 7)))
        arms += [found] if found[6].min() > 0 else []
    below = []
    for Q in arms:
        limit = largest_lever_arm(Q[6]) + 1e-9
        for half in (0.003, 0.02):
            # the arm's frame has the coordinates 0
            middles = half * rng.uniform(-0.99, 0.99, (6, 6))
            _, _, cells = cells_at(Q[:3], middles, half)
            expansion = Expansion.of_cells(cells)
            assert not no_null_vector(cells, limit, 0.0).any()
            for smaller in (limit, limit - 0.03):
                _, m = multipliers(expansion, smaller)
                assert not excluded(expansion, m, limit, 0.0)[0].any()
            below.append(excluded(expansion, m, smaller, 0.0)[0].sum())
    assert below[0] == 6


def test_corners_without_squares_are_below_all_places():
    rng = np.random.default_rng(7)
    coefficients = rng.normal(size=(50, 28, 4, 4))
    coefficients = coefficients + swap(coefficients)
    corners = np.einsum("pc,npij->ncij", MONOMIALS, without_squares(coefficients))
    lower = np.linalg.eigvalsh(corners)[..., 0].min(1)
    for reach in (0.0, 0.3, 1.0):
        for _ in range(20):
            places = reach * rng.uniform(-1, 1, (50, 6))
            assert (np.linalg.eigvalsh(at_place(coefficients, places))[:, 0] >= lower).all()
    # positive squares are left out, negative ones counted in full
    squares = np.zeros((2, 28, 1, 1))
    squares[:, 7, 0, 0] = 1.0, -1.0
    assert without_squares(squares)[:, 0, 0, 0].tolist() == [0.0, -1.0]


def test_positive_matrices_are_those_with_positive_eigenvalues():
    rng = np.random.default_rng(6)
    A = rng.normal(size=(200, 5, 5))
    A = A + swap(A) + 4 * np.eye(5)
    column, row = np.triu_indices(5)
    expected = np.linalg.eigvalsh(A)[:, 0] > 0
    assert 20 < expected.sum() < 180
    assert (positive(A[:, row, column].T.copy(), 5) == expected).all()
    not_a_number = np.full((15, 1), np.nan)
    assert not positive(not_a_number, 5).any()
