"""Half spaces: weights are the best, and no nearest frame is in a box that is dropped."""

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial import KDTree

from lockedjoint.formulations.bounds.lever_cells import charts
from lockedjoint.formulations.bounds.lever_cells.boxes import boxes
from lockedjoint.formulations.bounds.lever_cells.centres import REACH, SAME, Centres
from lockedjoint.formulations.bounds.lever_cells.half_spaces import nearer
from lockedjoint.formulations.bounds.lever_cells.weights import combinations
from tests.formulations.bounds.lever_cells.tight_frames import (
    exact,
    images,
    places,
    projections,
    surrounded,
    traces,
)

N = 150


@pytest.fixture(scope="module")
def centres():
    return surrounded(np.random.default_rng(0))


@pytest.fixture(scope="module")
def around(centres):
    """Boxes around the first centre at a distance where it may be the nearest, or not."""
    rng = np.random.default_rng(1)
    chart = centres.charts[0]
    t = rng.normal(size=(N, 6))
    t *= rng.uniform(0.1, 0.35, (N, 1)) / np.linalg.norm(t, axis=1)[:, None]
    h = 0.025 * rng.uniform(0.3, 1, (N, 6))
    z = charts.middles(chart, t, np.zeros((N, 6)))[0]
    return t, h, boxes(chart, t, h, z, np.zeros((N, 6, 6)), np.full(N, 0.15))


def same(some, others):
    """Whether each of the matrices is among the others, (N,) of truth values."""
    trees = [KDTree(one.reshape(len(one), -1)) for one in (others, some)]
    return trees[0].query(trees[1].data, distance_upper_bound=1e-6)[0] < 1e-9


@pytest.mark.parametrize("a", [0, 1])
def test_near_are_the_nearest_of_all_images(centres, a):
    """By all 5040 orders and 64 signs of both centres, in double precision."""
    both = Centres.of_frames([centres.charts[k].W for k in (0, 30)], 0.5)
    every = np.concatenate([images(chart.W) for chart in both.charts])
    squared = 3 - traces(both.charts[a].W, every)
    # none is at the limit, which single precision has not exactly
    limit = (REACH * both.radius) ** 2
    assert np.abs(squared - limit).min() > 1e-6
    within = np.flatnonzero((squared > SAME) & (squared < limit))
    P = np.swapaxes(every[within], 1, 2) @ every[within]
    more = both.near(a, 10**6)
    assert len(more.X) == len(within) > 200
    # some have other signs of columns, and some are of each centre
    assert (within % 64 > 0).any()
    assert 0 < (within < 5040 * 64).mean() < 1
    assert same(more.X + both.P[a], P).all()
    assert same(P, more.X + both.P[a]).all()
    few = both.near(a, 40)
    assert len(few.X) == 40
    found = -(few.X * both.P[a]).sum((1, 2))
    assert found == pytest.approx(np.sort(squared[within])[:40], abs=1e-5)


def test_half_spaces_are_of_projections_with_the_same_diagonal(centres):
    more = centres.near(7, 4000)
    P = more.X + centres.P[7]
    assert np.allclose(P @ P, P)
    assert np.abs(more.X[:, range(7), range(7)]).max() < 1e-12
    assert np.allclose(more.rough.T, 2 * more.X[:, *np.triu_indices(7, 1)], atol=1e-6)


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_a_nearest_frame_is_in_no_box_that_is_dropped(centres, around, share):
    t, h, box = around
    half = centres.near(0, 4000)
    bound, _ = nearer(box, half, centres.P[0], share=share)
    dropped = box.ok & (bound > 1e-9)
    assert 0.1 < dropped.mean() < 0.9
    rng, nearest = np.random.default_rng(2), 0
    for tau in places(rng, 24, np.arange(N) % 6):
        frames = exact(centres.charts[0], t, h, tau, box.z0)
        found = frames.found & (np.linalg.norm(frames.z - box.z0, axis=1) < 0.15)
        others = frames.P.reshape(N, 49) @ half.X.reshape(-1, 49).T
        assert (others.max(1) >= bound - 1e-9)[found].all()
        is_nearest = found & (others.max(1) < 0)
        nearest += is_nearest.sum()
        assert not (is_nearest & dropped).any()
    assert nearest > 300


def test_with_a_level_bounds_hold_for_the_frames_at_it(centres, around):
    t, h, box = around
    chart, P0 = centres.charts[0], centres.P[0]
    half, rng, checked = centres.near(0, 4000), np.random.default_rng(3), 0
    for tau in places(rng, 12, np.arange(N) % 6):
        # the frames of different boxes are at different levels: each sets its own
        frames = exact(chart, t, h, tau, box.z0)
        found = frames.found & (np.linalg.norm(frames.z - box.z0, axis=1) < 0.15)
        own = (frames.P * P0).sum((1, 2))
        others = frames.P.reshape(N, 49) @ half.X.reshape(-1, 49).T
        for i in np.flatnonzero(found)[:6]:
            bound = nearer(box.take([i]), half, P0, level=own[i])[0][0]
            assert bound <= others[i].max() + 1e-9
            checked += 1
    with_level = nearer(box, half, P0, level=centres.level)[0]
    without = nearer(box, half, P0)[0]
    # a multiplier of the level helps
    assert ((with_level > 0) & box.ok).sum() > ((without > 0) & box.ok).sum()
    assert checked > 60


def test_charts_hold_the_frames_above_the_level(centres):
    # K of any frame, tight or not: tr P P_c >= 3 - R² only where |K| is at most T
    rng = np.random.default_rng(4)
    for a in (0, 7):
        chart = centres.charts[a]
        K = rng.normal(size=(2000, 12)) * rng.uniform(0, 1, (2000, 12)) ** 4
        K *= (
            chart.greatest * rng.uniform(1, 1.2, (2000, 1)) / np.linalg.norm(K, axis=1)[:, None]
        )
        K[0] = 0.0
        K[0, 0] = chart.greatest
        own = (projections(chart, K.reshape(-1, 3, 4)) * centres.P[a]).sum((1, 2))
        level = centres.level
        assert own.max() <= level + 1e-12
        # of one angle only: on the sphere |K| = T the level is reached
        assert own[0] == pytest.approx(level, abs=1e-12)


def programs(rng, number=40, n=24):
    """Return random programs like those of boxes: few are positive."""
    m = rng.normal(size=(number, n)) - 0.5
    return (
        m,
        rng.normal(size=(number, n, 6)),
        rng.normal(size=number),
        rng.normal(size=(number, 6)),
    )


def value(lam, mu, m, a, r0, r):
    slopes = np.einsum("ni,nik->nk", lam, a) + mu[:, None] * r
    return (lam * m).sum(1) + mu * r0 - np.abs(slopes).sum(1)


def by_scipy(m, a, r0, r):
    """Return the best value of one program: minimise −Σ λ m − μ r0 + Σ s, s ≥ ± slopes."""
    n = len(m)
    slopes = np.hstack([a.T, r[:, None]])
    unequal = np.vstack([np.hstack([sign * slopes, -np.eye(6)]) for sign in (1, -1)])
    found = linprog(
        np.concatenate([-m, [-r0], np.ones(6)]),
        A_ub=unequal,
        b_ub=np.zeros(12),
        A_eq=np.concatenate([np.ones(n), np.zeros(7)])[None],
        b_eq=[1.0],
        bounds=[(0, None)] * n + [(None, None)] + [(0, None)] * 6,
    )
    assert found.status == 0
    return -found.fun


def test_weights_are_feasible_and_the_best():
    m, a, r0, r = programs(np.random.default_rng(5))
    r0 *= 0.1  # else the program may be without bound
    lam, mu, reached = combinations(m, a, r0, r)
    assert (lam >= 0).all()
    assert np.allclose(lam.sum(1), 1)
    assert np.allclose(value(lam, mu, m, a, r0, r), reached)
    best = [by_scipy(*one) for one in zip(m, a, r0, r, strict=True)]
    assert np.allclose(reached, best, atol=1e-6)
    assert np.abs(mu).max() > 0.1


@pytest.mark.parametrize("pivots", [0, 1, 5])
def test_weights_are_feasible_also_where_pivots_run_out(pivots):
    m, a, r0, r = programs(np.random.default_rng(6))
    lam, mu, reached = combinations(m, a, 0 * r0, 0 * r, pivots)
    assert (lam >= 0).all()
    assert np.allclose(lam.sum(1), 1)
    assert (mu == 0).all()
    assert np.allclose(value(lam, mu, m, a, r0, r), reached)
