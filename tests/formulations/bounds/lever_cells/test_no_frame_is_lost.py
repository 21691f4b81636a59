"""That trees lose no frame and no arm: they are followed down with one in their boxes."""

import dataclasses

import numpy as np
import pytest

from lockedjoint.formulations.bounds.lever_cells.arms import with_signs
from lockedjoint.formulations.bounds.lever_cells.boxes import boxes
from lockedjoint.formulations.bounds.lever_cells.cells import Cells
from lockedjoint.formulations.bounds.lever_cells.centres import SIGNS, Centres
from lockedjoint.formulations.bounds.lever_cells.certificates import excluded, values
from lockedjoint.formulations.bounds.lever_cells.charts import tight_chart
from lockedjoint.formulations.bounds.lever_cells.equations import Multipliers, ends
from lockedjoint.formulations.bounds.lever_cells.expansion import Expansion
from lockedjoint.formulations.bounds.lever_cells.multipliers import multipliers
from lockedjoint.formulations.bounds.lever_cells.nodes import Nodes
from lockedjoint.formulations.bounds.lever_cells.regions import Region
from lockedjoint.formulations.bounds.lever_cells.traces import trace_range
from tests.formulations.bounds.lever_cells.followed import (
    down_arms,
    down_region,
    holding,
    moved,
    place,
)
from tests.formulations.bounds.lever_cells.made_cells import (
    arm,
    cells_at,
    exact_sum,
    frames_at,
    largest_lever_arm,
)
from tests.formulations.bounds.lever_cells.tight_frames import random_chart

RADIUS = 0.25
#: Half side of boxes in which frames are followed to the end.
SMALLEST = 2e-3
#: Angles of the columns of the frame with the most symmetries.
ANGLES = 2 * np.pi * np.arange(7) / 7
HARMONIC = np.array([np.ones(7), np.sqrt(2) * np.cos(ANGLES), np.sqrt(2) * np.sin(ANGLES)])


def turned(rng, W):
    """The same frame with its columns in another order and with other signs."""
    return (W * rng.choice([-1.0, 1.0], 7))[:, rng.permutation(7)]


@pytest.fixture(scope="module")
def made():
    """Three centres, one near an arm, with the regions of each."""
    rng = np.random.default_rng(3)
    near_arm = tight_chart(arm()[:3] + 0.04 * rng.normal(size=(3, 7)), 0.1).W
    found = Centres.of_frames(
        [turned(rng, near_arm), random_chart(rng).W, random_chart(rng).W], RADIUS
    )
    return found, [Region.of(found, a) for a in range(3)]


def near_frame(rng, chart, reach):
    """A tight frame in a chart, about so far from the centre."""
    while True:
        t = rng.normal(size=6)
        K = (reach * t / np.linalg.norm(t) @ chart.B).reshape(3, 4)
        try:
            return tight_chart(chart.W + K @ chart.F, 0.1).W
        except ValueError:
            continue


def test_columns_with_other_signs_fulfil_the_same_equations():
    rng = np.random.default_rng(1)
    middles = rng.uniform(-0.05, 0.05, (12, 6))
    _, plain, _ = cells_at(arm()[:3], middles, 0.02)
    cells = Cells.of_boxes(with_signs(plain, SIGNS[rng.integers(1, 64, 12)]))
    A = np.einsum("nai,nbi->niab", cells.W, cells.F).reshape(12, 7, 12)
    assert np.abs((cells.U * cells.sg[:, None]) @ cells.C - A).max() < 1e-13
    L = rng.normal(size=(12, 12))
    matrix = np.einsum("nx,nxy->ny", L, np.concatenate([cells.B, cells.C], 1))
    matrix = matrix.reshape(-1, 3, 4)
    Lf, Lw = matrix @ cells.F, matrix.transpose(0, 2, 1) @ cells.W
    kappa = np.einsum("nmxy,nx,ny->nm", cells.kappa, L, L)
    along = np.einsum("nim,ni->nm", cells.U, (Lf**2).sum(1) - (Lw**2).sum(1))
    assert np.abs(cells.sg * kappa - along).max() < 1e-12


def test_values_are_below_the_exact_sum_with_any_signs():
    rng = np.random.default_rng(2)
    half, N, limit = 0.02, 30, 0.0798
    signs = SIGNS[rng.integers(1, 64, N)]
    middles = half * rng.uniform(-0.9, 0.9, (N, 6))
    chart, found, plain = cells_at(arm()[:3], middles, half)
    cells = Cells.of_boxes(with_signs(found, signs))
    expansion = Expansion.of_cells(cells)
    good, m = multipliers(expansion, limit)
    value = values(expansion, m, limit)
    assert (good & np.isfinite(value)).mean() > 0.5
    for _ in range(8):
        places = rng.choice([-1.0, 1.0], (N, 6))
        K, exact = frames_at(chart, found, plain, places, half)
        some = exact & np.isfinite(value)
        assert (value[some] < exact_sum(cells, m, limit, K)[some]).all()


def test_frames_are_in_boxes_of_the_region_nearest_to_them(made):
    found, regions = made
    rng = np.random.default_rng(4)
    outcomes = []
    for i in range(15):
        frame = near_frame(rng, found.charts[i % 3], rng.uniform(0.05, 0.24))
        new, squared = moved(found, turned(rng, frame))
        assert squared < RADIUS**2
        region = regions[new.a]
        left = down_region(region, place(region.chart, new.W), SMALLEST)
        outcomes.append(len(left) > 0)
    assert all(outcomes)


def test_frames_nearer_to_another_image_are_dropped(made):
    for region in made[1]:
        assert len(region.half_spaces.X) > 3
        for X in region.half_spaces.X[:4]:
            frame = np.linalg.eigh(X + region.P)[1][:, -3:].T
            left = down_region(region, place(region.chart, frame), SMALLEST)
            assert not len(left)


def test_frames_on_a_sphere_are_kept_where_no_image_is_nearer(made):
    found, regions = made
    rng = np.random.default_rng(6)
    kept = dropped = 0
    while kept < 6:
        a = kept % 3
        reach = np.array([0.2, 0.3])
        direction = rng.normal(size=6)
        direction /= np.linalg.norm(direction)
        for _ in range(50):
            K = (reach.mean() * direction @ found.charts[a].B).reshape(3, 4)
            frame = tight_chart(found.charts[a].W + K @ found.charts[a].F, 0.1).W
            inside = np.trace(frame.T @ frame @ found.P[a]) > found.level
            reach[0 if inside else 1] = reach.mean()
        t = place(found.charts[a], frame)
        if reach[1] - reach[0] > 1e-9:
            continue
        left = down_region(regions[a], t, SMALLEST, sphere=True)
        nearest = float(found.squared_distances(frame.T @ frame).min())
        if nearest > RADIUS**2 - 1e-6:
            assert len(left)
            kept += 1
        elif nearest < RADIUS**2 - 1e-2:
            dropped += not len(left)
    assert dropped


def test_frame_as_near_to_two_images_is_in_both_regions(made):
    """A frame half way to an image is kept where it is, and where the image's place is."""
    found, regions = made
    rng = np.random.default_rng(7)
    region, chart = regions[0], found.charts[0]
    tried = 0
    while tried < 5:
        direction = rng.normal(size=6)
        direction /= np.linalg.norm(direction)
        reach = np.array([0.0, 0.24])
        for _ in range(50):
            K = (reach.mean() * direction @ chart.B).reshape(3, 4)
            frame = tight_chart(chart.W + K @ chart.F, 0.1).W
            P = frame.T @ frame
            other = np.einsum("nij,ij->n", region.half_spaces.X, P).max()
            reach[0 if other < 0 else 1] = reach.mean()
        if reach[0] == 0 or reach[1] == 0.24:
            continue
        beyond, _ = moved(found, frame + 1e-3 * (K @ chart.F))
        new = np.empty((3, 7))
        new[:, beyond.order] = beyond.signs * frame
        own = (frame.T @ frame * found.P[0]).sum()
        assert (new.T @ new * found.P[beyond.a]).sum() == pytest.approx(own, abs=1e-11)
        assert np.abs(new.T @ new - P).max() > 1e-3
        assert len(down_region(region, place(chart, frame), SMALLEST))
        there = regions[beyond.a]
        assert len(down_region(there, place(there.chart, new), SMALLEST))
        tried += 1


def test_frame_with_the_most_symmetries_is_kept():
    rng = np.random.default_rng(7)
    W = HARMONIC / np.sqrt(7)
    centre = tight_chart(W + 0.05 * rng.normal(size=(3, 7)), 0.1).W
    found = Centres.of_frames([centre], RADIUS)
    region = Region.of(found, 0)
    squared = found.squared_distances(W.T @ W)
    assert (squared < squared.min() + 1e-5).sum() == 14  # the symmetries of a heptagon
    assert len(down_region(region, place(region.chart, moved(found, W)[0].W), SMALLEST))


def test_arms_are_in_boxes_that_are_left_for_their_lever_arms_only(made):
    found, regions = made
    rng = np.random.default_rng(8)
    best = arm()
    for _ in range(4):
        order, signs = rng.permutation(7), rng.choice([-1.0, 1.0], 7)
        Q = (best * signs)[:, order]
        new, squared = moved(found, Q[:3])
        assert squared < RADIUS**2
        region, n = regions[new.a], new.row(Q[6])
        assert np.abs(new.W @ n).max() < 1e-10
        t, limit = place(region.chart, new.W), largest_lever_arm(best[6])
        left, tally = down_arms(region, t, n, limit + 1e-9, SMALLEST)
        assert len(left) == 1
        assert tally.programs > 3
        assert not len(down_arms(region, t, n, limit - 0.02, SMALLEST)[0])


def test_cut_boxes_know_as_much_of_the_frames_in_them():
    """Boxes cut to |t| ≤ T: what their parents knew of z holds for the frames that are left."""
    rng = np.random.default_rng(9)
    chart = tight_chart(arm()[:3], 0.06)
    nodes, cut = Nodes.cube(chart.greatest), 0
    frames = [near_frame(rng, chart, rng.uniform(0.2, 0.25)) for _ in range(40)]
    K = [np.linalg.solve(W @ chart.W.T, W @ chart.F.T).ravel() for W in frames]
    t, z = np.array(K) @ chart.B.T, np.array(K) @ chart.C.T
    near = (t**2).sum(1) + (z**2).sum(1) < chart.greatest**2
    t, z = t[near], z[near]
    assert len(t) > 10
    for _ in range(22):
        nodes = nodes.take(~nodes.outside(chart))
        before, nodes = nodes, nodes.cut_to(chart)
        cut += int((nodes.h < before.h).any(1).sum())
        c = boxes(chart, nodes.t, nodes.h, nodes.z, nodes.tilt, nodes.near)
        for one_t, one_z in zip(t, z, strict=True):
            held = holding(nodes, one_t)
            assert len(held)
            tau = (one_t - held.t) / held.h
            known = held.z + np.einsum("nk,nkm->nm", tau, held.tilt)
            assert (np.linalg.norm(one_z - known, axis=1) <= held.near).all()
        if nodes.h.max() < 0.05:
            break
        halves = nodes.halves(c, nodes.h.argmax(1))
        # one box for each frame and its neighbours is enough
        keep = np.zeros(len(halves), bool)
        for one_t in t:
            keep |= (np.abs(one_t - halves.t) <= halves.h * (1 + 1e-9)).all(1)
        nodes = halves.take(keep)
    assert cut > 10
    assert np.isfinite(nodes.near).mean() > 0.5


def test_ends_of_null_vectors_are_those_of_isotropic_arms():
    """(3/7)(1 + |v_i|²) + n_i² = 1 for each column of an orthogonal 7×7 matrix."""
    for Q in (arm(), arm(arm() + 0.05 * np.random.default_rng(1).normal(size=(7, 7)))):
        lever_arms = 7 / 3 * (Q[3:6] ** 2).sum(0) - 1
        least, most = ends(lever_arms.max())
        assert np.abs(Q[6]).min() == pytest.approx(least, abs=1e-9)
        assert np.abs(Q[6]).max() <= most


def test_unsound_frames_have_no_bounds():
    chart = tight_chart(arm()[:3], 0.06)
    nothing = np.zeros((1, 6)), np.zeros((1, 6, 6)), np.full(1, np.inf)
    sides = np.full((1, 6), 0.01)
    assert boxes(chart, np.zeros((1, 6)), sides, *nothing).ok.all()
    slanted = dataclasses.replace(chart, F=chart.F * (1 + 1e-12))
    assert not boxes(slanted, np.zeros((1, 6)), sides, *nothing).ok.any()


def test_harmonic_frame_is_exactly_tight():
    W = HARMONIC / np.sqrt(7)
    assert np.abs(W @ W.T - np.eye(3)).max() < 1e-15
    assert np.abs((W**2).sum(0) - 3 / 7).max() < 1e-15


def test_cut_boxes_have_the_same_linear_function():
    rng = np.random.default_rng(10)
    chart = tight_chart(arm()[:3], 0.06)
    nodes = dataclasses.replace(
        Nodes.cube(0.1),
        t=np.full((1, 6), 0.16),
        z=rng.normal(size=(1, 6)),
        tilt=rng.normal(size=(1, 6, 6)),
        near=np.ones(1),
    )
    cut = nodes.cut_to(chart)
    assert (cut.h < nodes.h).all()
    assert cut.near == pytest.approx(1.0)
    for tau in rng.uniform(-1, 1, (20, 6)):
        t = cut.t[0] + tau * cut.h[0]
        before = nodes.z[0] + (t - nodes.t[0]) / nodes.h[0] @ nodes.tilt[0]
        assert cut.z[0] + tau @ cut.tilt[0] == pytest.approx(before, abs=1e-12)


def test_large_numbers_prove_nothing():
    """The bounds of rounding errors rest on these tests."""
    _, found, cells = cells_at(arm()[:3], np.zeros((2, 6)), 0.01)
    X = np.stack([np.eye(7), 1e3 * np.eye(7)])
    below, above, _ = trace_range(found, X)
    assert np.isfinite(below).tolist() == np.isfinite(above).tolist() == [True, False]
    expansion = Expansion.of_cells(cells)
    _, m = multipliers(expansion, 0.07)
    rows = m.packed()
    rows[1] *= 2.5 / np.linalg.norm(rows[1])
    longer = Multipliers.unpacked(rows)
    assert excluded(expansion, longer, 0.07, 1e-6)[0].tolist() == [True, False]
    wide = dataclasses.replace(expansion.rest, theta=np.array([0.9, 0.4]))
    wide = dataclasses.replace(expansion, rest=wide)
    assert excluded(wide, m, 0.07, 1e-6)[0].tolist() == [True, False]
    # directions that are not orthonormal
    slanted = dataclasses.replace(found, C=found.C * (1 + np.array([0, 1e-12]))[:, None, None])
    assert Cells.of_boxes(slanted).ok.tolist() == [True, False]
