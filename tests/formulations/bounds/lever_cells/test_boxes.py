"""Boxes of tight frames: bounds hold for exact frames in them, and are no third too large."""

import numpy as np
import pytest

from lockedjoint.formulations.bounds.lever_cells import charts
from lockedjoint.formulations.bounds.lever_cells.boxes import boxes, children
from lockedjoint.formulations.bounds.lever_cells.corners import swap
from lockedjoint.formulations.bounds.lever_cells.traces import trace_range
from tests.formulations.bounds.lever_cells.tight_frames import (
    exact,
    places,
    random_chart,
)

N = 48
ROWS = np.arange(N)
AXES = ROWS % 6
#: What rounding may add to a value, in parts of its bound or alone.
ROUNDING = 1e-9
NAMES = ["rw", "w3", "w_off", "second", "tail", "op", "size", "near"]


def made(seed, half, thin=1.0, near=0.15):
    """Return a chart, and middles, half sides and boxes; `thin`: of all sides but one."""
    rng = np.random.default_rng(seed)
    chart = random_chart(rng)
    t = rng.uniform(-0.1, 0.1, (N, 6))
    h = half * thin * rng.uniform(0.5, 1.3, (N, 6))
    h[ROWS, AXES] = half
    start = charts.middles(chart, t, np.zeros((N, 6)))[0]
    box = boxes(chart, t, h, start, np.zeros((N, 6, 6)), np.full(N, near))
    assert box.ok.all()
    return rng, chart, t, h, box


def lengths(values):
    return np.linalg.norm(values.reshape(N, -1), axis=1)


def shares(box, frames):
    """Return the share of its bound that each value reaches in exact frames, but `near`."""
    G, H, K0 = box.G, box.H, box.K0
    w = frames.z - box.z0 - np.einsum("nk,nkm->nm", frames.tau, box.slope)
    w2 = np.einsum("nk,nl,nklm->nm", frames.tau, frames.tau, box.w2)
    D = np.einsum("nk,nkx->nx", frames.tau, G) + np.einsum("nm,nmx->nx", w, H)
    D = D.reshape(N, 3, 4)
    # K seen from the middle: the frame P has the row space of W + K F
    WP, FP = box.W @ frames.P, box.F @ frames.P
    K = np.linalg.solve(WP @ swap(box.W), WP @ swap(box.F))
    assert np.abs(FP - swap(K) @ WP).max() < 1e-9
    return {
        "rw": lengths(w) / box.rw,
        "w3": lengths(w - w2) / box.w3,
        "w_off": lengths(w - box.w_middle) / box.w_off,
        "second": lengths(K - D) / box.second,
        "tail": lengths(K - D + D @ swap(K0) @ D) / box.tail,
        "op": np.linalg.norm(K, 2, (1, 2)) / box.op,
        "size": lengths(K) / box.size,
    }


def share_of_near(box, frames, axis):
    """Return |z − z_child − tilt·τ| over near, in the halves that the frames are in."""
    lower, upper = children(box, ROWS, axis)
    on_top = frames.tau[ROWS, axis] > 0
    z = np.where(on_top[:, None], upper[0], lower[0])
    tilt = np.where(on_top[:, None, None], upper[1], lower[1])
    tau = frames.tau.copy()
    tau[ROWS, axis] = 2 * tau[ROWS, axis] - np.where(on_top, 1, -1)
    rest = frames.z - z - np.einsum("nk,nkm->nm", tau, tilt)
    return lengths(rest) / np.where(on_top, upper[2], lower[2])


@pytest.fixture(scope="module")
def reached():
    """The greatest shares of bounds over random boxes and exact tight frames in them."""
    most = dict.fromkeys(NAMES, 0.0)
    count = 0
    for seed, half, thin, near in [
        (1, 0.02, 1.0, np.inf),
        (2, 0.05, 1.0, 0.15),
        (3, 0.02, 0.02, 0.15),
        (4, 0.05, 0.02, np.inf),
    ]:
        rng, chart, t, h, box = made(seed, half, thin, near)
        for tau in places(rng, 16, AXES):
            frames = exact(chart, t, h, tau, rng.normal(size=(N, 6)) * 0.02)
            # within what was said of these boxes
            said = frames.found & (lengths(frames.z - box.z0) < 0.15)
            count += said.sum()
            found = shares(box, frames)
            found["near"] = share_of_near(box, frames, AXES)
            for name, share in found.items():
                most[name] = max(most[name], share[said].max())
    assert count > 2900
    return most


@pytest.mark.parametrize("name", NAMES)
def test_every_bound_holds_and_a_third_of_it_would_not(reached, name):
    assert 1 / 3 < reached[name] <= 1 + ROUNDING


def test_what_a_box_hands_down_bounds_its_halves_as_boxes():
    rng, chart, t, h, box = made(5, 0.05)
    axis = h.argmax(1)
    side = h.copy()
    side[ROWS, axis] *= 0.5
    for sign, known in zip((-1, 1), children(box, ROWS, axis), strict=True):
        middle = t.copy()
        middle[ROWS, axis] += sign * side[ROWS, axis]
        half = boxes(chart, middle, side, *known)
        assert half.ok.all()
        assert np.median(half.rw / box.rw) < 0.9
        for tau in places(rng, 8, AXES):
            frames = exact(chart, middle, side, tau, half.z0)
            found = frames.found & (lengths(frames.z - box.z0) < 0.15)
            assert found.mean() > 0.9
            assert max(s[found].max() for s in shares(half, frames).values()) <= 1 + ROUNDING


def test_what_is_known_beforehand_may_be_of_another_middle():
    # of a thin box: frames lie along half a parabola, so within half its length of its middle
    rng, chart, t, h, box = made(13, 0.05, 0.001)
    own = box.w2[ROWS, AXES, AXES]
    near = 0.55 * lengths(own) + box.w3
    again = boxes(chart, t, h, box.z0 + 0.5 * own, box.slope, near)
    wrong = boxes(chart, t, h, box.z0 + own, 0 * box.slope, near + 0.1)
    for tau in places(rng, 9, AXES, alone=True):
        frames = exact(chart, t, h, tau, box.z0)
        rest = frames.z - box.z0 - 0.5 * own - np.einsum("nk,nkm->nm", tau, box.slope)
        assert (lengths(rest) <= near)[frames.found].all()
        for found in (again, wrong):
            assert np.allclose(found.z0, box.z0)
            assert shares(found, frames)["rw"][frames.found].max() <= 1 + ROUNDING


def test_a_box_without_a_tight_frame_in_its_middle_is_not_ok():
    rng = np.random.default_rng(14)
    chart = random_chart(rng, 0.6)
    t = rng.normal(size=(N, 6)) * 0.35
    box = boxes(chart, t, np.full((N, 6), 1e-3), 0 * t, np.zeros((N, 6, 6)), np.full(N, np.inf))
    assert 0 < box.ok.sum() < N
    columns = (box.W**2).sum(1)
    assert np.abs(columns - 3 / 7)[box.ok].max() < 1e-10
    assert np.abs(columns - 3 / 7).max() > 1e-3


def test_a_box_that_is_not_ok_hands_down_nothing():
    *_, box = made(6, 0.05)
    lost = box.take(ROWS)
    lost.ok[:] = False
    for z, tilt, near in children(lost, ROWS, AXES):
        assert np.isinf(near).all()
        assert (tilt == 0).all()
        assert np.array_equal(z, box.z0)
    below, above, _ = trace_range(lost, np.tile(np.eye(7), (N, 1, 1)))
    assert np.isneginf(below).all()
    assert np.isposinf(above).all()


@pytest.mark.parametrize(("seed", "half"), [(7, 0.02), (8, 0.05), (9, 0.08)])
def test_traces_lie_in_their_range_and_reach_most_of_it(seed, half):
    rng, chart, t, h, box = made(seed, half)
    X = rng.normal(size=(N, 7, 7))
    X += swap(X)
    below, above, _ = trace_range(box, X)
    lowest, highest = np.full(N, np.inf), np.full(N, -np.inf)
    for tau in places(rng, 40, AXES):
        frames = exact(chart, t, h, tau, box.z0)
        traces = np.where(frames.found, (frames.P * X).sum((1, 2)), np.nan)
        lowest, highest = np.fmin(lowest, traces), np.fmax(highest, traces)
    assert (below <= lowest + ROUNDING).all()
    assert (above >= highest - ROUNDING).all()
    assert ((highest - lowest) / (above - below)).max() > 0.7


@pytest.mark.parametrize("sign", [1, -1])
def test_a_third_of_the_rest_of_a_trace_would_be_too_little(sign):
    # from the middle tr P P0 falls only to second order; thin boxes need no corners
    rng, chart, t, h, box = made(12, 0.02, 0.001)
    X = sign * swap(box.W) @ box.W
    below, above, rest = trace_range(box, X)
    bound = below if sign > 0 else -above
    share = -np.inf
    for tau in places(rng, 17, AXES, alone=True):
        frames = exact(chart, t, h, tau, box.z0)
        beyond = bound - sign * (frames.P * X).sum((1, 2))
        assert (beyond <= ROUNDING)[frames.found].all()
        share = max(share, ((beyond + rest) / rest)[frames.found].max())
    assert share > 1 / 3


def test_traces_of_diagonal_matrices_are_exact():
    *_, box = made(11, 0.05)
    diagonals = np.random.default_rng(0).normal(size=(N, 7))
    below, above, rest = trace_range(box, diagonals[:, :, None] * np.eye(7))
    value = 3 / 7 * diagonals.sum(1)
    assert np.abs(below - value).max() < ROUNDING
    assert np.abs(above - value).max() < ROUNDING
    assert rest.max() < ROUNDING
