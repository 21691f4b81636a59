"""Cells hold the frames of their boxes, and what has no null vector."""

import numpy as np
import pytest
from scipy.optimize import linprog

from lockedjoint.formulations.bounds.lever_cells.cells import no_null_vector
from lockedjoint.formulations.bounds.lever_cells.equations import ends
from tests.formulations.bounds.lever_cells.made_cells import (
    arm,
    cells_at,
    coordinates,
    first_order,
    frames_at,
    parts,
    products,
)

#: Cells, and places in each.
COUNT = 30
PLACES = 30


def made(half, seed=0, reach=0.12):
    """Random numbers and cells of one half side around the frame of an arm."""
    rng = np.random.default_rng(seed)
    middles = rng.uniform(-reach, reach, (COUNT, 6))
    return rng, *cells_at(arm()[:3], middles, half)


@pytest.mark.parametrize("half", [0.003, 0.03, 0.08])
def test_bounds_of_what_follows_first_and_second_order_hold(half):
    """Where bounds are tightest, in small cells, they would not hold five times smaller."""
    rng, chart, found, cells = made(half)
    assert cells.ok.sum() > 0.8 * COUNT
    shares = []
    for _ in range(PLACES):
        places = rng.choice([-1.0, 1.0], (COUNT, 6))
        K, exact = frames_at(chart, found, cells, places, half)
        after_first = coordinates(cells, K) - first_order(cells, places)
        after_second = after_first - (products(places)[:, None] @ cells.K2)[:, 0]
        share = np.linalg.norm(after_first, axis=1) / cells.off
        share3 = np.linalg.norm(after_second, axis=1) / cells.off3
        shares.append(np.stack([share, share3])[:, exact])
    greatest = np.concatenate(shares, 1).max(1)
    assert (greatest <= 1).all()
    assert half > 0.01 or (greatest > 0.2).all()


def test_edges_are_tangent_and_kappa_is_of_the_equations():
    _, _, _, cells = made(0.03)
    edges = cells.edges()
    along = np.einsum("nai,nkab,nbi->nki", cells.W, edges, cells.F)
    assert np.abs(along).max() < 1e-14
    K = edges[:, 0]
    Kf, Kw = K @ cells.F, np.swapaxes(K, 1, 2) @ cells.W
    squares = (Kf**2).sum(1) - (Kw**2).sum(1)
    expected = np.einsum("nim,ni->nm", cells.U / cells.sg[:, None], squares)
    x = coordinates(cells, K)
    assert np.einsum("nmxy,nx,ny->nm", cells.kappa, x, x) == pytest.approx(expected)


def least_entry(W):
    """The greatest least entry of n with W n = 0 and Σ n_i = √7, by linear programming."""
    columns = np.zeros((4, 8))
    columns[:3, :7], columns[3, :7] = W, 1
    most = linprog(
        -np.eye(8)[7],
        A_ub=np.hstack([-np.eye(7), np.ones((7, 1))]),
        b_ub=np.zeros(7),
        A_eq=columns,
        b_eq=[0, 0, 0, np.sqrt(7)],
        bounds=[(None, None)] * 8,
    )
    return -most.fun if most.success else -np.inf


def test_null_vectors_are_those_of_a_linear_program():
    limit = 0.12
    least, _ = ends(limit)
    _, _, _, cells = made(1e-4, seed=1, reach=0.3)
    none = no_null_vector(cells, limit, 1e-9)
    entries = np.array([least_entry(W) for W in cells.W])
    assert not none[entries >= least].any()
    assert none[cells.ok & (entries < least - 0.02)].mean() > 0.9
    assert 0.1 < none.mean() < 0.9


def test_cells_without_null_vector_have_no_frame_with_one():
    limit, half = 0.06, 0.03
    least, _ = ends(limit)
    rng, chart, found, cells = made(half, seed=2, reach=0.3)
    none = no_null_vector(cells, limit, 1e-9)
    assert 0.1 < none.mean() < 0.9
    for _ in range(3):
        places = rng.choice([-1.0, 1.0], (COUNT, 6))
        K, exact = frames_at(chart, found, cells, places, half)
        frames, _ = parts(cells, K)
        assert all(least_entry(W) < least for W in frames[exact & none])
